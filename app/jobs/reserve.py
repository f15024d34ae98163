"""The process beside the workers: it answers jobs whose time is up, and completes results afterwards.

It answers one after the other, so it has to begin early enough for the last of those that end together. How
long one takes is measured with each. What an answer had no time to complete is completed while nobody waits.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections import deque
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from statistics import median_high
from typing import Any, NamedTuple

from app.jobs.attempts import Writer
from app.jobs.clock import Loop
from app.jobs.executor import Execution, Executor, Lost, Raised, Returned
from app.jobs.model import Job
from app.jobs.store import JobStore

_REMEMBERED = 16
_UNMEASURED_S = 0.02
"""What an answer of the least effort is expected to take before one was measured."""

_CAUTION = 1.5
_LEAD_S = 0.03
"""Out of the queue, and from the disk to the client: what every group takes once."""

_LARGEST_GROUP, _LONGEST_GROUP_S = 16, 0.25
"""Jobs that are taken out of the queue at once, and how long they may take together."""

_LONGEST_LOOK_S = 60.0
_LOOK_INTERVAL_S = 15.0
_PAUSE_S = 0.1

_log = logging.getLogger(__name__)


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


class Reserve:
    """Has what workers have no time for done in a process of its own.

    Parameters
    ----------
    store, writer
        The job table, and what writes to it.
    executor
        The process; None: jobs whose time is up wait on, and results stay as they are.
    answer
        Answers those of some jobs that still wait, and returns how many seconds each took.
    has_spare
        Says whether no worker needs the core of that process now.

    Attributes
    ----------
    answering, completing
        Do it; to be woken when a job waits, and when there is a result to complete.
    """

    def __init__(
        self,
        store: JobStore,
        writer: Writer,
        executor: Executor | None,
        answer: Callable[[Sequence[str]], Awaitable[Mapping[str, float]]],
        has_spare: Callable[[], bool],
    ) -> None:
        self._store, self._writer, self._executor = store, writer, executor
        self._answer, self._has_spare = answer, has_spare
        self._kinds = [kind.name for kind in store.kinds.values() if kind.at_once is not None]
        self._efforts: dict[str, float] = {}
        self._pace = Pace()
        # Held while jobs are being answered.
        self._answers = asyncio.Lock()
        self._execution: Execution | None = None
        self.answering = Loop(self._answer_due, "jobs whose time is up could not be answered")
        self.completing = Loop(self._complete_next, "a result could not be completed")

    async def start(self) -> None:
        """Start the process."""
        if self._executor is not None:
            await self._executor.start(self.answering.wake)

    def end(self) -> None:
        """Begin nothing any more."""
        self.answering.end()
        self.completing.end()
        self._make_way()

    def watch(self, job: Job) -> None:
        """Take note of how much there is to do for a job that waits, should its time be up."""
        if job.kind in self._kinds and job.deadline is not None:
            self._efforts[job.id] = self._store.kinds[job.kind].effort(job.payload)
            self.answering.wake()

    async def _answer_due(self) -> float | None:
        """Answer the jobs whose time has come; return how long there is nothing to do."""
        # What is taken before something can answer it could be out of its grace by then.
        while self._executor is not None and self._executor.ready and not self.answering.ended:
            deadlines = await asyncio.to_thread(self._store.deadlines, self._kinds)
            # Of one that another process has taken in nothing is known: as if it were small.
            self._efforts = {job_id: self._efforts.get(job_id, 1.0) for job_id in deadlines}
            waits = {job_id: Wait(at, self._efforts[job_id]) for job_id, at in deadlines.items()}
            if not waits:
                return None
            now = self._store.clock.now()
            in_s = latest_start(waits.values(), self._pace) - now
            if in_s > 0:
                return min(in_s, _LONGEST_LOOK_S)
            self._make_way()
            async with self._answers:
                for job_id, seconds in (await self._answer(due(waits, self._pace, now))).items():
                    self._pace.took(waits[job_id].effort, seconds)
        return None

    def _make_way(self) -> None:
        """Stop completing a result: somebody waits for an answer. It is begun anew later."""
        if self._execution is not None:
            self._execution.cancel()

    async def _complete_next(self) -> float | None:
        """Complete a result, unless that holds up somebody; return how long there is nothing to do."""
        if self._executor is None:
            return None
        if self._answers.locked() or not (self._executor.ready and self._has_spare()):
            return _PAUSE_S
        job = await asyncio.to_thread(self._store.next_unfinished, self._store.owner)
        if job is None:
            return _LOOK_INTERVAL_S
        kind = self._store.kinds.get(job.kind)
        if kind is None or kind.follow_up is None:
            # A version that has no such work any more.
            return await self._complete(job, {})
        payload = {**job.payload, "result": job.result}
        self._execution = self._executor.submit(kind.follow_up.work, payload, labels=job.labels)
        try:
            outcome = await self._execution.outcome()
        finally:
            self._execution = None
        if isinstance(outcome, Returned):
            return 0.0 if outcome.work.unfinished else await self._complete(job, outcome.work.result)
        if self.completing.ended or (isinstance(outcome, Lost) and not outcome.begun):
            return 0.0
        reason = outcome.error["detail"] if isinstance(outcome, Raised) else outcome.reason
        _log.warning("a result is not completed: %s", reason, extra={"job_id": job.id})
        return await self._complete(job, kind.follow_up.given_up, failed=True)

    async def _complete(self, job: Job, fields: Mapping[str, Any], *, failed: bool = False) -> float:
        await self._writer.write(self._store.complete_result, job.id, job.attempt, fields, failed=failed)
        return 0.0


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
