"""Durable jobs as the rest of the program sees them: submit, wait, listen, cancel."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from app.jobs.channel import Channels, rung
from app.jobs.dispatcher import Dispatcher
from app.jobs.executor import Executor
from app.jobs.model import (
    LANES,
    Idempotency,
    Job,
    JobEvent,
    JobKind,
    JobPage,
    JobStatus,
    Lane,
    Load,
    Progress,
)
from app.jobs.observer import JobObserver, NoObserver
from app.jobs.owner import new_owner
from app.jobs.reading import Database
from app.jobs.store import JobStore

# Who waits for a job that another process runs may miss what is told of its end, and looks at the table.
_LOOK_AGAIN_S = 5.0
_PLACES = 64
# Its progress is told by nobody: who wants to see that looks as often as it is stored.
_LOOK_FOR_PROGRESS_S = 1.0


class JobService:
    """Durable jobs of some kinds, run by an executor.

    A job is committed before :meth:`submit` returns, and from then on it is finished once, whatever dies:
    what runs when its worker or this process dies waits again, ``max_attempts`` times. One service at a
    time works on an SQLite file; on PostgreSQL several share the jobs, on one machine or many.

    Parameters
    ----------
    database
        Where the job tables are, or will be.
    kinds
        What can be submitted.
    executor
        Runs the work; it is started and closed by the service.
    reserve
        Answers the jobs that still wait when their time limit ends, where their kind has what does it; it is
        started and closed by the service. None: they wait for a worker all the same.
    max_queued
        How many jobs may wait in each lane, or in those that are named; 64 in the others.
    max_attempts
        How often a job may be lost with its worker or its process before it has failed.
    overrun_grace_s
        How long work may go on after it was cancelled or its time is up, before its worker is killed.
    retention_s
        How long ended jobs are kept, with what they left and their idempotency keys; None: for ever.
    observer
        Told of jobs as they begin and end.
    lease_s
        On a shared database, how long a service that gives no sign of life counts as alive.
    """

    def __init__(
        self,
        database: Database,
        kinds: Sequence[JobKind],
        executor: Executor,
        *,
        reserve: Executor | None = None,
        max_queued: int | Mapping[Lane, int] = _PLACES,
        max_attempts: int = 3,
        overrun_grace_s: float = 5.0,
        retention_s: float | None = None,
        observer: JobObserver | None = None,
        lease_s: float = 15.0,
    ) -> None:
        owner = new_owner()
        dropped_fields = {kind.name: kind.dropped_fields for kind in kinds}
        self._store = JobStore(database, owner, max_attempts, dropped_fields)
        self._channels = Channels()
        self._dispatcher = Dispatcher(
            self._store,
            owner,
            kinds,
            executor,
            reserve,
            self._channels,
            max_queued=dict.fromkeys(LANES, max_queued)
            if isinstance(max_queued, int)
            else {**dict.fromkeys(LANES, _PLACES), **max_queued},
            overrun_grace_s=overrun_grace_s,
            retention_s=retention_s,
            observer=observer or NoObserver(),
            lease_s=lease_s,
        )
        self._stopping = False
        self._stopped = False

    async def start(self) -> None:
        """Make the tables, give back what an earlier process left running, and begin to work.

        Workers start in the background; jobs wait until one is warm, see :meth:`load`.
        """
        await self._dispatcher.start()

    async def stop(self, grace_s: float) -> None:
        """Take no new jobs, end event streams, and let what runs go on for ``grace_s`` seconds at most.

        What still runs then goes back to the queue, without loss of an attempt; the next start goes on with
        it and with what waits. Waiting callers get their job as it is then.
        """
        self._stopping = True
        self._channels.ring()
        await self._dispatcher.stop(grace_s)
        self._stopped = True
        self._channels.ring()

    async def submit(
        self,
        kind: str,
        payload: dict[str, Any],
        *,
        time_limit_s: float | None = None,
        idempotency: Idempotency | None = None,
    ) -> tuple[Job, bool]:
        """Take in a job; it is on disk when this returns, and finishes even if the caller is cancelled.

        Parameters
        ----------
        kind
            Name of one of the kinds.
        payload
            JSON-ready; what the work function gets.
        time_limit_s
            Counted from now, waiting included; 0 if it has passed.
        idempotency
            A key that was seen before with the same body gives the first job, in whatever state it is: a
            retry while it runs waits for it as the first caller does.

        Returns
        -------
        tuple
            The job, and whether it is new.

        Raises
        ------
        Draining
            If the service is stopping or was not started.
        UnknownJobKind
            If there is no such kind.
        QueueFull
            If it would have to wait, and no place is left in its lane's queue.
        IdempotencyMismatch
            If the key was seen with another body.
        """
        return await self._dispatcher.admit(kind, payload, time_limit_s, idempotency)

    async def get(self, job_id: str) -> Job:
        """Return a job with its newest progress.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        return self._dispatcher.newest(await asyncio.to_thread(self._store.get, job_id))

    async def list(self, limit: int, cursor: str | None = None) -> JobPage:
        """Return at most ``limit`` jobs, newest first, from the cursor of the page before.

        Raises
        ------
        InvalidCursor
            If no page gave out such a cursor.
        """
        page = await asyncio.to_thread(self._store.page, limit, cursor)
        return replace(page, jobs=tuple(self._dispatcher.newest(job) for job in page.jobs))

    async def artifact(self, job_id: str) -> bytes | None:
        """Return the bytes that a job's work left; None if it left none.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        return await asyncio.to_thread(self._store.artifact, job_id)

    async def cancel(self, job_id: str) -> Job:
        """Cancel a job and return it as it is now; nothing happens to a finished one.

        A waiting job is cancelled at once. A running one is asked to stop, and is cancelled with the best it
        has found; if it does not react it is killed after the grace, and its last progress stays.

        Raises
        ------
        JobNotFound
            If no job has that id.
        Draining
            If the service has stopped.
        """
        return await self._dispatcher.cancel(job_id)

    async def wait(self, job_id: str, timeout_s: float | None) -> Job:
        """Wait until a job is finished, for ``timeout_s`` at most (None: for ever), and return it.

        Returns
        -------
        Job
            Unfinished if the time ran out or the service stopped.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        end = None if timeout_s is None else time.monotonic() + timeout_s
        channel = self._channels.open(job_id)
        while True:
            bell = channel.changed
            if channel.ended is None and not self._dispatcher.runs(job_id):
                job = await self.get(job_id)
                if job.status.finished:
                    channel.catch_up(job)
            if channel.ended is not None:
                return channel.ended
            left = _LOOK_AGAIN_S if end is None else min(_LOOK_AGAIN_S, end - time.monotonic())
            if left <= 0 or self._stopped:
                return await self.get(job_id)
            await rung(bell, left)

    async def events(self, job_id: str, after: int = 0) -> AsyncIterator[JobEvent]:
        """Yield a job's events with ids larger than ``after``: what is remembered, then what happens.

        Ends after the ``"end"`` event, or when the service begins to stop.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        seen: Progress | None = None
        channel = self._channels.open(job_id)
        while True:
            bell = channel.changed
            elsewhere = channel.ended is None and not self._dispatcher.runs(job_id)
            if elsewhere:
                job = await self.get(job_id)
                # While that was read, it may have begun to run here, or what is read may be of before.
                elsewhere = channel.ended is None and not self._dispatcher.runs(job_id)
                if elsewhere and job.status.finished:
                    channel.catch_up(job)
                elif elsewhere and job.status is JobStatus.RUNNING:
                    if job.progress not in (seen, channel.progress):
                        channel.report(job.progress)
                    seen = job.progress
            ended = channel.ended is not None
            for event in channel.since(after):
                after = event.id
                yield event
            if ended or self._stopping:
                return
            await rung(bell, _LOOK_FOR_PROGRESS_S if elsewhere else _LOOK_AGAIN_S)

    def load(self) -> Load:
        """Return how busy the service is; it answers quickly once a worker is ready."""
        return self._dispatcher.load()
