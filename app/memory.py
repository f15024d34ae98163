"""How the C library divides a process's memory."""

from __future__ import annotations

import ctypes

_M_ARENA_MAX = -8
"""The option's number in glibc's ``malloc.h``."""

_ARENAS = 2


def limit_arenas() -> None:
    """Let all threads take memory from two arenas; to be called before the first thread is started.

    By default glibc gives threads arenas of their own, eight a core, and keeps what each has held at its
    fullest. A server whose threads take turns at reading large requests grew by 40 MB in ten minutes of load
    without holding more. A C library without arenas is left as it is.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_ARENA_MAX, _ARENAS)
