import os
import signal
import sqlite3
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import sqlalchemy as sa
from database_probes import scalar, start
from sqlalchemy import text
from sqlalchemy.exc import DatabaseError, OperationalError

from app.jobs import stored_json
from policy_store import sqlite
from policy_store.database import Database
from policy_store.errors import (
    DatabaseOccupied,
    DatabaseUnusable,
    NestedWrite,
    UnsupportedDatabase,
)


@pytest.fixture
def counter(database: Database) -> Database:
    with database.write() as connection:
        connection.execute(text("CREATE TABLE counter (value INTEGER NOT NULL)"))
        connection.execute(text("INSERT INTO counter VALUES (0)"))
    return database


def increment(database: Database, times: int) -> None:
    for _ in range(times):
        with database.write() as connection:
            value = connection.execute(text("SELECT value FROM counter")).scalar_one()
            connection.execute(text("UPDATE counter SET value = :value"), {"value": value + 1})


def test_no_update_is_lost_when_threads_read_then_write(counter: Database) -> None:
    with ThreadPoolExecutor(8) as threads:
        for done in [threads.submit(increment, counter, 25) for _ in range(8)]:
            done.result()
    assert scalar(counter, "SELECT value FROM counter") == 200


def test_no_update_is_lost_between_two_objects_and_two_processes(counter: Database, url: str) -> None:
    program = """
        import sys
        from sqlalchemy import text
        from policy_store.database import Database
        database = Database(sys.argv[1])
        print("ready", flush=True)
        sys.stdin.readline()
        for _ in range(25):
            with database.write() as connection:
                value = connection.execute(text("SELECT value FROM counter")).scalar_one()
                connection.execute(text("UPDATE counter SET value = :value"), {"value": value + 1})
    """
    other = Database(url)
    process = start(program, url)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    with ThreadPoolExecutor(3) as threads:
        process_done = threads.submit(process.communicate, "go\n", timeout=60)
        for done in [threads.submit(increment, each, 25) for each in (counter, other)]:
            done.result()
        assert process_done.result()[1] == ""
    assert scalar(counter, "SELECT value FROM counter") == 75
    other.dispose()


def test_a_write_keeps_other_processes_out_from_its_beginning(counter: Database, url: str) -> None:
    outsider = sqlite3.connect(url.removeprefix("sqlite:///"), timeout=0, isolation_level=None)
    with counter.write(), pytest.raises(sqlite3.OperationalError, match="locked"):
        outsider.execute("BEGIN IMMEDIATE")
    outsider.execute("BEGIN IMMEDIATE")
    outsider.close()


def test_an_exception_rolls_the_transaction_back(counter: Database) -> None:
    def set_and_fail() -> None:
        with counter.write() as connection:
            connection.execute(text("UPDATE counter SET value = 7"))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        set_and_fail()
    assert scalar(counter, "SELECT value FROM counter") == 0
    increment(counter, 1)
    assert scalar(counter, "SELECT value FROM counter") == 1


def test_a_reader_keeps_its_state_while_another_thread_writes(counter: Database) -> None:
    with counter.read() as connection:
        before = connection.execute(text("SELECT value FROM counter")).scalar_one()
        writer = threading.Thread(target=increment, args=(counter, 3))
        writer.start()
        writer.join()
        after = connection.execute(text("SELECT value FROM counter")).scalar_one()
    assert (before, after) == (0, 0)
    assert scalar(counter, "SELECT value FROM counter") == 3


def test_a_reader_cannot_write(counter: Database) -> None:
    with counter.read() as connection, pytest.raises(OperationalError, match="readonly"):
        connection.execute(text("UPDATE counter SET value = 1"))


def test_a_nested_write_fails_instead_of_waiting_for_itself(counter: Database, url: str) -> None:
    same_file = Database(url)
    with counter.write(), pytest.raises(NestedWrite), same_file.write():
        pass
    increment(counter, 1)
    same_file.dispose()


def test_settings_of_the_connections(database: Database) -> None:
    pragmas = ("journal_mode", "synchronous", "busy_timeout", "foreign_keys", "query_only")
    with database.write() as connection:
        writer = [connection.exec_driver_sql(f"PRAGMA {name}").scalar_one() for name in pragmas]
    with database.read() as connection:
        reader = [connection.exec_driver_sql(f"PRAGMA {name}").scalar_one() for name in pragmas]
    assert writer == ["wal", 2, 10_000, 1, 0]
    assert (reader[0], *reader[2:]) == ("wal", 10_000, 1, 1)


@pytest.mark.parametrize(
    "url", ["sqlite://", "sqlite:///:memory:", "sqlite:///file:x?uri=true", "mysql://host/name", "nonsense"]
)
def test_databases_that_cannot_be_used_are_refused(url: str) -> None:
    with pytest.raises(UnsupportedDatabase):
        Database(url)


def test_a_password_is_not_shown() -> None:
    with pytest.raises(UnsupportedDatabase) as refused:
        Database("mysql://user:secret@host/name")
    assert "secret" not in str(refused.value)


def test_a_password_is_no_part_of_what_is_written_down() -> None:
    database = Database("postgresql://user:secret@host:5433/name?sslmode=require")
    assert database.url == "postgresql://user@host:5433/name?sslmode=require"
    assert database.environment == {"PGPASSWORD": "secret"}


@pytest.mark.parametrize("ending", ["_exit", "SIGKILL"])
def test_what_was_committed_survives_a_crash_and_nothing_else(
    counter: Database, url: str, ending: str
) -> None:
    program = """
        import os, sys
        from sqlalchemy import text
        from policy_store.database import Database
        database = Database(sys.argv[1])
        with database.write() as connection:
            connection.execute(text("UPDATE counter SET value = 1"))
            connection.execute(text("CREATE TABLE padding (data BLOB)"))
        with database.write() as connection:
            connection.execute(text("UPDATE counter SET value = 2"))
            # More than SQLite's page cache holds: pages of the open transaction reach the log.
            for _ in range(40):
                connection.execute(text("INSERT INTO padding VALUES (randomblob(200000))"))
            print("inside", flush=True)
            if sys.argv[2] == "_exit":
                os._exit(1)
            sys.stdin.read()
    """
    process = start(program, url, ending)
    assert process.stdout is not None
    line = process.stdout.readline()
    if ending == "SIGKILL":
        os.kill(process.pid, signal.SIGKILL)
    assert line == "inside\n", process.communicate(timeout=60)
    process.communicate(timeout=60)
    assert process.returncode == (1 if ending == "_exit" else -signal.SIGKILL)

    assert scalar(counter, "SELECT value FROM counter") == 1
    assert scalar(counter, "SELECT count(*) FROM padding") == 0
    assert scalar(counter, "PRAGMA integrity_check") == "ok"
    increment(counter, 1)
    assert scalar(counter, "SELECT value FROM counter") == 2


def test_one_service_at_a_time_occupies_a_file_and_a_kill_frees_it(database: Database) -> None:
    program = """
        import sys
        from policy_store.database import Database

        Database(sys.argv[1]).occupy()
        print("occupied", flush=True)
        sys.stdin.read()
    """
    process = start(program, database.url)
    assert process.stdout is not None
    assert process.stdout.readline() == "occupied\n"
    with pytest.raises(DatabaseOccupied, match=rf"process {process.pid} on .*PostgreSQL"):
        database.occupy()
    # What is no service may work on it all the same.
    assert scalar(database, "SELECT 1") == 1
    process.kill()
    process.communicate()
    database.occupy()
    other = Database(database.url)
    with pytest.raises(DatabaseOccupied):
        other.occupy()
    database.vacate()
    other.occupy()
    other.vacate()
    other.dispose()


def test_a_file_and_a_folder_that_are_made_are_their_owners_alone(tmp_path: Path) -> None:
    old = tmp_path / "old.db"
    old.touch()
    old.chmod(0o640)
    before = os.umask(0)
    try:
        for path in (tmp_path / "new" / "a.db", old):
            database = Database(f"sqlite:///{path}")
            with database.write() as connection:
                connection.execute(text("CREATE TABLE a (x INTEGER)"))
            database.dispose()
    finally:
        os.umask(before)
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o700
    assert (tmp_path / "new" / "a.db").stat().st_mode & 0o777 == 0o600
    assert old.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("where", ["/proc/nowhere/a.db", "/dev/null/a.db"])
def test_a_folder_that_cannot_be_made_is_said_at_once(where: str) -> None:
    with pytest.raises(DatabaseUnusable, match=where):
        Database(f"sqlite:///{where}")


def test_a_folder_that_cannot_be_written_is_said_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # of root, no folder is
    with pytest.raises(DatabaseUnusable, match="read-only"):
        Database(f"sqlite:///{tmp_path / 'a.db'}")


def test_only_who_is_kept_waiting_tries_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a file that is no database, and one on a medium that is read-only, nothing becomes by waiting."""
    (tmp_path / "a.db").write_bytes(b"no database, but long enough to have a header " * 30)
    slept = []
    monkeypatch.setattr(sqlite.time, "sleep", slept.append)
    database = Database(f"sqlite:///{tmp_path / 'a.db'}")
    with pytest.raises(DatabaseError), database.write():
        pass
    read_only = sqlite3.connect(f"file:{tmp_path / 'b.db'}?mode=rwc", uri=True)
    read_only.execute("CREATE TABLE a (x INTEGER)")
    read_only.close()
    read_only = sqlite3.connect(f"file:{tmp_path / 'b.db'}?mode=ro", uri=True)
    with pytest.raises(sqlite3.OperationalError, match="readonly"):
        sqlite._use_wal(read_only, 60.0)
    read_only.close()
    assert slept == []


def test_the_store_imports_neither_the_application_nor_torch() -> None:
    program = """
        import pkgutil, importlib, sys, policy_store
        for module in pkgutil.iter_modules(policy_store.__path__, "policy_store."):
            importlib.import_module(module.name)
        print(sorted({"app", "torch", "numba", "fastapi"} & sys.modules.keys()))
    """
    assert start(program).communicate(timeout=60) == ("[]\n", "")


@pytest.mark.parametrize("value", [{"n": [1, 2.5, None, True], "s": "ä€😀"}, "\ud800", {"z": "\x00"}, None])
def test_json_is_written_and_read_as_the_opener_says(any_database_url: str, value: object) -> None:
    calls = []

    def write(value: object) -> str:
        calls.append("write")
        return stored_json.write(value)

    def read(text: str) -> object:
        calls.append("read")
        return stored_json.read(text)

    table = sa.Table("notes", sa.MetaData(), sa.Column("body", sa.JSON(none_as_null=False)))
    opened = [Database(any_database_url), Database(any_database_url, write, read)]
    with opened[0].write() as connection:
        table.create(connection)
    for database in opened:
        with database.write() as connection:
            connection.execute(sa.insert(table).values(body=value))
    assert calls == ["write"]
    for database in opened:
        with database.read() as connection:
            assert connection.scalars(sa.select(table.c.body)).all() == [value, value]
        database.dispose()
    assert calls == ["write", "read", "read"]


def test_another_object_of_the_file_takes_no_locks_of_the_process_away(tmp_path: Path) -> None:
    file = tmp_path / "library.db"
    database = Database(f"sqlite:///{file}")
    with database.write() as connection:
        connection.execute(text("CREATE TABLE t (a INTEGER)"))
    with database.read() as connection:
        connection.execute(text("SELECT * FROM t")).all()
        other = Database(f"sqlite:///{file}")
        program = (
            "import sqlite3, sys; c = sqlite3.connect(sys.argv[1]); c.execute('SELECT * FROM t'); c.close()"
        )
        subprocess.run([sys.executable, "-c", f"{program}; c.close()", str(file)], check=True)
        # Who closes the last connection removes the log: that process did not take itself for the last.
        assert Path(f"{file}-wal").exists()
    other.dispose()
    database.dispose()
