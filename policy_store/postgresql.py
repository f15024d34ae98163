"""How PostgreSQL is opened: the one place that knows its dialect.

- A write transaction is READ COMMITTED: every statement sees what was committed before it, so whoever waited
  for a row's lock, or for :func:`take_turn`, goes on with what the one before left. What is read in order to
  be changed is read with ``FOR UPDATE``.
- A read transaction is REPEATABLE READ and read-only: one unchanging state, as with SQLite.
- A connection is tried before it is given out, so the first transaction after a restart of the server does
  not fail; one that is cut in its midst does, with an OperationalError.

The driver, psycopg, is an extra: nothing imports it before a URL names PostgreSQL.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import sqlalchemy as sa
from sqlalchemy import URL, Connection, Engine, create_engine
from sqlalchemy.pool import NullPool

from policy_store.engines import Engines
from policy_store.errors import UnsupportedDatabase

if TYPE_CHECKING:
    import psycopg

DRIVER_NAMES = ("postgresql", "postgresql+psycopg")

_PASSWORD_VARIABLE = "PGPASSWORD"
_CONNECT: dict[str, Any] = {
    "connect_timeout": 10,
    "application_name": "uav-allocator",
    # A server that is gone without a word is noticed in seconds, not after the two hours of the system.
    "keepalives_idle": 5,
    "keepalives_interval": 3,
    "keepalives_count": 3,
    "tcp_user_timeout": 15_000,
}


def open_postgresql(
    url: URL, write_json: Callable[[Any], str] | None, read_json: Callable[[str], Any] | None
) -> Engines:
    """Make the engines of a PostgreSQL database; nothing is connected yet.

    Parameters
    ----------
    url
        Of the database.
    write_json, read_json
        For columns of JSON; None: as the standard library does it.

    Raises
    ------
    UnsupportedDatabase
        If the URL names no database, or psycopg is not installed.
    """
    if not url.database:
        raise UnsupportedDatabase(str(url), "PostgreSQL needs the name of a database")
    if importlib.util.find_spec("psycopg") is None:
        raise UnsupportedDatabase(str(url), "psycopg is not installed: pip install 'uav-allocator[postgres]'")
    url = url.set(drivername="postgresql+psycopg")
    json: dict[str, Any] = {"json_serializer": write_json, "json_deserializer": read_json}
    password = {} if url.password is None else {_PASSWORD_VARIABLE: str(url.password)}
    return Engines(
        write=_engine(url, pool_size=2, max_overflow=8, **json),
        read=_engine(
            url,
            pool_size=4,
            max_overflow=12,
            execution_options={"isolation_level": "REPEATABLE READ", "postgresql_readonly": True},
            **json,
        ),
        migrate=_engine(url, poolclass=NullPool),
        lock_name=str(url),
        shared=True,
        environment=password,
    )


def _engine(url: URL, **options: Any) -> Engine:
    settings = {"isolation_level": "READ COMMITTED", **options.pop("execution_options", {})}
    if "poolclass" not in options:
        options["pool_pre_ping"] = True
    return create_engine(url, connect_args=_connect_options(url), execution_options=settings, **options)


def connect(url: URL) -> psycopg.Connection:
    """Make a connection of its own, in which every statement is a transaction."""
    import psycopg  # noqa: PLC0415 - an extra

    _, options = create_engine(url, poolclass=NullPool).dialect.create_connect_args(url)
    return psycopg.connect(**{**_connect_options(url), **options}, autocommit=True)


def _connect_options(url: URL) -> dict[str, Any]:
    """Return what the URL does not say otherwise."""
    return {name: value for name, value in _CONNECT.items() if name not in url.query}


def take_turn(connection: Connection, name: str) -> None:
    """Wait until no other transaction has this turn, and keep it until the end of this one."""
    connection.execute(sa.select(sa.func.pg_advisory_xact_lock(sa.func.hashtextextended(name, 0))))


def size(connection: Connection) -> int:
    """Return how many bytes the database has."""
    return int(connection.execute(sa.text("SELECT pg_database_size(current_database())")).scalar_one())
