"""Alembic migrations of the jobs room; their version table is ``alembic_version_jobs``."""
