"""Alembic's folder of the key table."""
