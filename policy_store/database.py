"""A database, SQLite or PostgreSQL, and its migrations.

SQLite has one writer at a time and many readers, and belongs to one service. PostgreSQL may be shared by
services on several machines, whose writers go on beside each other.

A use case is one transaction: ``with database.write() as connection`` commits at its end, or rolls back if
an exception leaves it. What must be atomic together is done over one connection.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from sqlalchemy import URL, Connection, Engine, make_url
from sqlalchemy.exc import ArgumentError

from policy_store import postgresql, sqlite
from policy_store.announcements import Announcements
from policy_store.engines import Engines
from policy_store.errors import MigrationFailed, NestedWrite, UnsupportedDatabase

_ENVIRONMENT = Path(__file__).parent / "migrations"
"""Where Alembic finds ``env.py``, whichever room's tables are migrated."""

_NEWER = (
    "{}: the database was made by a newer version of this program; start that version, or go back to an "
    "earlier backup"
)


class _Writers:
    """Finds a second write of the same thread, which is a mistake: it would wait for itself.

    Parameters
    ----------
    name
        Of the database.
    take_turns
        Whether one thread of the process writes at a time.
    """

    def __init__(self, name: str, take_turns: bool) -> None:
        self._name = name
        self._turn: AbstractContextManager[object] = threading.Lock() if take_turns else nullcontext()
        self._mine = threading.local()

    @contextmanager
    def hold(self) -> Iterator[None]:
        if getattr(self._mine, "writes", False):
            raise NestedWrite(self._name)
        with self._turn:
            self._mine.writes = True
            try:
                yield
            finally:
                self._mine.writes = False


_registry_lock = threading.Lock()
_writers: dict[str, _Writers] = {}
# Alembic hands its environment over in module globals. Two threads that migrate different databases would run
# statements on each other's connection, which ends in a segmentation fault.
_migration_lock = threading.Lock()


def _writers_of(engines: Engines) -> _Writers:
    """Return the writers of a database: one object in the process, however many ``Database`` share it."""
    with _registry_lock:
        name = engines.lock_name
        return _writers.setdefault(name, _Writers(name, take_turns=not engines.shared))


def _without_password(url: URL) -> str:
    return URL.create(
        url.drivername, url.username, None, url.host, url.port, url.database, url.query
    ).render_as_string()


class Database:
    """A database, opened by URL; tables are made by :meth:`migrate`.

    Parameters
    ----------
    url
        ``sqlite:///relative/path`` or ``sqlite:////absolute/path``; a missing folder is made. Or
        ``postgresql://user@host/database``.
    write_json, read_json
        How columns of JSON are written and read; default: as the standard library does it.

    Attributes
    ----------
    url
        The URL, without a password: what is written down may name it.
    environment
        Variables under which another process can open that URL: the password, where there is one.
    shared
        Whether other processes may write to it at the same time.
    write_engine, read_engine
        The engines behind :meth:`write` and :meth:`read`. Writing past :meth:`write` would go round the
        lock that makes writers take turns.

    Raises
    ------
    UnsupportedDatabase
        If the URL is none, names a database that is neither SQLite in a file nor PostgreSQL, or one whose
        driver is not installed.
    DatabaseUnusable
        If an SQLite file, or its folder, is missing and cannot be made, or cannot be written.
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
        if parsed.drivername in ("sqlite", "sqlite+pysqlite"):
            engines = sqlite.open_sqlite(parsed, write_json, read_json)
        elif parsed.drivername in postgresql.DRIVER_NAMES:
            engines = postgresql.open_postgresql(parsed, write_json, read_json)
        else:
            raise UnsupportedDatabase(
                str(parsed), f"{parsed.drivername} is not supported, only sqlite and postgresql"
            )
        self.url = url if parsed.password is None else _without_password(parsed)
        self.environment: Mapping[str, str] = engines.environment
        self.shared = engines.shared
        self.write_engine: Engine = engines.write
        self.read_engine: Engine = engines.read
        self._migration_engine = engines.migrate
        self._writers = _writers_of(engines)
        self._occupation = engines.occupation

    def occupy(self) -> None:
        """Keep other services off, where only one may work on the database, until :meth:`vacate`.

        The end of this process ends it too. What is no service (a backup, the command line) works beside it.

        Raises
        ------
        DatabaseOccupied
            If another service works on it.
        DatabaseUnusable
            If the file beside the database that says so cannot be written.
        """
        if self._occupation is not None:
            self._occupation.begin()

    def vacate(self) -> None:
        """Let another service work on the database; nothing happens where it was not occupied."""
        if self._occupation is not None:
            self._occupation.end()

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """Open a write transaction.

        With SQLite it has the write lock from its first statement on; other threads of the process wait
        without a limit, other processes 10 seconds. With PostgreSQL each statement sees what others have
        committed before it: what is read in order to be changed has to be locked.

        Raises
        ------
        NestedWrite
            If this thread is inside a write transaction of this database already.
        sqlalchemy.exc.OperationalError
            If another process keeps the write lock for longer than 10 seconds, or the server went away. Then
            it is not known whether the last commit was made.
        """
        with self._writers.hold(), self.write_engine.begin() as connection:
            yield connection

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Open a read transaction: one unchanging state, that of its first query. Writing in it fails."""
        with self.read_engine.connect() as connection:
            yield connection

    def size(self) -> int:
        """Return how many bytes the database has, without what is not yet moved from its log."""
        with self.read() as connection:
            return postgresql.size(connection) if self.shared else sqlite.size(connection)

    def take_turn(self, connection: Connection, name: str) -> None:
        """Let transactions that take the same turn follow one another; where all do so, nothing happens."""
        if self.shared:
            postgresql.take_turn(connection, name)

    def announcements(self, channel: str, heard: Callable[[str | None], None]) -> Announcements:
        """Open a channel of short messages between the processes that share the database."""
        return Announcements(self.write_engine.url, channel, heard)

    def migrate(self, folder: Path, version_table: str) -> None:
        """Bring tables to the newest version of a folder of Alembic migrations, all of it or nothing.

        Safe when several processes start at once: one migrates, the others wait (with SQLite up to
        60 seconds) and find nothing left to do.

        Parameters
        ----------
        folder
            Its ``versions/`` has the migrations. They are run by ``policy_store/migrations/env.py``, which
            finds ``connection`` and ``version_table`` in ``context.config.attributes``; the transaction is
            begun before and committed after it.
        version_table
            Table that records the version; each folder has its own.

        Raises
        ------
        MigrationFailed
            If the folder does not know the version that is recorded (the database is newer than the
            program), or rows would refer to nothing afterwards.
        """
        # Slow to load, and workers migrate nothing.
        from alembic import command  # noqa: PLC0415 - as above
        from alembic.config import Config  # noqa: PLC0415 - as above
        from alembic.script.revision import ResolutionError  # noqa: PLC0415 - as above
        from alembic.util import CommandError  # noqa: PLC0415 - as above

        config = Config()
        config.set_main_option("script_location", str(_ENVIRONMENT).replace("%", "%%"))
        config.set_main_option("version_locations", str(folder / "versions").replace("%", "%%"))
        # One folder, whatever characters its name has.
        config.set_main_option("path_separator", "newline")
        with _migration_lock, self._writers.hold(), self._migration_engine.begin() as connection:
            self.take_turn(connection, version_table)
            config.attributes["connection"] = connection
            config.attributes["version_table"] = version_table
            try:
                command.upgrade(config, "head")
            except CommandError as error:
                newer = isinstance(error.__cause__, ResolutionError)
                raise MigrationFailed(str(folder), _NEWER.format(error) if newer else str(error)) from error
            if not self.shared and (broken := sqlite.broken_references(connection)):
                raise MigrationFailed(str(folder), "; ".join(broken[:5]))

    def dispose(self) -> None:
        """Close every connection that is not in use; the object can still be used afterwards."""
        self.read_engine.dispose()
        self.write_engine.dispose()
