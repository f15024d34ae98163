"""Results that an answer had no time to complete are completed after it, while nobody waits."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

from app.jobs.channel import rung
from app.jobs.executor import Execution, Executor, Raised, Returned
from app.jobs.model import Job, JobKind, Progress
from app.jobs.unfinished import UnfinishedResults
from app.jobs.writer import Writer

_LOOK_INTERVAL_S = 15.0
_PAUSE_S = 0.1

_log = logging.getLogger(__name__)


class FollowUps:
    """Completes results, one after the other, in the process that answers where workers are busy.

    Parameters
    ----------
    results, writer
        The results, and what writes to the job table.
    kinds
        The kinds of job by their names.
    executor
        What does it; None: nothing, they stay as they are.
    may_work
        Says whether nobody needs that process, or its core, now.
    """

    def __init__(
        self,
        results: UnfinishedResults,
        writer: Writer,
        kinds: Mapping[str, JobKind],
        executor: Executor | None,
        may_work: Callable[[], bool],
    ) -> None:
        self._results, self._writer, self._kinds = results, writer, kinds
        self._executor, self._may_work = executor, may_work
        self._execution: Execution | None = None
        self._more = asyncio.Event()
        self._more.set()
        self._ended = False

    def more(self) -> None:
        """Take note that there is a result to complete."""
        self._more.set()

    def make_way(self) -> None:
        """Stop what is being done: somebody waits for an answer. It is begun anew later."""
        if self._execution is not None:
            self._execution.cancel()

    def end(self) -> None:
        """Make :meth:`keep` return soon."""
        self._ended = True
        self._more.set()
        self.make_way()

    async def keep(self) -> None:
        """Complete results until the end."""
        if self._executor is None:
            return
        while not self._ended:
            await rung(self._more, _LOOK_INTERVAL_S)
            self._more.clear()
            try:
                while not self._ended and await self._complete_next(self._executor):
                    pass
            except Exception:
                _log.exception("a result could not be completed; there will be another try")
                await asyncio.sleep(_PAUSE_S)

    async def _complete_next(self, executor: Executor) -> bool:
        """Complete a result as soon as that holds up nobody; False if there is none."""
        job = await asyncio.to_thread(self._results.next)
        if job is None:
            return False
        while not (executor.ready and self._may_work()):
            if self._ended:
                return False
            await asyncio.sleep(_PAUSE_S)
        await self._complete(job, executor)
        return True

    async def _complete(self, job: Job, executor: Executor) -> None:
        kind = self._kinds.get(job.kind)
        follow_up = None if kind is None else kind.follow_up
        if follow_up is None:
            # A version that has no such work any more.
            await self._writer.write(self._results.complete, job.id, job.attempt, {})
            return
        self._execution = executor.submit(
            follow_up.work,
            {**job.payload, "result": job.result},
            time_left_s=None,
            on_progress=_ignored,
            labels=job.labels,
        )
        try:
            outcome = await self._execution.outcome()
        finally:
            self._execution = None
        if isinstance(outcome, Returned):
            if not outcome.work.unfinished:
                await self._writer.write(self._results.complete, job.id, job.attempt, outcome.work.result)
        elif not self._ended:
            reason = outcome.error["detail"] if isinstance(outcome, Raised) else outcome.reason
            _log.warning("a result is not completed: %s", reason, extra={"job_id": job.id})
            await self._writer.write(self._results.failed, job.id, job.attempt, follow_up.given_up)


def _ignored(_progress: Progress) -> None:
    """Nobody waits for it."""
