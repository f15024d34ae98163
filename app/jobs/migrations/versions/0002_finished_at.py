"""An index on the end of jobs: those that are to be forgotten are found without reading all others."""

from __future__ import annotations

from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Make the index."""
    op.create_index("ix_jobs_finished_at", "jobs", ["finished_at"])
