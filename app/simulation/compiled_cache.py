"""Numba's files of compiled code, written by one process at a time.

Numba reads a function's index, adds an entry and writes it back: of two processes that do so at once, one
loses its entry, or both give their code the same name. Workers that start together do.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
from functools import wraps
from pathlib import Path
from typing import Any

from numba.core import caching

_LOCK = Path(tempfile.gettempdir()) / f"uav-allocator-compiling-{os.getuid()}.lock"


def write_in_turns() -> None:
    """Make this process wait, whenever it keeps compiled code, while another of the same user does so."""
    save = caching.IndexDataCacheFile.save
    if hasattr(save, "__wrapped__"):
        return

    @wraps(save)
    def in_turn(self: caching.IndexDataCacheFile, key: Any, data: Any) -> None:
        # The lock of a process that is killed is free at once.
        with _LOCK.open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            save(self, key, data)  # type: ignore[no-untyped-call]  # untyped in numba

    caching.IndexDataCacheFile.save = in_turn  # type: ignore[method-assign]  # numba has no hook for it
