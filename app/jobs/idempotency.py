"""What came with an idempotency key comes once: the rule, and tables of keys of whatever they began.

A key is kept in the transaction that makes what it stands for, and goes with it.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import sqlalchemy as sa
from sqlalchemy import Connection

from app.jobs.errors import IdempotencyMismatch
from app.jobs.model import Idempotency

if TYPE_CHECKING:  # it knows the tables of jobs, which have one of these
    from app.jobs.queries import Database


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
