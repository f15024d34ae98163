"""Who asked for a job and in which request, results that are not complete, and what is large last.

SQLite reads a row up to the last column that is asked for, so a list of jobs read all payloads and results.
Plans have a column apart from the progress; those of earlier jobs stay there.

Revision ID: 0004
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

_SMALL = (
    "number, id, kind, lane, status, error, progress, attempt, losses, owner, cancel_requested, deadline, "
    "created_at, started_at, finished_at"
)


def upgrade() -> None:
    """Add the columns, in SQLite to a new table, and an index of the states."""
    if op.get_bind().dialect.name == "sqlite":
        _build_anew()
    else:
        op.add_column("jobs", sa.Column("request_id", sa.String(128)))
        op.add_column("jobs", sa.Column("key_id", sa.String(64)))
        op.add_column("jobs", sa.Column("unfinished", sa.Integer))
        op.add_column("jobs", sa.Column("assignment", sa.JSON))
    op.create_index("ix_jobs_status_number", "jobs", ["status", "number"])
    some = sa.text("unfinished IS NOT NULL")
    op.create_index(
        "ix_jobs_unfinished", "jobs", ["unfinished", "number"], sqlite_where=some, postgresql_where=some
    )


def downgrade() -> None:
    """Remove them; plans of unfinished jobs are lost, but for what their results have."""
    op.drop_index("ix_jobs_unfinished", "jobs")
    op.drop_index("ix_jobs_status_number", "jobs")
    for name in ("assignment", "unfinished", "key_id", "request_id"):
        op.drop_column("jobs", name)


def _build_anew() -> None:
    op.create_table(
        "jobs_anew",
        sa.Column("number", sa.Integer, primary_key=True, autoincrement=True),
        sa.Column("id", sa.String(32), nullable=False, unique=True),
        sa.Column("kind", sa.String(64), nullable=False),
        sa.Column("lane", sa.String(16), nullable=False),
        sa.Column("status", sa.String(16), nullable=False),
        sa.Column("error", sa.JSON),
        sa.Column("progress", sa.JSON, nullable=False),
        sa.Column("attempt", sa.Integer, nullable=False),
        sa.Column("losses", sa.Integer, nullable=False),
        sa.Column("owner", sa.String(255)),
        sa.Column("cancel_requested", sa.Boolean, nullable=False),
        sa.Column("deadline", sa.Double),
        sa.Column("created_at", sa.Double, nullable=False),
        sa.Column("started_at", sa.Double),
        sa.Column("finished_at", sa.Double),
        sa.Column("request_id", sa.String(128)),
        sa.Column("key_id", sa.String(64)),
        sa.Column("unfinished", sa.Integer),
        sa.Column("assignment", sa.JSON),
        sa.Column("payload", sa.JSON, nullable=False),
        sa.Column("result", sa.JSON),
        sqlite_autoincrement=True,
    )
    op.execute(
        f"INSERT INTO jobs_anew ({_SMALL}, payload, result) SELECT {_SMALL}, payload, result "
        "FROM jobs ORDER BY number"
    )
    op.drop_table("jobs")
    op.rename_table("jobs_anew", "jobs")
    op.create_index("ix_jobs_status_lane_number", "jobs", ["status", "lane", "number"])
    op.create_index("ix_jobs_finished_at", "jobs", ["finished_at"])
