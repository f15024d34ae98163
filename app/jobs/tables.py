"""The tables of the jobs room, as the newest migration leaves them, and what it needs of a database.

Times are seconds since 1970 UTC: they are compared and subtracted, and the sort is the same in every
database. ``jobs.number`` counts submissions: it is the order of the queue and of the pages.

What came with an idempotency key comes once. A key is kept in the transaction that makes what it stands for,
and goes with it; :func:`key_table` makes tables of keys of whatever they began.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Protocol

import sqlalchemy as sa
from sqlalchemy import Connection

from app.jobs.errors import IdempotencyMismatch
from app.jobs.model import Idempotency


class Announcements(Protocol):
    """Short messages between the services that share a database; one may get lost."""

    def tell(self, message: str) -> None:
        """Send a message soon; never blocks."""

    def close(self) -> None:
        """End; what was told is sent if that is possible."""


class Database(Protocol):
    """What the jobs room needs of a database."""

    shared: bool
    """Whether several services may work on it; otherwise transactions that write take turns."""

    def occupy(self) -> None:
        """Keep other services off, where it is not shared."""

    def vacate(self) -> None:
        """Let another service have it."""

    def write(self) -> AbstractContextManager[Connection]:
        """Open a write transaction, committed at its end and rolled back by an exception."""

    def read(self) -> AbstractContextManager[Connection]:
        """Open a read transaction."""

    def migrate(self, folder: Path, version_table: str) -> None:
        """Bring tables to the newest version of a folder of Alembic migrations."""

    def take_turn(self, connection: Connection, name: str) -> None:
        """Let the transactions that call this with one name follow one another."""

    def announcements(self, channel: str, heard: Callable[[str | None], None]) -> Announcements:
        """Open a channel; ``heard`` is called in a thread, with None if messages may have been lost."""


def key_table(metadata: sa.MetaData, name: str, of: str, ids: str) -> sa.Table:
    """Return a table of keys.

    Parameters
    ----------
    metadata
        Where it belongs.
    name
        Of the table.
    of
        Of the column with the id of what a key stands for.
    ids
        The column that it refers to, as ``table.column``.
    """
    return sa.Table(
        name,
        metadata,
        sa.Column("client", sa.String(255), primary_key=True),
        sa.Column("key", sa.String(255), primary_key=True),
        sa.Column("body_hash", sa.String(128), nullable=False),
        sa.Column(of, sa.String(32), sa.ForeignKey(ids, ondelete="CASCADE"), nullable=False, index=True),
    )


def known_by(connection: Connection, keys: sa.Table, idempotency: Idempotency) -> str | None:
    """Return the id of what came with the same key before; None if nothing did.

    Parameters
    ----------
    connection
        Of a transaction.
    keys
        A table of :func:`key_table`.
    idempotency
        The key.

    Raises
    ------
    IdempotencyMismatch
        If the key came with another body.
    """
    same = keys.c.client == idempotency.client, keys.c.key == idempotency.key
    found = connection.execute(sa.select(keys).where(*same)).one_or_none()
    if found is None:
        return None
    _, _, body_hash, begun = found
    if body_hash != idempotency.body_hash:
        raise IdempotencyMismatch(idempotency.key, f"{_of(keys).removesuffix('_id')} {begun!r}")
    return str(begun)


def claim_key(
    database: Database, connection: Connection, keys: sa.Table, idempotency: Idempotency
) -> str | None:
    """Return the same in a transaction that writes; until its end no other one claims the key.

    Parameters
    ----------
    database
        Whose transaction it is.
    connection, keys, idempotency
        As of :func:`known_by`.

    Raises
    ------
    IdempotencyMismatch
        As :func:`known_by` does.
    """
    database.take_turn(connection, f"key {idempotency.client} {idempotency.key}")
    return known_by(connection, keys, idempotency)


def keep(connection: Connection, keys: sa.Table, idempotency: Idempotency, begun: str) -> None:
    """Keep a key with the id of what it stands for, in the transaction that makes that."""
    connection.execute(sa.insert(keys).values({**asdict(idempotency), _of(keys): begun}))


def _of(keys: sa.Table) -> str:
    *_, of = keys.columns
    return of.name


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
