"""Alembic's folder of the tables of missions."""
