"""Takes jobs in, gives them to workers, brings what becomes of them into the table, and keeps that in order.

Everything here runs on one event loop; what touches the disk runs in threads. All writing to the job table
goes through one thread, so what is known here about the table changes in the order of its commits. What is
known here can be thrown away at any moment: it says when to look at the table, and the table says what is.
"""

from __future__ import annotations

import asyncio
import logging
import random
import time
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, TypeVar

from structlog.contextvars import bind_contextvars

from app.jobs.attempts import REMEMBERED_DURATIONS, Attempt, Attempts, Writer, complete
from app.jobs.clock import Loop
from app.jobs.errors import Draining
from app.jobs.events import EventStreams
from app.jobs.executor import Executor
from app.jobs.model import LANES, Job, JobObserver, JobStatus, Lane, Load
from app.jobs.peers import Peers
from app.jobs.reserve import Reserve
from app.jobs.store import JobStore

_SETTLE_S = 20.0
_SAVE_INTERVAL_S = 1.0
_LOOK_INTERVAL_S = 15.0
_EXPIRE_INTERVAL_S, _EXPIRED_AT_ONCE = 600.0, 50
_AGAIN_S = 1.0
# Those who are told when to come again do not all come at once.
_LATEST_RETURN = 1.5

_log = logging.getLogger(__name__)
T = TypeVar("T")
Insert = Callable[..., tuple[Job, bool]]
"""Inserts a job; it is told whether that may begin as running, and when one more would have a place."""


class Dispatcher:
    """Everything of the service that changes jobs.

    Parameters
    ----------
    store
        The job table.
    executor, reserve, observer, grace_s, retention_s, lease_s
        As given to :class:`app.jobs.service.JobService`.

    Attributes
    ----------
    attempts
        The attempts that run here.
    events
        Tell those who listen what happens to jobs.
    """

    def __init__(
        self,
        store: JobStore,
        executor: Executor,
        reserve: Executor | None,
        observer: JobObserver | None,
        grace_s: float,
        retention_s: float | None,
        lease_s: float,
    ) -> None:
        self._store, self._kinds, self._observer = store, store.kinds, observer
        self._executor, self._executors = executor, [executor, *([] if reserve is None else [reserve])]
        self._grace_s, self._retention_s = grace_s, retention_s
        self.attempts, self.events = Attempts(executor.capacity), EventStreams(store, self.runs)
        self._writer, self._peers = Writer(), Peers(store, lease_s)
        self._reserve = Reserve(store, self._writer, reserve, self._answer_at_once, self.attempts.leave_spare)
        # Who gets a free worker is decided for one job after the other.
        self._choosing = asyncio.Lock()
        # How often it was told that a job may wait, and for how many of these none was left. Only hints: the
        # table says what waits, and one look too many finds nothing.
        self._told, self._looked = 1, 0
        self._dispatching = Loop(self._dispatch, "no job could be taken from the queue")
        # What fails is tried again soon, and keeps no other chore from being done: without heartbeats the
        # others would take this service for dead.
        chores = self._save_progress, self._recover, self._beat, self._expire
        self._chores = [Loop(chore, "the job table could not be kept in order", _AGAIN_S) for chore in chores]
        self._loops: list[asyncio.Task[None]] = []
        self._requests: set[asyncio.Task[Any]] = set()
        self._finishing: set[asyncio.Task[Any]] = set()
        self._accepting = self._ended = False

    async def start(self) -> None:
        """Make the tables, give back what an earlier process left running, and begin to work."""
        await self._writer.write(self._store.migrate)
        await self._peers.join(self._writer, self._hear)
        await self._recover()
        for lane in LANES:
            durations = await self._writer.write(self._store.recent_durations, lane, REMEMBERED_DURATIONS)
            self.attempts.ran(lane, durations)
        self._accepting = True
        await self._executor.start(self._dispatching.wake)
        await self._reserve.start()
        loops = self._dispatching, self._reserve.answering, self._reserve.completing, *self._chores
        self._loops = [asyncio.create_task(loop.run()) for loop in loops]

    async def stop(self, grace_s: float) -> None:
        """Take nothing in any more, and put back what still runs after ``grace_s`` seconds."""
        self._accepting = False
        self._dispatching.end()
        self._reserve.end()
        # What was begun is brought to its end: a cancelled task would leave behind what its thread commits.
        for begun in (self._requests, self._loops[:1]):
            if begun:
                await asyncio.wait(begun)
        if self._finishing:
            await asyncio.wait(self._finishing, timeout=grace_s)
        for attempt in self.attempts:
            attempt.kill("stop")
        if self._finishing:
            await asyncio.wait(self._finishing, timeout=_SETTLE_S)
        self._ended = True
        for chore in self._chores:
            chore.end()
        for executor in self._executors:
            await executor.close()
        await asyncio.gather(*self._loops)
        await self._peers.leave(self._writer)
        await self._writer.close()

    async def admit(self, lane: Lane, insert: Insert) -> tuple[Job, bool]:
        """Take in a job, see :meth:`app.jobs.service.JobService.submit`."""
        if not self._accepting:
            raise Draining
        return await asyncio.shield(_spawn(self._admit(lane, insert), self._requests))

    async def _admit(self, lane: Lane, insert: Insert) -> tuple[Job, bool]:
        async with self._choosing:
            reserved = lane in self.attempts.may_start(self._executor.ready)
            self.attempts.reserved[lane] += reserved
        free_s = self.attempts.time_to_a_place(lane, self.attempts.times(self._store.clock.now()))
        retry_after_s = free_s * random.uniform(1.0, _LATEST_RETURN)
        begins = False
        try:
            job, created = await self._writer.write(insert, run_now=reserved, retry_after_s=retry_after_s)
            begins = created and job.status is JobStatus.RUNNING
        finally:
            self.attempts.reserved[lane] -= reserved
            if reserved and not begins:
                self._dispatching.wake()
        if created:
            _log.info("job taken in", extra={"job_id": job.id, "kind": job.kind, "lane": lane})
        if begins:
            self._begin(job)
        elif created:
            self._moved(job)
        return job, created

    async def cancel(self, job_id: str) -> Job:
        """Cancel a job, see :meth:`app.jobs.service.JobService.cancel`."""
        if self._ended:
            raise Draining
        return await asyncio.shield(_spawn(self._cancel(job_id), self._requests))

    async def _cancel(self, job_id: str) -> Job:
        job, before = await self._writer.write(self._store.cancel, job_id)
        if not before.finished:
            _log.info("job cancelled", extra={"job_id": job_id, "was": before.value})
        if before is JobStatus.QUEUED:
            self._moved(job)
        elif before is JobStatus.RUNNING and (attempt := self.attempts.of(job_id)) is not None:
            attempt.stop()
        elif before is JobStatus.RUNNING:
            self._peers.tell("cancelled", job_id)
        return self.attempts.newest(job)

    def runs(self, job_id: str) -> bool:
        """Say whether a job runs here; its events then tell all that happens to it."""
        return self.attempts.of(job_id) is not None

    def load(self) -> Load:
        """Return how busy the workers are."""
        restarts = sum(executor.restarts for executor in self._executors)
        return Load(self._executor.capacity, self._executor.ready, self.attempts.by_lane(), restarts)

    def _moved(self, job: Job, ran_s: float | None = None) -> None:
        """Take note of a job that waits or has ended, and did not before; tell everybody who is interested.

        Parameters
        ----------
        job
            The job.
        ran_s
            How long its last attempt took, if it has ended with one here.
        """
        if not job.status.finished:
            self._reserve.watch(job)
            self._peers.tell("waiting", job.lane)
            self._look_for_one()
            return
        if (events := self.events.known(job.id)) is not None:
            events.end(job)
        self._peers.tell("ended", job.id)
        if self._observer is not None:
            self._observer.ended(job, ran_s)
        about = {"job_id": job.id, "kind": job.kind, "status": job.status.value}
        reason = None if job.error is None else job.error["code"]
        took = None if ran_s is None else round(ran_s, 4)
        _log.info("job ended", extra={**about, "reason": reason, "ran_s": took})

    def _look(self) -> None:
        """Look at all that waits in the table, of which nothing may have been told here."""
        self._look_for_one()
        self._reserve.answering.wake()

    def _look_for_one(self) -> None:
        self._told += 1
        self._dispatching.wake()

    def _hear(self, what: str, of: str) -> None:
        """React to what another service told."""
        match what:
            case "waiting":
                self._look_for_one()
            case "ended" if (events := self.events.known(of)) is not None:
                events.notify()
            case "cancelled" if (attempt := self.attempts.of(of)) is not None:
                attempt.stop()
            case "":
                self._look()
                self.events.notify()

    async def _dispatch(self) -> None:
        """Give free workers to the jobs that wait."""
        while self._accepting and self._looked < self._told:
            async with self._choosing:
                told, lanes = self._told, self.attempts.may_start(self._executor.ready)
                job = await self._writer.write(self._store.claim, lanes) if lanes else None
                if job is None:
                    if lanes == LANES:
                        self._looked = told
                    return
                self._begin(job)

    async def _answer_at_once(self, job_ids: Sequence[str]) -> dict[str, float]:
        """Answer jobs whose time is up while they wait, beside the workers; return the seconds each took."""
        begun = time.monotonic()
        claimed = await self._writer.write(self._store.claim_these, job_ids)
        # While one is brought onto the disk the next is being answered.
        tasks = [self._begin(job, at_once=True) for job in claimed]
        if tasks:
            await asyncio.wait(tasks)
        # Shared out evenly: some end together, and the time between two says little.
        share = (time.monotonic() - begun) / max(1, len(claimed))
        return {job.id: share for job in claimed}

    def _begin(self, job: Job, at_once: bool = False) -> asyncio.Task[None]:
        """Hand a job to the executor, in the same step in which its commit became known here.

        So a cancellation, which is committed after it, finds it among the attempts.
        """
        kind, events, now = self._kinds[job.kind], self.events.open(job.id), self._store.clock.now()
        executor = self._executors[-1] if at_once else self._executor
        attempt = Attempt(job, kind, events, executor, now, self._grace_s, at_once)
        self.attempts.add(attempt)
        if self._observer is not None and job.attempt == 1 and job.started_at is not None:
            self._observer.started(job, max(0.0, (job.started_at - job.created_at).total_seconds()))
        return _spawn(self._finish(attempt), self._finishing)

    async def _finish(self, attempt: Attempt) -> None:
        """Wait for the outcome of a job and store it; its worker stays reserved until that is on disk."""
        bind_contextvars(**attempt.job.labels)
        begun, took = time.monotonic(), 0.0
        job: Job | None = None
        try:
            outcome = await attempt.outcome()
            took = time.monotonic() - begun
            job = await complete(attempt, outcome, self._store, self._writer)
        except Exception:
            _log.exception("a job's end could not be stored; once something can be, it is given back")
        else:
            if job is None:
                _log.warning("a job went on without attempt %d", attempt.job.attempt)
            elif job.status is JobStatus.SUCCEEDED and not attempt.at_once:
                self.attempts.ran(job.lane, [took])
            if job is not None and job.unfinished:
                self._reserve.completing.wake()
        self.attempts.remove(attempt)
        self._dispatching.wake()
        if job is not None:
            self._moved(job, took)
        if job is None or not job.status.finished:
            # It goes on later, or elsewhere: who listens has to look there.
            attempt.events.notify()

    async def _save_progress(self) -> float:
        """Store the progress that is new; this and what follows is done now and then."""
        unsaved = [attempt for attempt in self.attempts if attempt.unsaved]
        for attempt in unsaved:
            attempt.unsaved = False
        if unsaved:
            items = [(each.job.id, each.job.attempt, each.progress) for each in unsaved]
            await self._writer.write(self._store.save_progress, items)
        return _SAVE_INTERVAL_S

    async def _recover(self) -> float:
        """Put back the jobs of other processes that have died."""
        for job in await self._writer.write(self._store.recover, self._peers.is_alive):
            about = {"job_id": job.id, "status": job.status.value}
            _log.warning("a job was left behind by an earlier process", extra=about)
            self._moved(job)
        self._look()
        return min(_LOOK_INTERVAL_S, self._peers.lease_s)

    async def _beat(self) -> float:
        """Show that this service lives, and bring what runs here and what the table says of it together.

        They differ where an end could not be stored; where a connection was cut in the midst of a commit, of
        which nobody knows then whether it was made; and where this service was taken for dead.
        """
        before = list(self.attempts)
        owned = await self._writer.write(self._peers.beat)
        for attempt in before:
            number, cancel_requested = owned.get(attempt.job.id, (0, False))
            if attempt not in self.attempts:
                continue
            if number != attempt.job.attempt:
                _log.warning("a job was taken from this service", extra={"job_id": attempt.job.id})
                attempt.kill("gone")
            elif cancel_requested:
                attempt.stop()
        for job_id in owned.keys() - {each.job.id for each in (*before, *self.attempts)}:
            number, _ = owned[job_id]
            reason = "nobody knows how it ended"
            job = await self._writer.write(self._store.mark_crashed, job_id, number, reason, None)
            if job is not None:
                self._moved(job)
        return self._peers.beat_s

    async def _expire(self) -> float | None:
        """Delete some of the ended jobs that are too old; if there may be more, others write in between."""
        if self._retention_s is None:
            return None
        before = self._store.clock.now() - self._retention_s
        gone = await self._writer.write(self._store.expire, before, _EXPIRED_AT_ONCE)
        if gone:
            _log.info("jobs of long ago were deleted", extra={"jobs": gone})
        return 0.0 if gone == _EXPIRED_AT_ONCE else _EXPIRE_INTERVAL_S


def _spawn(work: Coroutine[Any, Any, T], among: set[asyncio.Task[Any]]) -> asyncio.Task[T]:
    """Run a coroutine that goes on if its caller is cancelled; ``among`` keeps it from being collected."""
    task = asyncio.create_task(work)
    among.add(task)
    task.add_done_callback(among.discard)
    return task
