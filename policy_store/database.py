"""A database with one writer and many readers, and its migrations.

A use case is one transaction: ``with database.write() as connection`` commits at its end, or rolls back if
an exception leaves it. What must be atomic together is done over one connection.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from alembic.util import CommandError
from sqlalchemy import Connection, Engine, make_url
from sqlalchemy.exc import ArgumentError

from policy_store.errors import MigrationFailed, NestedWrite, UnsupportedDatabase
from policy_store.sqlite import broken_references, open_sqlite


class _WriterLock:
    """Lets one thread of the process write at a time; a second write of the same thread is a mistake."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._lock = threading.Lock()
        self._owner: int | None = None

    @contextmanager
    def hold(self) -> Iterator[None]:
        me = threading.get_ident()
        if self._owner == me:
            raise NestedWrite(self._name)
        with self._lock:
            self._owner = me
            try:
                yield
            finally:
                self._owner = None


_registry_lock = threading.Lock()
_writer_locks: dict[str, _WriterLock] = {}
# Alembic hands its environment over in module globals. Two threads that migrate different databases would run
# statements on each other's connection, which ends in a segmentation fault.
_migration_lock = threading.Lock()


def _writer_lock(name: str) -> _WriterLock:
    """Return the lock of a database: one in the process, however many ``Database`` objects share it."""
    with _registry_lock:
        return _writer_locks.setdefault(name, _WriterLock(name))


class Database:
    """A database, opened by URL; tables are made by :meth:`migrate`.

    Parameters
    ----------
    url
        ``sqlite:///relative/path`` or ``sqlite:////absolute/path``. A missing folder is made.
    write_json, read_json
        How columns of JSON are written and read; default: as the standard library does it.

    Attributes
    ----------
    url
        The URL as given.
    write_engine, read_engine
        The engines behind :meth:`write` and :meth:`read`. Writing past :meth:`write` would go round the
        lock that makes writers take turns.

    Raises
    ------
    UnsupportedDatabase
        If the URL is none, or names a database that is not SQLite in a file.
    """

    def __init__(
        self,
        url: str,
        write_json: Callable[[Any], str] | None = None,
        read_json: Callable[[str], Any] | None = None,
    ) -> None:
        try:
            parsed = make_url(url)
        except ArgumentError as error:
            raise UnsupportedDatabase(url, "it is not a database URL") from error
        if parsed.drivername not in ("sqlite", "sqlite+pysqlite"):
            raise UnsupportedDatabase(str(parsed), f"{parsed.drivername} is not supported, only sqlite")
        engines = open_sqlite(parsed, write_json, read_json)
        self.url = url
        self.write_engine: Engine = engines.write
        self.read_engine: Engine = engines.read
        self._migration_engine = engines.migrate
        self._writer = _writer_lock(engines.lock_name)

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """Open the write transaction; it has the write lock from its first statement on.

        Other threads of the process wait without a limit, other processes 10 seconds.

        Raises
        ------
        NestedWrite
            If this thread is inside a write transaction of this database already.
        sqlalchemy.exc.OperationalError
            If another process keeps the write lock for longer than 10 seconds.
        """
        with self._writer.hold(), self.write_engine.begin() as connection:
            yield connection

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Open a read transaction: one unchanging state, that of its first query. Writing in it fails."""
        with self.read_engine.connect() as connection:
            yield connection

    def size(self) -> int:
        """Return how many bytes the database has, without what is not yet moved from its log."""
        with self.read() as connection:
            pages = connection.exec_driver_sql("PRAGMA page_count").scalar_one()
            page_bytes = connection.exec_driver_sql("PRAGMA page_size").scalar_one()
        return int(pages * page_bytes)

    def migrate(self, script_location: Path, version_table: str) -> None:
        """Bring tables to the newest version of an Alembic folder, all of it or nothing.

        Safe when several processes start at once: one migrates, the others wait up to 60 seconds and
        find nothing left to do.

        Parameters
        ----------
        script_location
            Folder with ``env.py`` and ``versions/``. ``env.py`` finds ``connection`` and ``version_table``
            in ``context.config.attributes``; the transaction is begun before and committed after it.
        version_table
            Table that records the version; each folder has its own.

        Raises
        ------
        MigrationFailed
            If the folder does not know the version that is recorded (the database is newer than the
            program), or rows would refer to nothing afterwards.
        """
        config = Config()
        config.set_main_option("script_location", str(script_location).replace("%", "%%"))
        with _migration_lock, self._writer.hold(), self._migration_engine.begin() as connection:
            config.attributes["connection"] = connection
            config.attributes["version_table"] = version_table
            try:
                command.upgrade(config, "head")
            except CommandError as error:
                raise MigrationFailed(str(script_location), str(error)) from error
            if broken := broken_references(connection):
                raise MigrationFailed(str(script_location), "; ".join(broken[:5]))

    def dispose(self) -> None:
        """Close every connection that is not in use; the object can still be used afterwards."""
        self.read_engine.dispose()
        self.write_engine.dispose()
