"""Copies of the database while the service writes to it."""

from __future__ import annotations

import os
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

from policy_store.errors import BackupFailed

_BUSY_TIMEOUT_S = 30.0


def back_up(source: Path, target: Path) -> int:
    """Copy a database file as it is at one moment; it may be in use, and nobody waits for the copy.

    The copy is checked before it gets its name, so a file of that name is a whole and sound database, which
    can be used in the place of the original.

    Parameters
    ----------
    source
        Database file.
    target
        A file that does not exist yet, in a folder that does.

    Returns
    -------
    int
        Bytes of the copy.

    Raises
    ------
    BackupFailed
        If there is no such database, the target exists, the copy cannot be written, or it is not sound.
    """
    if target.exists():
        raise BackupFailed(source, f"{target} exists already")
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        os.close(handle)
    except OSError as error:
        raise BackupFailed(source, str(error)) from error
    unfinished = Path(name)
    try:
        _copy(source, unfinished)
        unfinished.rename(target)
        _sync(target.parent)
    except (sqlite3.Error, OSError) as error:
        raise BackupFailed(source, str(error)) from error
    finally:
        # SQLite's own files beside it too, which it leaves where the disk was full.
        for ending in ("", "-journal", "-wal", "-shm"):
            unfinished.with_name(unfinished.name + ending).unlink(missing_ok=True)
    return target.stat().st_size


def _copy(source: Path, target: Path) -> None:
    # Opened for writing, because a reader alone cannot use the log of a database that nobody has open; but
    # not made where it is missing.
    address = f"file:{quote(str(source.resolve()))}?mode=rw"
    with (
        closing(sqlite3.connect(address, uri=True, timeout=_BUSY_TIMEOUT_S)) as original,
        closing(sqlite3.connect(target, timeout=_BUSY_TIMEOUT_S)) as copy,
    ):
        # In one step: in steps, every write of the service would begin the copy anew.
        original.backup(copy)
        # One file, without a log beside it; the service switches back when it opens the file.
        copy.execute("PRAGMA journal_mode = DELETE")
        verdict = [row[0] for row in copy.execute("PRAGMA integrity_check(5)")]
        broken = copy.execute("PRAGMA foreign_key_check").fetchall()
    if verdict != ["ok"] or broken:
        raise BackupFailed(source, f"the copy is not sound: {'; '.join(verdict)}; {broken[:5]}")
    _sync(target)


def _sync(path: Path) -> None:
    """Bring a file, or the names in a folder, to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
