"""Attempts at jobs: which run here, of which lanes more may, and what becomes of a job when one has ended."""

from __future__ import annotations

import asyncio
import logging
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from statistics import fmean
from typing import Any, Literal, ParamSpec, TypeVar

from app.domain.said import said
from app.jobs.errors import INTERNAL_ERROR, describe, failure
from app.jobs.events import JobEvents
from app.jobs.executor import Executor, Outcome, Raised, Returned
from app.jobs.model import BEST_KNOWN, LANES, Job, JobKind, JobStatus, JobSummary, Lane, Progress
from app.jobs.store import JobStore
from app.store_faults import STORE_IS_AWAY, first_line

REMEMBERED_DURATIONS = 50
_UNMEASURED_DURATION_S = 1.0
_LONGEST_HELD_S = 300.0
_TRIES, _FIRST_PAUSE_S, _LONGEST_PAUSE_S = 8, 0.1, 5.0

_log = logging.getLogger(__name__)
P = ParamSpec("P")
T = TypeVar("T")
J = TypeVar("J", bound=JobSummary)

Reason = Literal["time", "cancel", "stop", "gone"]
"""Why a worker was killed: its work did not end with its time, or its cancellation, or the service; or the
job is no longer this service's."""


class Attempt:
    """One attempt at a job, handed to an executor as it is made.

    Parameters
    ----------
    job
        As it was taken from the queue.
    kind, events
        Of the job.
    executor
        What runs it.
    now
        The time by the service's clock.
    grace_s
        How long the work may go on after it was asked to stop, or its time is up.
    at_once
        Whether it holds no worker, because its time is up and it is answered beside them.

    Attributes
    ----------
    job, kind, events, grace_s, at_once
        The same.
    progress
        The newest; ``unsaved`` if it is not in the table yet.
    begun_at
        When it was handed over, by the service's clock.
    killed_for
        Why its worker was killed, if it was.
    asked_to_stop
        Whether somebody cancelled it, or it took longer than its kind may.
    """

    def __init__(
        self,
        job: Job,
        kind: JobKind,
        events: JobEvents,
        executor: Executor,
        now: float,
        grace_s: float,
        at_once: bool,
    ) -> None:
        self.job, self.kind, self.events, self.progress = job, kind, events, job.progress
        self.begun_at, self.grace_s, self.at_once = now, grace_s, at_once
        self.unsaved = self.asked_to_stop = False
        self.killed_for: Reason | None = None
        self._timers: list[asyncio.TimerHandle] = []
        work = (at_once and kind.at_once) or kind.work
        payload, left_s = job.payload, self.left_s(now)
        if job.attempt > 1 and job.progress.assignment is not None:
            payload = {**payload, BEST_KNOWN: job.progress.as_json()}
        self._execution = executor.submit(
            work, payload, time_left_s=left_s, on_progress=self._report, labels=job.labels
        )
        if left_s is not None:
            self._later(max(0.0, left_s) + grace_s, self._end_overdue)
        if kind.max_run_s is not None:
            self._later(kind.max_run_s, self.stop, "time")

    async def outcome(self) -> Outcome:
        """Wait until the work has ended."""
        outcome = await self._execution.outcome()
        for timer in self._timers:
            timer.cancel()
        return outcome

    def left_s(self, now: float) -> float | None:
        """Return how much time its limit leaves it; None for no limit."""
        return None if self.job.deadline is None else self.job.deadline - now

    def stop(self, reason: Reason = "cancel") -> None:
        """Ask the work to stop by itself, and end its worker if it has not after the grace."""
        if not self.asked_to_stop:
            self.asked_to_stop = True
            self._execution.cancel()
            self._later(self.grace_s, self.kill, reason)

    def kill(self, reason: Reason) -> None:
        """End the worker, for the first reason that is given."""
        if self.killed_for is None:
            self.killed_for = reason
            self._execution.kill()

    def _report(self, progress: Progress) -> None:
        """Take note of progress, and tell it unless the job is no longer this service's."""
        self.progress, self.unsaved = progress, True
        if self.killed_for != "gone":
            self.events.report(progress)

    def _end_overdue(self, held_s: float = 0.0, was_held: bool = False) -> None:
        """End the worker, whose work did not end with its time; not while it is held, nor right after."""
        held = self._execution.is_held()
        if (held or was_held) and held_s < _LONGEST_HELD_S:
            self._later(self.grace_s, self._end_overdue, held_s + self.grace_s, held)
        else:
            self.kill("time")

    def _later(self, seconds: float, do: Callable[..., None], *arguments: Any) -> None:
        self._timers.append(asyncio.get_running_loop().call_later(seconds, do, *arguments))


class Attempts:
    """The attempts that run here, each until its end is stored, and the workers that are left for others.

    Trainings hold at most all workers but one, and so do the jobs of batches; where there is only one, they
    share it. Interactive jobs come first in both cases, then those of batches.

    A job may have two attempts: where this service was taken for dead by another and has then taken the job
    again, the earlier one counts no more, and ends while the later one works.

    Parameters
    ----------
    workers
        How many there are.

    Attributes
    ----------
    reserved
        Workers that are kept for jobs which are being taken in, by lane.
    """

    def __init__(self, workers: int) -> None:
        self._all = workers
        self._most: dict[Lane, int] = dict.fromkeys(LANES, max(1, workers - 1)) | {"interactive": workers}
        self._running: dict[tuple[str, int], Attempt] = {}
        self._durations = {lane: deque[float](maxlen=REMEMBERED_DURATIONS) for lane in LANES}
        self.reserved: Counter[Lane] = Counter()

    def __iter__(self) -> Iterator[Attempt]:
        return iter(list(self._running.values()))

    def by_lane(self) -> dict[Lane, int]:
        """Return how many workers each lane holds."""
        held = Counter(attempt.job.lane for attempt in self if not attempt.at_once)
        return {lane: held[lane] + self.reserved[lane] for lane in LANES}

    def leave_spare(self) -> bool:
        """Say whether not all workers are held."""
        return sum(self.by_lane().values()) < self._all

    def may_start(self, ready: int) -> tuple[Lane, ...]:
        """Return the lanes of which a job may start, in their order, when ``ready`` workers are warm."""
        held = self.by_lane()
        if sum(held.values()) >= ready:
            return ()
        return tuple(lane for lane in LANES if held[lane] < self._most[lane])

    def add(self, attempt: Attempt) -> None:
        """Take note of an attempt, and end an earlier one at the same job."""
        earlier = self.of(attempt.job.id)
        self._running[attempt.job.id, attempt.job.attempt] = attempt
        if earlier is not None:
            earlier.kill("gone")

    def remove(self, attempt: Attempt) -> None:
        """Take note that the end of an attempt is stored."""
        del self._running[attempt.job.id, attempt.job.attempt]

    def of(self, job_id: str) -> Attempt | None:
        """Return the newest attempt at a job; None if it does not run here."""
        attempts = [attempt for (of, _), attempt in self._running.items() if of == job_id]
        return max(attempts, key=lambda attempt: attempt.job.attempt, default=None)

    def newest(self, job: J) -> J:
        """Return a job with the progress that is known here and not yet in the table."""
        attempt = self.of(job.id) if job.status is JobStatus.RUNNING else None
        return job if attempt is None else replace(job, progress=attempt.progress)

    def times(self, now: float) -> Iterator[tuple[Lane, float, float | None]]:
        """Return of each that holds a worker its lane, how long it has run, and what its limit leaves it."""
        for each in self:
            if not each.at_once:
                yield each.job.lane, now - each.begun_at, each.left_s(now)

    def ran(self, lane: Lane, durations_s: Iterable[float]) -> None:
        """Note how long jobs of the lane took."""
        self._durations[lane].extend(durations_s)

    def time_to_a_place(self, lane: Lane, running: Iterable[tuple[Lane, float, float | None]]) -> float:
        """Return the seconds until one job of a lane in which others wait will have been started, at least 1.

        Parameters
        ----------
        lane
            The lane.
        running
            Of the jobs that run, their lane, for how long they have, and how long their time limit leaves
            them if they have one.

        Returns
        -------
        float
            What is left of the one that ends first among those for which the lane waits. Where a worker is
            free, or soon will be, the mean of the lane's last durations over the workers that it can have.
        """
        busy = tuple(running)
        own = [each for each in busy if each[0] == lane]
        rests = [self._rest(*each) for each in (own if len(own) >= self._most[lane] else busy)]
        is_free = len(own) < self._most[lane] and len(busy) < self._all
        return max(1.0, self._mean(lane) / self._most[lane] if is_free else min(rests))

    def _rest(self, lane: Lane, ran_s: float, left_s: float | None) -> float:
        """Return how long a job that runs is expected to go on."""
        mean = self._mean(lane)
        # One that has run longer than others did is expected to go on for as long again.
        rest = mean - ran_s if ran_s < mean else ran_s
        return rest if left_s is None else min(rest, max(0.0, left_s))

    def _mean(self, lane: Lane) -> float:
        return fmean(self._durations[lane]) if self._durations[lane] else _UNMEASURED_DURATION_S


class Writer:
    """The one thread that writes to the job table: it runs functions of the store, one after the other.

    What the event loop learns of the table by it comes in the order of the commits.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="jobs-write")

    async def write(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run a function and return what it returns."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._thread, lambda: function(*args, **kwargs))

    async def write_with_retry(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Write what must not be lost: a database that is locked, full or away is tried again for a while."""
        pause = _FIRST_PAUSE_S
        for _ in range(_TRIES - 1):
            try:
                return await self.write(function, *args, **kwargs)
            except STORE_IS_AWAY as error:
                told = first_line(error)
                _log.error("the database could not be written; next try in %.1f s: %s", pause, told)
                await asyncio.sleep(pause)
                pause = min(2 * pause, _LONGEST_PAUSE_S)
        return await self.write(function, *args, **kwargs)

    async def close(self) -> None:
        """Wait for what is being written, and end the thread."""
        await asyncio.to_thread(self._thread.shutdown)


async def complete(attempt: Attempt, outcome: Outcome, store: JobStore, writer: Writer) -> Job | None:
    """Bring the outcome of an attempt into the table; None if the job has gone on without this attempt."""
    job, progress, write = attempt.job, attempt.progress, writer.write_with_retry
    which = job.id, job.attempt
    if isinstance(outcome, Returned):
        try:
            return await write(store.succeed, *which, outcome.work, progress)
        except Exception as exception:
            _log.exception("a job's result could not be stored")
            outcome = Raised(describe(exception), "")
    if isinstance(outcome, Raised):
        if outcome.error["code"] == INTERNAL_ERROR:
            trace = {"worker_traceback": outcome.traceback}
            _log.error("a job failed: %s", outcome.error["detail"], extra=trace)
        return await write(store.fail, *which, outcome.error, progress)
    # What nothing has begun with waits again, and so does one whose time is up, where there is an answer for
    # those.
    waits = attempt.kind.at_once is not None and not (attempt.at_once or attempt.asked_to_stop)
    if not outcome.begun or attempt.killed_for == "stop" or (attempt.killed_for == "time" and waits):
        return await write(store.requeue, *which, progress)
    if attempt.killed_for == "time":
        detail = said(
            "the work did not stop within {seconds} s after its time was up, and was ended",
            seconds=attempt.grace_s,
        )
        return await write(store.fail, *which, failure("time-limit-exceeded", detail), progress)
    _log.warning("attempt %d of a job: %s", job.attempt, outcome.reason)
    return await write(store.mark_crashed, *which, outcome.reason, progress)
