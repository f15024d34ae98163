"""The one thread that writes to the job table."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar

from sqlalchemy.exc import InterfaceError, OperationalError

_ATTEMPTS, _FIRST_PAUSE_S, _LONGEST_PAUSE_S = 8, 0.1, 5.0

_log = logging.getLogger(__name__)
P = ParamSpec("P")
T = TypeVar("T")


class Writer:
    """Runs functions of the store, one after the other.

    What the event loop learns of the table by it comes in the order of the commits.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="jobs-write")

    async def write(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run a function and return what it returns."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._thread, lambda: function(*args, **kwargs))

    async def write_surely(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Write what must not be lost: a database that is locked, full or away is tried again for a while."""
        pause = _FIRST_PAUSE_S
        for _ in range(_ATTEMPTS - 1):
            try:
                return await self.write(function, *args, **kwargs)
            except (OperationalError, InterfaceError):
                _log.exception("the database could not be written; next try in %.1f s", pause)
                await asyncio.sleep(pause)
                pause = min(2 * pause, _LONGEST_PAUSE_S)
        return await self.write(function, *args, **kwargs)

    async def close(self) -> None:
        """Wait for what is being written, and end the thread."""
        await asyncio.to_thread(self._thread.shutdown)
