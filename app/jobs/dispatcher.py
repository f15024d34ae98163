"""Takes jobs in, gives them to workers, and brings what becomes of them into the table.

Everything here runs on one event loop; what touches the disk runs in threads. All writing to the job table
goes through one thread, so what is known here about the table changes in the order of its commits.
"""

from __future__ import annotations

import asyncio
import logging
import random
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from structlog.contextvars import bind_contextvars

from app.jobs.channel import Channels
from app.jobs.errors import Draining, UnknownJobKind
from app.jobs.executor import Execution, Executor
from app.jobs.follow_up import FollowUps
from app.jobs.housekeeping import Housekeeping
from app.jobs.lanes import REMEMBERED_DURATIONS, Lanes, QueueLimit
from app.jobs.model import LANES, Idempotency, Job, JobKind, JobStatus, JobSummary, Lane, Load, Progress
from app.jobs.observer import JobObserver
from app.jobs.overdue import OverdueJobs
from app.jobs.peers import Reactions
from app.jobs.recovery import Recovery
from app.jobs.run import Run, Runs, handed_over
from app.jobs.settling import Settling
from app.jobs.shared import peers_on
from app.jobs.spawning import spawn
from app.jobs.store import JobStore
from app.jobs.transitions import Claim
from app.jobs.waiting import Waiting
from app.jobs.writer import Writer
from app.logs import labels

_PAUSE_S = 0.1
_SETTLE_S = 20.0
# Those who are told when to come again do not all come at once.
_LATEST_RETURN = 1.5

_log = logging.getLogger(__name__)
J = TypeVar("J", bound=JobSummary)


class Dispatcher:
    """Everything of the service that changes jobs.

    Parameters
    ----------
    store
        The job table.
    owner
        In whose name the store takes jobs.
    kinds, executor, reserve, max_queued, overrun_grace_s, retention_s, observer, lease_s
        As given to :class:`app.jobs.service.JobService`.
    channels
        Who listens to which job.
    """

    def __init__(
        self,
        store: JobStore,
        owner: str,
        kinds: Sequence[JobKind],
        executor: Executor,
        reserve: Executor | None,
        channels: Channels,
        *,
        max_queued: Mapping[Lane, int],
        overrun_grace_s: float,
        retention_s: float | None,
        observer: JobObserver,
        lease_s: float,
    ) -> None:
        self._store = store
        self._kinds = {kind.name: kind for kind in kinds}
        self._executor, self._reserve = executor, reserve
        self._channels = channels
        self._max_queued = max_queued
        self._grace_s = overrun_grace_s
        self._observer = observer
        self._writer = Writer()
        self._settling = Settling(store, self._writer, self._kinds, overrun_grace_s)
        self._lanes = Lanes(executor.capacity)
        self._runs, self._clock = Runs(), store.clock
        self._wake = asyncio.Event()
        self._peers = peers_on(store.database, owner, lease_s, self._writer, self._runs, channels)
        self._overdue = OverdueJobs(self._answer_at_once, self._clock.now)
        self._follow_ups = FollowUps(store.unfinished, self._writer, self._kinds, reserve, self._has_spare)
        self._waiting = Waiting(
            self._lanes,
            self._kinds,
            None if reserve is None else self._overdue,
            self._peers,
            self._wake,
        )
        self._recovery = Recovery(
            store,
            self._writer,
            self._kinds,
            self._peers,
            self._waiting,
            partial(self._tell_end, ran_s=None),
        )
        self._reserve_ready = asyncio.Event()
        self._dispatching: asyncio.Task[None] | None = None
        self._house = Housekeeping(store, self._writer, self._runs, self._recovery.look_after, retention_s)
        self._keeping: list[asyncio.Task[None]] = []
        self._requests: set[asyncio.Task[Any]] = set()
        self._finishing: set[asyncio.Task[Any]] = set()
        self._accepting = False
        self._ended = asyncio.Event()

    async def start(self) -> None:
        """Make the tables, give back what an earlier process left running, and begin to work."""
        await self._writer.write(self._store.migrate)
        await self._peers.join(
            Reactions(
                self._waiting.heard,
                self._waiting.forget,
                lambda run: run.stop(self._grace_s),
                self._recovery.give_back,
                self._recovery.look_after,
            )
        )
        await self._recovery.look_after()
        for lane in LANES:
            durations = await self._writer.write(self._store.recent_durations, lane, REMEMBERED_DURATIONS)
            self._lanes.ran(lane, durations)
        self._accepting = True
        await self._executor.start(self._wake.set)
        if self._reserve is not None:
            await self._reserve.start(self._reserve_ready.set)
        self._wake.set()
        self._dispatching = asyncio.create_task(self._dispatch())
        keepers = self._house, self._overdue, self._follow_ups
        self._keeping = [asyncio.create_task(keeper.keep()) for keeper in keepers]

    async def stop(self, grace_s: float) -> None:
        """Take nothing in any more, and put back what still runs after ``grace_s`` seconds."""
        self._accepting = False
        self._wake.set()
        self._overdue.end()
        self._follow_ups.end()
        self._reserve_ready.set()
        # What was begun is brought to its end: a cancelled task would leave behind what its thread commits.
        if self._requests:
            await asyncio.wait(self._requests)
        if self._dispatching is not None:
            await self._dispatching
        if self._finishing:
            await asyncio.wait(self._finishing, timeout=grace_s)
        for run in self._runs:
            run.kill("stop")
        if self._finishing:
            await asyncio.wait(self._finishing, timeout=_SETTLE_S)
        self._ended.set()
        self._house.end()
        for task in self._keeping:
            await task
        await self._peers.leave()
        await self._executor.close()
        if self._reserve is not None:
            await self._reserve.close()
        await self._writer.close()

    async def admit(
        self,
        kind: str,
        payload: dict[str, Any],
        time_limit_s: float | None,
        idempotency: Idempotency | None,
    ) -> tuple[Job, bool]:
        """Take in a job, see :meth:`app.jobs.service.JobService.submit`."""
        if not self._accepting:
            raise Draining
        if kind not in self._kinds:
            raise UnknownJobKind(kind)
        admit = self._admit(self._kinds[kind], payload, time_limit_s, idempotency)
        return await asyncio.shield(spawn(admit, self._requests))

    async def _admit(
        self,
        kind: JobKind,
        payload: dict[str, Any],
        time_limit_s: float | None,
        idempotency: Idempotency | None,
    ) -> tuple[Job, bool]:
        lane = kind.lane
        if not self._runs and not any((*self._lanes.running.values(), *self._lanes.waiting.values())):
            self._clock.follow()
        run_now = self._lanes.is_first(lane) and self._lanes.may_start(lane, self._executor.ready)
        places = self._max_queued[lane]
        free_s = self._lanes.time_to_a_place(lane, self._runs.times(self._clock.now()))
        limit = QueueLimit(places, free_s * random.uniform(1.0, _LATEST_RETURN))
        asked_by = labels()
        if run_now:
            self._lanes.running[lane] += 1
        try:
            claim, created = await self._writer.write(
                self._store.insert,
                kind,
                payload,
                run_now=run_now,
                limit=limit,
                time_limit_s=time_limit_s,
                idempotency=idempotency,
                request_id=asked_by.get("request_id"),
                key_id=asked_by.get("key_id"),
            )
        except BaseException:
            if run_now:
                self._give_back(lane)
            raise
        if created:
            _log.info("job taken in", extra={"job_id": claim.job.id, "kind": kind.name, "lane": lane})
        if created and run_now:
            self._begin(claim)
        elif created:
            self._waiting.more(claim.job, claim.deadline)
        elif run_now:
            self._give_back(lane)
        return claim.job, created

    async def cancel(self, job_id: str) -> Job:
        """Cancel a job, see :meth:`app.jobs.service.JobService.cancel`."""
        if self._ended.is_set():
            raise Draining
        return await asyncio.shield(spawn(self._cancel(job_id), self._requests))

    async def _cancel(self, job_id: str) -> Job:
        job, before = await self._writer.write(self._store.cancel, job_id)
        if not before.finished:
            _log.info("job cancelled", extra={"job_id": job_id, "was": before.value})
        if before is JobStatus.QUEUED:
            self._waiting.less(job)
            self._tell_end(job, None)
        elif before is JobStatus.RUNNING and (run := self._runs.of(job_id)) is not None:
            run.stop(self._grace_s)
        elif before is JobStatus.RUNNING:
            self._peers.tell_cancelled(job_id)
        return self.newest(job)

    def load(self) -> Load:
        """Return how busy the workers are."""
        return Load(
            capacity=self._executor.capacity,
            ready=self._executor.ready,
            running=dict(self._lanes.running),
            waiting=dict(self._lanes.waiting),
            restarts=self._executor.restarts + (0 if self._reserve is None else self._reserve.restarts),
        )

    def runs(self, job_id: str) -> bool:
        """Say whether a job runs here; its channel then tells all that happens to it."""
        return self._runs.of(job_id) is not None

    def newest(self, job: J) -> J:
        """Return a job with the progress that is known here and not yet in the table."""
        run = self._runs.of(job.id)
        if run is None or job.status is not JobStatus.RUNNING:
            return job
        return replace(job, progress=run.progress)

    async def _dispatch(self) -> None:
        """Give free workers to the jobs that wait."""
        while self._accepting:
            await self._wake.wait()
            self._wake.clear()
            while self._accepting and (lane := self._lanes.next_lane(self._executor.ready)) is not None:
                self._lanes.running[lane] += 1
                self._waiting.looks(lane)
                try:
                    claim = await self._writer.write(self._store.claim, lane)
                except Exception:
                    self._lanes.running[lane] -= 1
                    _log.exception("no job could be taken from the queue; there will be another try")
                    await asyncio.sleep(_PAUSE_S)
                    continue
                if claim is None:
                    self._waiting.found_none(lane)
                    self._lanes.running[lane] -= 1
                else:
                    self._waiting.less(claim.job)
                    self._begin(claim)

    async def _answer_at_once(self, job_ids: Sequence[str]) -> dict[str, float]:
        """Answer jobs whose time is up while they wait, beside the workers; return the seconds each took."""
        # Taken before a process has started to answer it, it could be out of its grace by then.
        while self._accepting and self._reserve is not None and self._reserve.ready == 0:
            self._reserve_ready.clear()
            await self._reserve_ready.wait()
        self._follow_ups.make_way()
        begun = time.monotonic()
        claims = await self._writer.write(self._store.claim_these, job_ids)
        for claim in claims:
            self._waiting.less(claim.job)
        # While one is brought onto the disk the next is being answered.
        tasks = [self._begin(claim, at_once=True) for claim in claims]
        if tasks:
            await asyncio.wait(tasks)
        # Shared out evenly: some end together, and the time between two says little.
        share = (time.monotonic() - begun) / max(1, len(claims))
        return {claim.job.id: share for claim in claims}

    def _begin(self, claim: Claim, at_once: bool = False) -> asyncio.Task[None]:
        """Hand a job to the executor, in the same step in which its commit became known here.

        So a cancellation, which is committed after it, finds it among the runs.
        """
        job = claim.job
        kind = self._kinds[job.kind]
        executor, work = self._executor, kind.work
        if at_once and self._reserve is not None and kind.at_once is not None:
            executor, work = self._reserve, kind.at_once
        channel = self._channels.open(job.id)
        now = self._clock.now()
        run = Run(job, claim.deadline, channel, job.progress, now, time.monotonic(), at_once=at_once)
        self._runs.add(run)

        def on_progress(progress: Progress) -> None:
            run.progress, run.unsaved = progress, True
            if run.killed_for != "gone":
                channel.report(progress)

        if job.attempt == 1 and job.started_at is not None:
            self._observer.started(job, max(0.0, (job.started_at - job.created_at).total_seconds()))
        left = None if claim.deadline is None else claim.deadline - now
        loop = asyncio.get_running_loop()
        run.execution = executor.submit(
            work,
            handed_over(job),
            time_left_s=left,
            on_progress=on_progress,
            labels=job.labels,
        )
        if left is not None:
            run.timers.append(loop.call_later(max(0.0, left) + self._grace_s, run.kill, "time"))
        if kind.max_run_s is not None:
            run.timers.append(loop.call_later(kind.max_run_s, run.stop, self._grace_s, "time"))
        return spawn(self._finish(run, run.execution), self._finishing)

    async def _finish(self, run: Run, execution: Execution) -> None:
        """Wait for the outcome of a job and settle it; its worker stays reserved until that is on disk."""
        bind_contextvars(**run.job.labels)
        begun, took = time.monotonic(), None
        job: Job | None = None
        try:
            outcome = await execution.outcome()
            took = time.monotonic() - begun
            for timer in run.timers:
                timer.cancel()
            job = await self._settling.settle(run, outcome)
        except Exception:
            _log.exception("a job's end could not be stored; once something can be, it is given back")
            self._recovery.unsettled(run)
        else:
            if job is None:
                _log.warning("a job went on without attempt %d", run.job.attempt)
            elif job.status is JobStatus.SUCCEEDED and not run.at_once:
                self._lanes.ran(job.lane, [took])
            if job is not None and job.unfinished:
                self._follow_ups.more()
        self._runs.remove(run)
        if job is not None and job.status.finished:
            self._tell_end(job, took)
        else:
            if job is not None:
                self._waiting.more(job, run.deadline)
            # It goes on later, or elsewhere: who listens has to look there.
            run.channel.ring()
        if not run.at_once:
            self._give_back(run.job.lane)

    def _tell_end(self, job: Job, ran_s: float | None) -> None:
        """Tell everybody who is interested that a job has ended."""
        self._channels.end(job)
        self._peers.tell_ended(job.id)
        self._observer.ended(job, ran_s)
        _log.info(
            "job ended",
            extra={
                "job_id": job.id,
                "kind": job.kind,
                "status": job.status.value,
                "reason": None if job.error is None else job.error["code"],
                "ran_s": None if ran_s is None else round(ran_s, 4),
            },
        )

    def _has_spare(self) -> bool:
        return not self._overdue.busy and sum(self._lanes.running.values()) < self._executor.capacity

    def _give_back(self, lane: Lane) -> None:
        self._lanes.running[lane] -= 1
        self._wake.set()
