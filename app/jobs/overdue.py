"""Jobs that wait while their time limit runs out: when they have to be answered without a free worker.

What answers them does one after the other, so it has to begin early enough for the last of those that end
together. How long one takes is measured with each.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from statistics import median_high
from typing import NamedTuple

from app.jobs.clock import Loop

_REMEMBERED = 16
_UNMEASURED_S = 0.02
"""What an answer of the least effort is expected to take before one was measured."""

_CAUTION = 1.5
_LEAD_S = 0.03
"""Out of the queue, and from the disk to the client: what every group takes once."""

_LARGEST_GROUP, _LONGEST_GROUP_S = 16, 0.25
"""Jobs that are taken out of the queue at once, and how long they may take together."""

_LONGEST_LOOK_S = 60.0


class Wait(NamedTuple):
    """A job that waits.

    Attributes
    ----------
    deadline
        When its time is up.
    effort
        How much there is to do for its answer, in the least that there can be.
    """

    deadline: float
    effort: float = 1.0


class Pace:
    """Expects of an answer the median of what the last ones of its effort took, or in proportion of others.

    One that took long by accident changes nothing.
    """

    def __init__(self) -> None:
        self._last: dict[int, deque[float]] = {}

    def took(self, effort: float, seconds: float) -> None:
        """Note how long an answer took."""
        last = self._last.setdefault(_class_of(effort), deque(maxlen=_REMEMBERED))
        last.append(seconds / max(1.0, effort))

    def expected(self, effort: float) -> float:
        """Return the seconds that an answer takes."""
        last = self._last.get(_class_of(effort)) or [each for some in self._last.values() for each in some]
        return max(1.0, effort) * (median_high(last) if last else _UNMEASURED_S)


def _class_of(effort: float) -> int:
    return int(math.log2(max(1.0, effort)))


class OverdueJobs:
    """Watches over jobs that wait.

    Parameters
    ----------
    answer
        Answers those jobs, of some, that still wait, and returns how many seconds each took.
    now
        The clock that deadlines are by.
    ready
        Says whether there is what answers them: one that is taken before could be out of its grace by then.

    Attributes
    ----------
    loop
        Does it; to be woken when ``ready`` may have changed.
    """

    def __init__(
        self,
        answer: Callable[[Sequence[str]], Awaitable[Mapping[str, float]]],
        now: Callable[[], float] = time.time,
        ready: Callable[[], bool] = lambda: True,
    ) -> None:
        self._answer, self._now, self._ready = answer, now, ready
        self._waits: dict[str, Wait] = {}
        self._pace = Pace()
        self._answering = False
        self.loop = Loop(self._answer_due, "jobs whose time is up could not be answered")

    @property
    def busy(self) -> bool:
        """Whether a job is being answered, or watched."""
        return self._answering or bool(self._waits)

    def watch(self, job_id: str, deadline: float, effort: float = 1.0) -> None:
        """Take note of a job that waits, when its time is up, and how much there is to do for it."""
        self._waits[job_id] = Wait(deadline, effort)
        self.loop.wake()

    def watch_only(self, deadlines: Mapping[str, float]) -> None:
        """Take note of all the jobs that wait, by their id, and of no others."""
        known = self._waits
        self._waits = {
            job_id: known.get(job_id, Wait(deadline))._replace(deadline=deadline)
            for job_id, deadline in deadlines.items()
        }
        self.loop.wake()

    def forget(self, job_id: str) -> None:
        """Take note that a job waits no more."""
        self._waits.pop(job_id, None)

    async def _answer_due(self) -> float | None:
        """Answer the jobs whose time has come; return how long there is nothing to do."""
        while self._waits and self._ready() and not self.loop.ended:
            now = self._now()
            in_s = latest_start(self._waits.values(), self._pace) - now
            if in_s > 0:
                return min(in_s, _LONGEST_LOOK_S)
            group = {job_id: self._waits.pop(job_id) for job_id in due(self._waits, self._pace, now)}
            self._answering = True
            try:
                for job_id, seconds in (await self._answer(tuple(group))).items():
                    self._pace.took(group[job_id].effort, seconds)
            except Exception:
                self._waits = {**group, **self._waits}
                raise
            finally:
                self._answering = False
        return None


def latest_start(waits: Iterable[Wait], pace: Pace) -> float:
    """Return when to begin with the first, so that each is done in time.

    Parameters
    ----------
    waits
        Those that wait, at least one.
    pace
        How long each takes; it is expected to take half as long again.
    """
    latest, all_s = math.inf, _LEAD_S
    for wait in sorted(waits):
        all_s += _CAUTION * pace.expected(wait.effort)
        latest = min(latest, wait.deadline - all_s)
    return latest


def due(waits: Mapping[str, Wait], pace: Pace, now: float) -> list[str]:
    """Return the jobs to answer now, together.

    That is the one whose time is up first, and those whose turn comes while these are being answered.

    Parameters
    ----------
    waits
        Those that wait by their id, at least one.
    pace
        As above.
    now
        The time.
    """
    order = sorted(waits, key=lambda job_id: waits[job_id])
    group, all_s = 1, _CAUTION * pace.expected(waits[order[0]].effort)
    while group < min(len(order), _LARGEST_GROUP):
        rest = [waits[job_id] for job_id in order[group:]]
        all_s += _CAUTION * pace.expected(rest[0].effort)
        if all_s > _LONGEST_GROUP_S or latest_start(rest, pace) > now + all_s:
            break
        group += 1
    return order[:group]
