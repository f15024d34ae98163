"""The server's threads share few arenas of the C library's allocator."""

from __future__ import annotations

import platform
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

_THREADS = """
import ctypes, sys, threading
sys.path.insert(0, {root!r})
if {limited}:
    from app.memory import limit_arenas
    limit_arenas()
libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
held = threading.Barrier(9)
def hold():
    libc.malloc(1000)
    held.wait()
    held.wait()
for _ in range(8):
    threading.Thread(target=hold).start()
held.wait()
libc.malloc_stats()
held.wait()
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc has arenas")
def test_threads_share_two_arenas_where_they_would_have_one_each():
    assert _arenas(limited=False) > 2
    assert _arenas(limited=True) == 2


def _arenas(*, limited: bool) -> int:
    script = _THREADS.format(root=str(ROOT), limited=limited)
    ended = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60
    )
    return ended.stderr.count("Arena ")
