"""Who runs a job: a service, as the table names it."""

from __future__ import annotations

import os
import platform
import uuid


def new_owner() -> str:
    """Return a name for a service that starts in this process, ``host:pid:token``; no two are the same."""
    return f"{platform.node()}:{os.getpid()}:{uuid.uuid4().hex[:12]}"
