"""Giving back the jobs that nobody runs: of services that died, and those whose end could not be stored."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection

from app.jobs.model import Job
from app.jobs.peers import Peers
from app.jobs.run import Run
from app.jobs.store import JobStore
from app.jobs.waiting import Waiting
from app.jobs.writer import Writer

_log = logging.getLogger(__name__)


class Recovery:
    """Brings the table, and what is known here of it, in order again.

    Parameters
    ----------
    store, writer
        The job table, and its writer.
    kinds
        The names of the kinds of job that this service has.
    peers
        The other services.
    waiting
        The jobs that wait.
    tell_end
        Called with a job that has ended by this.
    """

    def __init__(
        self,
        store: JobStore,
        writer: Writer,
        kinds: Collection[str],
        peers: Peers,
        waiting: Waiting,
        tell_end: Callable[[Job], None],
    ) -> None:
        self._store, self._writer, self._kinds = store, writer, tuple(kinds)
        self._peers, self._waiting = peers, waiting
        self._tell_end = tell_end
        self._unsettled: list[Run] = []
        self._one_at_a_time = asyncio.Lock()

    def unsettled(self, run: Run) -> None:
        """Take note of a run whose end could not be stored."""
        self._unsettled.append(run)

    async def look_after(self) -> None:
        """Give back the jobs whose end could not be stored, and those of other processes that have died."""
        async with self._one_at_a_time:
            while self._unsettled:
                run = self._unsettled[0]
                reason = "its end could not be stored"
                job = await self._writer.write(
                    self._store.lose, run.job.id, run.job.attempt, reason, run.progress
                )
                self._unsettled.pop(0)
                if job is not None and job.status.finished:
                    self._tell_end(job)
            await self._recover()

    async def give_back(self, job_id: str, attempt: int) -> None:
        """Put back a job that was taken in a commit of which this service never learned."""
        if any(run.job.id == job_id for run in self._unsettled):
            return
        job = await self._writer.write(self._store.release, job_id, attempt, None)
        if job is not None and job.status.finished:
            self._tell_end(job)
        elif job is not None:
            self._peers.tell_waiting(job.lane)
            await self.look_after()

    async def _recover(self) -> None:
        changed = await self._writer.write(self._store.recover, self._kinds, self._peers.is_alive)
        for job in changed:
            _log.warning(
                "a job was left behind by an earlier process",
                extra={"job_id": job.id, "status": job.status.value},
            )
            if job.status.finished:
                self._tell_end(job)
            else:
                self._peers.tell_waiting(job.lane)
        self._waiting.count_anew(await self._writer.write(self._store.waiting))
        self._waiting.watch_anew(await self._writer.write(self._store.deadlines))
