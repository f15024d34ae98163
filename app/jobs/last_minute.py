"""Jobs that wait while their time limit runs out: when they have to be answered without a free worker.

What answers them does one after the other, so it has to begin early enough for the last of those that end
together. How long one takes is measured with each.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Awaitable, Callable, Mapping, Sequence
from statistics import fmean

from app.jobs.channel import rung

_REMEMBERED = 16
_UNMEASURED_S = 0.05
_CAUTION = 1.5
_LONGEST_LOOK_S = 60.0
_PAUSE_S = 0.1

_log = logging.getLogger(__name__)


class LastMinute:
    """Watches over jobs that wait.

    Parameters
    ----------
    answer
        Answers a job if it still waits, and returns how many seconds that took; None if it did not wait.
    now
        The clock that deadlines are by.
    """

    def __init__(
        self, answer: Callable[[str], Awaitable[float | None]], now: Callable[[], float] = time.time
    ) -> None:
        self._answer, self._now = answer, now
        self._deadlines: dict[str, float] = {}
        self._took: deque[float] = deque(maxlen=_REMEMBERED)
        self._changed = asyncio.Event()
        self._ended = False

    def watch(self, job_id: str, deadline: float) -> None:
        """Take note of a job that waits, and when its time is up."""
        self._deadlines[job_id] = deadline
        self._changed.set()

    def watch_only(self, deadlines: Mapping[str, float]) -> None:
        """Take note of all the jobs that wait, by their id, and of no others."""
        self._deadlines = dict(deadlines)
        self._changed.set()

    def forget(self, job_id: str) -> None:
        """Take note that a job waits no more."""
        self._deadlines.pop(job_id, None)

    def end(self) -> None:
        """Make :meth:`keep` return after what it is at."""
        self._ended = True
        self._changed.set()

    async def keep(self) -> None:
        """Answer the jobs whose time has come, until the end."""
        while not self._ended:
            self._changed.clear()
            if not self._deadlines:
                await self._changed.wait()
                continue
            in_s = latest_start(list(self._deadlines.values()), self._took) - self._now()
            if in_s > 0:
                await rung(self._changed, min(in_s, _LONGEST_LOOK_S))
                continue
            job_id = min(self._deadlines, key=self._deadlines.__getitem__)
            deadline = self._deadlines.pop(job_id)
            try:
                took_s = await self._answer(job_id)
                if took_s is not None:
                    self._took.append(took_s)
            except Exception:
                _log.exception("a job's time is up and it could not be answered; there will be another try")
                self._deadlines.setdefault(job_id, deadline)
                await asyncio.sleep(_PAUSE_S)


def latest_start(deadlines: Sequence[float], took_s: Sequence[float]) -> float:
    """Return when to begin with the first, so that each is done in time.

    Parameters
    ----------
    deadlines
        When each has to be done, at least one.
    took_s
        How long the last ones took: the first is expected to take as long as the slowest, those after it as
        long as the mean, and half as long again.
    """
    mean, longest = _CAUTION * fmean(took_s or [_UNMEASURED_S]), max(took_s, default=_UNMEASURED_S)
    return min(deadline - longest - place * mean for place, deadline in enumerate(sorted(deadlines)))
