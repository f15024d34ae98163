"""Who asked for a job and in which request, results that are not complete, and what is large last.

SQLite reads a row up to the last column that is asked for, so a list of jobs read all payloads and results.
Plans have a column apart from the progress; those of earlier jobs stay there.

Revision ID: 0004
"""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Add the columns, in SQLite to a new table, and an index of the states."""
    new: list[sa.Column[Any]] = [
        sa.Column("request_id", sa.String(128)),
        sa.Column("key_id", sa.String(64)),
        sa.Column("unfinished", sa.Integer),
        sa.Column("assignment", sa.JSON),
    ]
    order = "finished_at", *(column.name for column in new), "payload", "result"
    with op.batch_alter_table(
        "jobs",
        recreate="always" if op.get_bind().dialect.name == "sqlite" else "never",
        table_kwargs={"sqlite_autoincrement": True},
        partial_reordering=[order],
    ) as jobs:
        for column in new:
            jobs.add_column(column)
    op.create_index("ix_jobs_status_number", "jobs", ["status", "number"])
    some = sa.text("unfinished IS NOT NULL")
    op.create_index(
        "ix_jobs_unfinished", "jobs", ["unfinished", "number"], sqlite_where=some, postgresql_where=some
    )
