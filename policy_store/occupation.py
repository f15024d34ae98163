"""A database file belongs to one service: it locks a file beside it, which the kernel unlocks at its end."""

from __future__ import annotations

import contextlib
import fcntl
import os
import platform
from pathlib import Path

from policy_store.errors import DatabaseOccupied, DatabaseUnusable

_LONGEST_HOLDER = 300


class Occupation:
    """The lock of one service on one database file.

    Parameters
    ----------
    database
        The file; the lock is on ``<file>.lock``, which stays when it is given up.
    """

    def __init__(self, database: Path) -> None:
        self._database = database
        self._handle: int | None = None

    def begin(self) -> None:
        """Take the lock.

        Raises
        ------
        DatabaseOccupied
            If another service has it, in this process too.
        DatabaseUnusable
            If the file beside the database cannot be written.
        """
        try:
            # Not inherited: what this process starts does not hold the lock after it.
            handle = os.open(f"{self._database}.lock", os.O_RDWR | os.O_CREAT, 0o600)
        except OSError as error:
            raise DatabaseUnusable(str(self._database), str(error)) from error
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(handle, _LONGEST_HOLDER, 0).decode("utf-8", "replace")
            os.close(handle)
            raise DatabaseOccupied(str(self._database), holder) from None
        except OSError as error:
            os.close(handle)
            raise DatabaseUnusable(str(self._database), f"it cannot be locked: {error}") from error
        with contextlib.suppress(OSError):  # only says who it is
            os.ftruncate(handle, 0)
            os.pwrite(handle, f"process {os.getpid()} on {platform.node()}".encode(), 0)
        self._handle = handle

    def end(self) -> None:
        """Give the lock up; nothing happens where it was not taken."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None
