"""Time: a clock that passes evenly, waiting at most so long, and what is done again and again."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable

from app.store_faults import STORE_IS_AWAY, first_line

_log = logging.getLogger(__name__)


class Clock:
    """Tells the time by another clock as it was at a moment, and what passed since.

    So a job's limit and its duration do not change with that clock while it waits or runs, and what is stored
    of one job fits together. The other clock is the system's, or that of a database which several services
    share.

    Parameters
    ----------
    system
        Seconds since 1970; may be set back or forward.
    steady
        Seconds that pass.
    """

    def __init__(
        self, system: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic
    ) -> None:
        self._system, self._steady = system, steady
        self._offset = system() - steady()

    def now(self) -> float:
        """Return the seconds since 1970."""
        return self._offset + self._steady()

    def follow(self, now: float | None = None) -> None:
        """Take over a time; None: the system's, only while no job waits or runs."""
        self._offset = (self._system() if now is None else now) - self._steady()


class Loop:
    """Does a step again and again, until the end.

    Parameters
    ----------
    step
        Does all there is to do now, and returns in how many seconds it is to be called again if nothing wakes
        the loop before; None: then only.
    failure, again_s
        What is logged if the step raises, and after how many seconds it is called again.

    Attributes
    ----------
    ended
        Whether :meth:`end` was called.
    """

    def __init__(
        self, step: Callable[[], Awaitable[float | None]], failure: str, again_s: float = 0.1
    ) -> None:
        self._step, self._failure, self._again_s = step, failure, again_s
        self._woken = asyncio.Event()
        self.ended = False

    def wake(self) -> None:
        """Let the step be done soon; if it is being done, once more after that."""
        self._woken.set()

    def end(self) -> None:
        """Make :meth:`run` return after the step that it is at."""
        self.ended = True
        self.wake()

    async def run(self) -> None:
        """Do the step until the end."""
        while not self.ended:
            self._woken.clear()
            try:
                pause_s = await self._step()
            except Exception as error:
                at = None if isinstance(error, STORE_IS_AWAY) else error
                _log.error("%s; there will be another try: %s", self._failure, first_line(error), exc_info=at)
                await asyncio.sleep(self._again_s)
            else:
                await wait_for(self._woken, pause_s)


async def wait_for(event: asyncio.Event, timeout_s: float | None) -> None:
    """Wait for an event, at most so long; None: without a limit."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(timeout_s):
            await event.wait()
