"""A backup is one moment of a database in use, whole and sound, or it is not there."""

import sqlite3
import threading
from pathlib import Path

import pytest

from policy_store import backup
from policy_store.backup import back_up
from policy_store.database import Database
from policy_store.errors import BackupFailed


@pytest.fixture
def database(tmp_path):
    database = Database(f"sqlite:///{tmp_path / 'a%20b?c.db'}")
    with database.write() as connection:
        connection.exec_driver_sql("CREATE TABLE pairs (a INTEGER, b INTEGER)")
        connection.exec_driver_sql("CREATE TABLE padding (data BLOB)")
    yield database
    database.dispose()


def file_of(database):
    return Path(database.write_engine.url.database)


def test_a_backup_under_writes_is_one_moment(database, tmp_path):
    stop, written = threading.Event(), threading.Event()

    def write():
        number = 0
        while not stop.is_set():
            number += 1
            with database.write() as connection:
                connection.exec_driver_sql("INSERT INTO pairs VALUES (?, 0)", (number,))
                connection.exec_driver_sql("INSERT INTO padding VALUES (zeroblob(50000))")
                connection.exec_driver_sql("UPDATE pairs SET b = ?", (number,))
            if number == 10:
                written.set()

    writer = threading.Thread(target=write)
    writer.start()
    try:
        assert written.wait(30)
        sizes = [back_up(file_of(database), tmp_path / f"copy-{n}") for n in range(3)]
    finally:
        stop.set()
        writer.join()

    assert sizes == sorted(sizes)
    for n, size in enumerate(sizes):
        copy = tmp_path / f"copy-{n}"
        assert copy.stat().st_size == size
        assert copy.stat().st_mode & 0o077 == 0
        connection = sqlite3.connect(copy)
        pairs = connection.execute("SELECT a, b FROM pairs ORDER BY a").fetchall()
        assert len(pairs) >= 10
        assert pairs == [(a, len(pairs)) for a in range(1, len(pairs) + 1)]
        assert connection.execute("SELECT count(*) FROM padding").fetchone() == (len(pairs),)
        connection.close()
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".copy")]


def test_what_is_there_is_not_replaced(database, tmp_path):
    (tmp_path / "copy").write_text("precious")
    with pytest.raises(BackupFailed, match="exists already"):
        back_up(file_of(database), tmp_path / "copy")
    assert (tmp_path / "copy").read_text() == "precious"


@pytest.mark.parametrize("content", [None, b"not a database, but long enough to have a header " * 30])
def test_no_database_no_backup(tmp_path, content):
    source = tmp_path / "source"
    if content is not None:
        source.write_bytes(content)
    with pytest.raises(BackupFailed, match="source"):
        back_up(source, tmp_path / "copy")
    assert {path.name for path in tmp_path.iterdir()} == ({"source"} if content else set())


def test_a_damaged_database_is_not_passed_on_as_a_backup(database, tmp_path):
    with database.write() as connection:
        connection.exec_driver_sql("CREATE INDEX by_a ON pairs (a)")
        for number in range(2000):
            connection.exec_driver_sql("INSERT INTO pairs VALUES (?, 0)", (number,))
    database.dispose()
    source = file_of(database)
    data = bytearray(source.read_bytes())
    data[3 * 4096 + 100 : 5 * 4096] = bytes(2 * 4096 - 100)
    source.write_bytes(data)

    with pytest.raises(BackupFailed):
        back_up(source, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()


def test_a_full_disk_leaves_nothing_behind(database, tmp_path, monkeypatch):
    def copy(source, target):
        # As SQLite does, whose journal stays where there was no room to finish.
        target.with_name(target.name + "-journal").write_bytes(b"half")
        raise sqlite3.OperationalError("database or disk is full")

    before = set(tmp_path.iterdir())
    monkeypatch.setattr(backup, "_copy", copy)
    with pytest.raises(BackupFailed, match="full"):
        back_up(file_of(database), tmp_path / "copy")
    assert set(tmp_path.iterdir()) == before


def test_a_folder_that_is_missing_is_named(database, tmp_path):
    with pytest.raises(BackupFailed, match="nowhere"):
        back_up(file_of(database), tmp_path / "nowhere" / "copy")
