"""Durable jobs as the rest of the program sees them: submit, wait, listen, cancel."""

from __future__ import annotations

import asyncio
import logging
import math
import os
import platform
import time
import uuid
from collections.abc import AsyncGenerator, Awaitable, Callable, Coroutine, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from app.jobs.clock import Clock, wait_for
from app.jobs.dispatcher import Dispatcher
from app.jobs.errors import UnknownJobKind
from app.jobs.executor import Executor
from app.jobs.model import (
    LANES,
    Idempotency,
    Job,
    JobEvent,
    JobKind,
    JobObserver,
    JobPage,
    JobStatus,
    JobSummary,
    Lane,
    Load,
)
from app.jobs.store import JobStore
from app.jobs.tables import Database
from app.logs import labels

# A waiter may miss the news of a job that another process runs, and looks at the table.
_LOOK_AGAIN_S = 5.0
_PLACES = 64

_log = logging.getLogger(__name__)


class JobService:
    """Durable jobs of some kinds, run by an executor.

    A job is committed before :meth:`submit` returns, and from then on it is finished once, whatever dies:
    what runs when its worker or this process dies waits again, ``max_attempts`` times. One service at a
    time works on an SQLite file, others are refused; on PostgreSQL several share the jobs, on one machine or
    many.

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
        some = dict.fromkeys(LANES, max_queued) if isinstance(max_queued, int) else max_queued
        self._places = {**dict.fromkeys(LANES, _PLACES), **some}
        owner = f"{platform.node()}:{os.getpid()}:{uuid.uuid4().hex[:12]}"
        self._store = JobStore(database, owner, max_attempts, kinds, Clock())
        rest = observer, overrun_grace_s, retention_s, lease_s
        self._dispatcher = Dispatcher(self._store, executor, reserve, *rest)
        self._database, self._attempts = database, self._dispatcher.attempts
        self._events, self._runs = self._dispatcher.events, self._dispatcher.runs
        # Where nobody else can change a job, nothing happens to it that its events do not tell.
        self._look_again_s = _LOOK_AGAIN_S if database.shared else math.inf
        self._stopping: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Make the tables, give back what an earlier process left running, and begin to work.

        Workers start in the background; jobs wait until one is warm, see :meth:`load`.

        Raises
        ------
        policy_store.errors.DatabaseOccupied
            If another service works on the database, which is not shared.
        """
        await asyncio.to_thread(self._database.occupy)
        try:
            await self._dispatcher.start()
        except BaseException:
            self._database.vacate()
            raise

    def begin_stop(self, grace_s: float) -> None:
        """Take no new jobs, end event streams, and let what runs go on for ``grace_s`` seconds at most.

        What still runs then goes back to the queue, without loss of an attempt; the next start goes on with
        it and with what waits. Callers who wait for a job that does not run get it at once, the others as it
        is then. Only the first call has an effect.
        """
        if self._stopping is None:
            self._stopping = asyncio.create_task(self._stop(grace_s))
            self._events.stop()

    async def stop(self, grace_s: float) -> None:
        """Stop as :meth:`begin_stop` does, unless that was called, and wait until that is done."""
        self.begin_stop(grace_s)
        assert self._stopping is not None
        await self._stopping

    async def _stop(self, grace_s: float) -> None:
        await self._dispatcher.stop(grace_s)
        self._database.vacate()
        self._events.notify()

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
        if kind not in self._store.kinds:
            raise UnknownJobKind(kind)
        known = self._store.kinds[kind]
        insert = partial(
            self._store.insert,
            known,
            payload,
            places=self._places[known.lane],
            time_limit_s=time_limit_s,
            idempotency=idempotency,
            asked_by=labels(),
        )
        return await self._dispatcher.admit(known.lane, insert)

    async def get(self, job_id: str) -> Job:
        """Return a job with its newest progress.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        return self._attempts.newest(await asyncio.to_thread(self._store.get, job_id))

    async def look(self, job_id: str) -> JobSummary:
        """Return a job with its newest progress, without its payload and result.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        if (events := self._events.known(job_id)) is not None:
            events.followed = True
        return self._attempts.newest(await asyncio.to_thread(self._store.look, job_id))

    async def result_text(self, job_id: str) -> str | None:
        """Return a job's result as JSON, as it is stored; None without one."""
        return await asyncio.to_thread(self._store.result_text, job_id)

    async def list(self, limit: int, cursor: str | None = None, status: JobStatus | None = None) -> JobPage:
        """Return at most ``limit`` jobs, newest first, from the cursor of the page before.

        Parameters
        ----------
        limit, cursor
            How many, and where from; None: from the newest.
        status
            Only jobs of that status; None: all.

        Raises
        ------
        InvalidCursor
            If no page gave out such a cursor.
        """
        page = await asyncio.to_thread(self._store.page, limit, cursor, status)
        newest = (self._attempts.newest(job) for job in page.jobs)
        plain = (replace(job, progress=replace(job.progress, assignment=None)) for job in newest)
        return replace(page, jobs=tuple(plain))

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

    async def abandon(self, job_id: str) -> None:
        """Cancel a job whose client has gone, unless somebody else has asked for it or the service stops."""
        if self._stopping is None and not self._events.open(job_id).followed:
            _log.info("the client of a job has gone", extra={"job_id": job_id})
            await self.cancel(job_id)

    async def wait(self, job_id: str, timeout_s: float | None) -> Job:
        """Wait until a job is finished, for ``timeout_s`` at most (None: for ever), and return it.

        Returns
        -------
        Job
            Unfinished if the time ran out or the service stops and the job does not run.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        end = math.inf if timeout_s is None else time.monotonic() + timeout_s
        events = self._events.open(job_id)
        while not events.over.is_set():
            changed = events.changed
            if not self._runs(job_id):
                await self._events.catch_up(job_id, events)
            pause_s = min(end - time.monotonic(), self._look_again_s)
            in_vain = self._stopping is not None and not self._runs(job_id)
            if events.over.is_set() or in_vain or pause_s <= 0:
                break
            await wait_for(changed, None if math.isinf(pause_s) else pause_s)
        return events.ended or await self.get(job_id)

    async def wait_for_client(
        self, job_id: str, timeout_s: float | None, gone: Coroutine[Any, Any, object]
    ) -> Job | None:
        """Wait as :meth:`wait` does for a client that has nothing to come again with.

        Parameters
        ----------
        job_id, timeout_s
            As there.
        gone
            Returns when the client has gone.

        Returns
        -------
        Job or None
            None: the client has gone, and the job is cancelled unless somebody else has asked for it.
        """
        events = self._events.open(job_id)  # open until here is known who else has asked
        waiting, leaving = asyncio.create_task(self.wait(job_id, timeout_s)), asyncio.create_task(gone)
        try:
            await asyncio.wait((waiting, leaving), return_when=asyncio.FIRST_COMPLETED)
            if waiting.done():
                return waiting.result()
            await self.abandon(job_id)
            return None
        finally:
            waiting.cancel()
            leaving.cancel()
            del events

    def events(
        self, job_id: str, after: int = 0, allowed: Callable[[], Awaitable[bool]] | None = None
    ) -> AsyncGenerator[JobEvent]:
        """Listen to a job, see :meth:`app.jobs.events.EventStreams.listen`."""
        return self._events.listen(job_id, after, allowed)

    def has_told_all(self, job: JobSummary, after: int) -> bool:
        """Say whether a job has ended, and ``after`` is the id of its last event."""
        return self._events.has_told_all(job, after)

    def load(self) -> Load:
        """Return how busy the service is; it answers quickly once a worker is ready."""
        return self._dispatcher.load()

    def waiting(self) -> dict[Lane, int]:
        """Return how many jobs wait in each lane; blocks, as the table says it."""
        return self._store.waiting()
