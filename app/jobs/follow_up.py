"""Results that an answer had no time to complete are completed after it, while nobody waits."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from typing import Any

import sqlalchemy as sa
from sqlalchemy import RowMapping

from app.jobs.attempts import Writer
from app.jobs.clock import Loop
from app.jobs.executor import Execution, Executor, Raised, Returned
from app.jobs.model import FINISHED, Job
from app.jobs.queries import job_of, select_jobs, select_to_change
from app.jobs.store import JobStore
from app.jobs.stored_json import read_later
from app.jobs.tables import DATABASE_NOW, jobs

_LEFT_ALONE_S = 60.0
"""Of another service that shares the database: its results are completed by this one after so long."""

_LOOK_INTERVAL_S = 15.0
_PAUSE_S = 0.1

_log = logging.getLogger(__name__)


class UnfinishedResults:
    """The results that are to be completed, in the job table; the methods block on the disk.

    Parameters
    ----------
    store
        The job table; the jobs of its owner come first, and each is tried as often as a job may be lost.
    """

    def __init__(self, store: JobStore) -> None:
        self._store, self._database = store, store.database

    def next(self) -> Job | None:
        """Return the job whose result is to be completed next; None if there is none."""
        statement = select_jobs.where(jobs.c.unfinished.is_not(None))
        if self._database.shared:
            left_alone = jobs.c.finished_at < DATABASE_NOW - _LEFT_ALONE_S
            statement = statement.where(sa.or_(jobs.c.owner == self._store.owner, left_alone))
        statement = statement.order_by(jobs.c.unfinished, jobs.c.number).limit(1)
        with self._database.read() as connection:
            row = connection.execute(statement).mappings().first()
        return None if row is None else job_of(row)

    def complete(self, job_id: str, attempt: int, fields: Mapping[str, Any]) -> bool:
        """Store the fields of a result that complete it.

        Returns
        -------
        bool
            False if the result was completed by another, or the job is no more.
        """
        return self._change(job_id, attempt, lambda _row: fields)

    def failed(self, job_id: str, attempt: int, given_up: Mapping[str, Any]) -> None:
        """Count a try in vain; after the last one the result gets the fields of one that is given up."""
        last = self._store.max_attempts - 1
        self._change(job_id, attempt, lambda row: given_up if row["unfinished"] >= last else None)

    def _change(
        self, job_id: str, attempt: int, fields_of: Callable[[RowMapping], Mapping[str, Any] | None]
    ) -> bool:
        """Complete the result of an ended job by some fields; None: count a try."""
        ended = jobs.c.status.in_(FINISHED), jobs.c.unfinished.is_not(None)
        unfinished = select_to_change.where(jobs.c.id == job_id, jobs.c.attempt == attempt, *ended)
        with self._database.write() as connection:
            row = connection.execute(unfinished).mappings().first()
            if row is None:
                return False
            values: dict[str, Any] = {"unfinished": row["unfinished"] + 1}
            if (fields := fields_of(row)) is not None:
                values = {"result": {**read_later(row["result"]), **fields}, "unfinished": None}
            connection.execute(sa.update(jobs).where(jobs.c.number == row["number"]).values(values))
        return True


class FollowUps:
    """Completes results, one after the other, in the process that answers where workers are busy.

    Parameters
    ----------
    store, writer
        The job table, and what writes to it.
    executor
        What does it; None: nothing, they stay as they are.
    may_work
        Says whether nobody needs that process, or its core, now.

    Attributes
    ----------
    loop
        Does it; to be woken when there is a result to complete.
    """

    def __init__(
        self,
        store: JobStore,
        writer: Writer,
        executor: Executor | None,
        may_work: Callable[[], bool],
    ) -> None:
        self._results, self._writer, self._kinds = UnfinishedResults(store), writer, store.kinds
        self._executor, self._may_work = executor, may_work
        self._execution: Execution | None = None
        self.loop = Loop(self._complete_all, "a result could not be completed")

    def make_way(self) -> None:
        """Stop what is being done: somebody waits for an answer. It is begun anew later."""
        if self._execution is not None:
            self._execution.cancel()

    def end(self) -> None:
        """End the loop soon."""
        self.loop.end()
        self.make_way()

    async def _complete_all(self) -> float | None:
        if self._executor is None:
            return None
        while not self.loop.ended and await self._complete_next(self._executor):
            pass
        return _LOOK_INTERVAL_S

    async def _complete_next(self, executor: Executor) -> bool:
        """Complete a result as soon as that holds up nobody; False if there is none."""
        job = await asyncio.to_thread(self._results.next)
        if job is None:
            return False
        while not (executor.ready and self._may_work()):
            if self.loop.ended:
                return False
            await asyncio.sleep(_PAUSE_S)
        kind = self._kinds.get(job.kind)
        follow_up = None if kind is None else kind.follow_up
        if follow_up is None:
            # A version that has no such work any more.
            await self._writer.write(self._results.complete, job.id, job.attempt, {})
            return True
        payload = {**job.payload, "result": job.result}
        self._execution = executor.submit(
            follow_up.work, payload, time_left_s=None, on_progress=_ignored, labels=job.labels
        )
        try:
            outcome = await self._execution.outcome()
        finally:
            self._execution = None
        if isinstance(outcome, Returned):
            if not outcome.work.unfinished:
                await self._writer.write(self._results.complete, job.id, job.attempt, outcome.work.result)
        elif not self.loop.ended:
            reason = outcome.error["detail"] if isinstance(outcome, Raised) else outcome.reason
            _log.warning("a result is not completed: %s", reason, extra={"job_id": job.id})
            await self._writer.write(self._results.failed, job.id, job.attempt, follow_up.given_up)
        return True


def _ignored(_progress: object) -> None:
    """Nobody waits for it."""
