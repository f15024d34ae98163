"""Who asked for a job and in which request, its plan apart from its progress, and an index of the states.

Plans of earlier jobs stay in their progress: to move them would write all payloads and results anew.

Revision ID: 0004
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the columns and the index."""
    op.add_column("jobs", sa.Column("request_id", sa.String(128)))
    op.add_column("jobs", sa.Column("key_id", sa.String(64)))
    op.add_column("jobs", sa.Column("assignment", sa.JSON))
    op.create_index("ix_jobs_status_number", "jobs", ["status", "number"])


def downgrade() -> None:
    """Remove them; plans of unfinished jobs are lost, but for what their results have."""
    op.drop_index("ix_jobs_status_number", "jobs")
    for name in ("assignment", "key_id", "request_id"):
        op.drop_column("jobs", name)
