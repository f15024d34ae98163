"""Alembic's folder for the tables of the policy library."""
