"""Who runs a job, so that it can be told later whether that process still lives.

An owner is ``host:pid:start:token``. A process id alone is not enough, it is given out again: the start time
tells two processes apart, and the token tells this service from an earlier one of the same process.
"""

from __future__ import annotations

import os
import platform
import uuid
from pathlib import Path


def new_owner() -> str:
    """Return an owner for a service that starts in this process."""
    pid = os.getpid()
    return f"{platform.node()}:{pid}:{_start_of(pid) or ''}:{uuid.uuid4().hex[:12]}"


def is_alive(owner: str, mine: str) -> bool:
    """Say whether an owner can still finish its jobs.

    One service at a time works on a database, so an owner on another host is one that was replaced (a
    container that was started anew): it counts as dead. If it lives on after all, nothing is finished twice,
    because its attempts are outdated from then on.

    Parameters
    ----------
    owner
        As recorded with a job.
    mine
        The owner that asks.
    """
    if owner == mine:
        return True
    host, pid, start, _token = owner.rsplit(":", 3)
    my_host, my_pid, _my_start, _my_token = mine.rsplit(":", 3)
    if host != my_host or pid == my_pid:
        return False
    if start:
        return _start_of(int(pid)) == start
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _start_of(pid: int) -> str | None:
    """Return when a process started, in ticks since boot; None if it is gone or there is no /proc."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return None
    # The second field is the name in parentheses, which may hold anything; state is the third field.
    fields = stat.rpartition(")")[2].split()
    return None if fields[0] in "ZX" else fields[19]
