"""How SQLite is opened: the one place that knows its dialect.

What the settings are for:

- ``isolation_level=None`` and an explicit BEGIN. The driver's own transactions begin at the first write, so
  a read before it sees a state that another writer may change: updates are lost without an error.
  BEGIN IMMEDIATE takes the write lock first.
- WAL lets readers go on while one writes; synchronous=FULL makes a commit survive a power failure.
- One writing connection in the process, behind a lock: SQLite before 3.51.3 can damage its WAL when two
  connections write or checkpoint at the same moment, and a lock in the process is fairer than polling.
"""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sqlalchemy import URL, Connection, Engine, create_engine, event
from sqlalchemy.pool import NullPool, QueuePool

from policy_store.engines import Engines
from policy_store.errors import DatabaseUnusable, UnsupportedDatabase
from policy_store.occupation import Occupation

_BUSY_TIMEOUT_S = 10.0
_MIGRATION_BUSY_TIMEOUT_S = 60.0
_WAL_RETRY_S = 0.02
_PRIMARY_CODE = 0xFF
_BUSY = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)


def open_sqlite(
    url: URL, write_json: Callable[[Any], str] | None, read_json: Callable[[str], Any] | None
) -> Engines:
    """Make the engines of an SQLite file; it and its folder are made where they are missing, for their owner.

    Parameters
    ----------
    url
        Of the file.
    write_json, read_json
        For columns of JSON; None: as the standard library does it.

    Raises
    ------
    UnsupportedDatabase
        If the URL names no file: a database in memory would be another one for every connection.
    DatabaseUnusable
        If the file or its folder cannot be made, or cannot be written.
    """
    name = url.database
    if not name or name == ":memory:" or name.startswith("file:"):
        raise UnsupportedDatabase(str(url), "SQLite needs the path of a file")
    path = Path(name).resolve()
    _make(path)
    resolved = url.set(database=str(path))
    json: dict[str, Any] = {"json_serializer": write_json, "json_deserializer": read_json}
    return Engines(
        write=_engine(resolved, "BEGIN IMMEDIATE", poolclass=QueuePool, pool_size=1, max_overflow=0, **json),
        read=_engine(
            resolved, "BEGIN", query_only=True, poolclass=QueuePool, pool_size=8, max_overflow=32, **json
        ),
        # Alembic rebuilds a table to change it; with foreign keys on, dropping the old one would delete the
        # rows that refer to it. The pragma cannot be changed inside a transaction, hence an own engine.
        migrate=_engine(
            resolved,
            "BEGIN IMMEDIATE",
            foreign_keys=False,
            busy_timeout_s=_MIGRATION_BUSY_TIMEOUT_S,
            poolclass=NullPool,
        ),
        lock_name=str(path),
        occupation=Occupation(path),
    )


def _make(path: Path) -> None:
    """Make a file and its folder that only their owner can read, where they are missing.

    A file that is there is never opened: to close it again would take away the locks that this process's
    connections have on it (https://sqlite.org/howtocorrupt.html, 2.2), and other processes would go on as if
    there were none.
    """
    try:
        path.parent.mkdir(parents=True, mode=0o700, exist_ok=True)
        # SQLite gives its log beside the file the same rights.
        os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600))
    except FileExistsError:
        if not path.is_file() or not os.access(path, os.R_OK | os.W_OK):
            raise DatabaseUnusable(str(path), "it is no file that can be read and written") from None
    except OSError as error:
        raise DatabaseUnusable(str(path), str(error)) from error
    if not os.access(path.parent, os.W_OK):
        raise DatabaseUnusable(str(path), f"its log beside it cannot be, {path.parent} is read-only")


def size(connection: Connection) -> int:
    """Return how many bytes the database has, without what is not yet moved from its log."""
    pages = connection.exec_driver_sql("PRAGMA page_count").scalar_one()
    page_bytes = connection.exec_driver_sql("PRAGMA page_size").scalar_one()
    return int(pages * page_bytes)


def broken_references(connection: Connection) -> list[str]:
    """List the rows that refer to nothing, which SQLite does not notice while foreign keys are off."""
    rows = connection.exec_driver_sql("PRAGMA foreign_key_check")
    return [f"row {row[1]} of {row[0]} refers to a missing row of {row[2]}" for row in rows]


def _engine(
    url: URL,
    begin: str,
    *,
    foreign_keys: bool = True,
    query_only: bool = False,
    busy_timeout_s: float = _BUSY_TIMEOUT_S,
    **options: Any,
) -> Engine:
    engine = create_engine(url, connect_args={"timeout": busy_timeout_s}, **options)

    @event.listens_for(engine, "connect")
    def set_up(connection: sqlite3.Connection, _record: object) -> None:
        connection.isolation_level = None
        connection.execute(f"PRAGMA busy_timeout = {round(busy_timeout_s * 1000)}")
        connection.execute(f"PRAGMA foreign_keys = {'ON' if foreign_keys else 'OFF'}")
        if query_only:
            connection.execute("PRAGMA query_only = ON")
        else:
            _use_wal(connection, busy_timeout_s)
            connection.execute("PRAGMA synchronous = FULL")

    @event.listens_for(engine, "begin")
    def begin_explicitly(connection: Connection) -> None:
        connection.exec_driver_sql(begin)

    return engine


def _use_wal(connection: sqlite3.Connection, timeout_s: float) -> None:
    """Switch the file to WAL, once in its life; SQLite does not wait for other connections here."""
    deadline = time.monotonic() + timeout_s
    while True:
        try:
            connection.execute("PRAGMA journal_mode = WAL")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & _PRIMARY_CODE not in _BUSY or time.monotonic() > deadline:
                raise
            time.sleep(_WAL_RETRY_S)
        else:
            return
