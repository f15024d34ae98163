"""The tables of the jobs room, as the newest migration leaves them.

Times are seconds since 1970 UTC: they are compared and subtracted, and the sort is the same in every
database. ``jobs.number`` counts submissions: it is the order of the queue and of the pages.
"""

from __future__ import annotations

import sqlalchemy as sa

from app.jobs.idempotency import key_table

metadata = sa.MetaData()

DATABASE_NOW = sa.cast(sa.extract("epoch", sa.func.clock_timestamp()), sa.Double)
"""The time by the clock of a database that several services share."""

jobs = sa.Table(
    "jobs",
    metadata,
    sa.Column(
        "number", sa.BigInteger().with_variant(sa.Integer, "sqlite"), primary_key=True, autoincrement=True
    ),
    sa.Column("id", sa.String(32), nullable=False, unique=True),
    sa.Column("kind", sa.String(64), nullable=False),
    sa.Column("lane", sa.String(16), nullable=False),
    sa.Column("status", sa.String(16), nullable=False),
    sa.Column("error", sa.JSON(none_as_null=True)),
    sa.Column("progress", sa.JSON, nullable=False),
    sa.Column("attempt", sa.Integer, nullable=False),
    # Attempts that ended because the worker or its owner died. A clean stop of the service is not one.
    sa.Column("losses", sa.Integer, nullable=False),
    sa.Column("owner", sa.String(255)),
    sa.Column("cancel_requested", sa.Boolean, nullable=False),
    sa.Column("deadline", sa.Double),
    sa.Column("created_at", sa.Double, nullable=False),
    sa.Column("started_at", sa.Double),
    sa.Column("finished_at", sa.Double),
    # Of a result that is to be completed after the job's end, the tries in vain; null for all others.
    sa.Column("unfinished", sa.Integer),
    # The id of the request that it came with, and of the API key of that request.
    sa.Column("request_id", sa.String(128)),
    sa.Column("key_id", sa.String(64)),
    # What may be large comes last, so that the rest of a row is read without it: the best plan so far, what
    # the work gets and what it returned.
    sa.Column("assignment", sa.JSON(none_as_null=True)),
    sa.Column("payload", sa.JSON, nullable=False),
    sa.Column("result", sa.JSON(none_as_null=True)),
    sa.Index("ix_jobs_finished_at", "finished_at"),
    sa.Index("ix_jobs_status_number", "status", "number"),
    sa.Index("ix_jobs_status_lane_number", "status", "lane", "number"),
    sa.Index(
        "ix_jobs_unfinished",
        "unfinished",
        "number",
        sqlite_where=sa.text("unfinished IS NOT NULL"),
        postgresql_where=sa.text("unfinished IS NOT NULL"),
    ),
    sqlite_autoincrement=True,
)

artifacts = sa.Table(
    "job_artifacts",
    metadata,
    sa.Column("job_id", sa.String(32), sa.ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("data", sa.LargeBinary, nullable=False),
)

idempotency_keys = key_table(metadata, "job_idempotency_keys", "job_id", "jobs.id")

# Where several services share a database: when each gave its last sign of life, by the database's clock.
owners = sa.Table(
    "job_owners",
    metadata,
    sa.Column("owner", sa.String(255), primary_key=True),
    sa.Column("seen_at", sa.Double, nullable=False),
)
