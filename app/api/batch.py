"""Many allocations of one request: each is a job, and is answered when it has ended.

The jobs wait in a lane of their own, behind what somebody waits for one by one. They are taken in as fast as
that lane has places; what was taken in is as durable as any other job. Where they have idempotency keys, by
which a client that has gone can come again for them, all that goes on without it.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine, Sequence
from dataclasses import dataclass
from typing import Any

from app.jobs.errors import Draining, QueueFull
from app.jobs.model import Idempotency, Job
from app.jobs.service import JobService

_LONGEST_PAUSE_S = 1.0


@dataclass(frozen=True, slots=True)
class Submission:
    """What becomes a job.

    Attributes
    ----------
    payload
        What the work gets.
    idempotency
        So that a batch that comes again gets the jobs of the first time.
    """

    payload: dict[str, Any]
    idempotency: Idempotency | None


Prepare = Callable[[], Submission]
"""Makes a submission, or raises what is wrong with it."""

Ended = tuple[int, Job | Exception]
"""The place of an allocation in its batch, and its job at its end, or why it has none."""


class Batches:
    """Brings batches to the job table.

    Parameters
    ----------
    jobs
        The jobs.
    kind
        Of job.
    """

    def __init__(self, jobs: JobService, kind: str) -> None:
        self._jobs = jobs
        self._kind = kind
        self._going: set[asyncio.Task[Any]] = set()

    async def begin(self, prepared: Sequence[Prepare]) -> AsyncIterator[Ended]:
        """Take in the first allocation, and return the answers of all as they come.

        Raises
        ------
        QueueFull
            If the lane has no place even for the first.
        Draining
            If the service is stopping.
        """
        batch = _Batch(self._jobs, self._kind, self._keep)
        await batch.take_in(0, prepared[0], patient=False)

        async def take_in_others() -> None:
            for index, prepare in enumerate(prepared[1:], 1):
                if not batch.is_given_up:
                    await batch.take_in(index, prepare, patient=True)

        self._keep(take_in_others())
        return batch.answers(len(prepared))

    def _keep(self, work: Coroutine[Any, Any, None]) -> None:
        """Do work whether or not somebody waits for it."""
        task = asyncio.create_task(work)
        self._going.add(task)
        task.add_done_callback(self._going.discard)


class _Batch:
    """A batch on its way."""

    def __init__(
        self, jobs: JobService, kind: str, keep: Callable[[Coroutine[Any, Any, None]], None]
    ) -> None:
        self._jobs = jobs
        self._kind = kind
        self._keep = keep
        self._answers: asyncio.Queue[Ended] = asyncio.Queue()
        self._waiting: dict[asyncio.Task[None], str] = {}
        self._left_alone = False
        self._comes_again = False

    @property
    def is_given_up(self) -> bool:
        """Whether the client has gone, and cannot come again."""
        return self._left_alone and not self._comes_again

    async def take_in(self, index: int, prepare: Prepare, *, patient: bool) -> None:
        """Make an allocation a job; who is patient waits for a place, and takes every error for an answer."""
        try:
            job = await self._submit(prepare(), patient)
        except (QueueFull, Draining) as error:
            if not patient:
                raise
            self._answers.put_nowait((index, error))
        except Exception as error:
            self._answers.put_nowait((index, error))
            await asyncio.sleep(0)  # others have their turn between two problems that are wrong
        else:
            if self.is_given_up:
                await self._jobs.abandon(job.id)
            elif not self._left_alone:
                task = asyncio.create_task(self._wait(index, job.id))
                self._waiting[task] = job.id
                task.add_done_callback(lambda done: self._waiting.pop(done, None))

    async def answers(self, count: int) -> AsyncIterator[Ended]:
        """Yield so many answers; if nobody takes them any more, nobody waits for the jobs either."""
        try:
            for _ in range(count):
                yield await self._answers.get()
        finally:
            self._left_alone = True
            self._keep(self._leave())

    async def _leave(self) -> None:
        """Stop waiting for the jobs, and cancel them if nobody can ask for them any more."""
        for task, job_id in list(self._waiting.items()):
            if self.is_given_up:
                await self._jobs.abandon(job_id)
            task.cancel()

    async def _submit(self, submission: Submission, patient: bool) -> Job:
        self._comes_again = submission.idempotency is not None
        while True:
            try:
                job, _ = await self._jobs.submit(
                    self._kind, submission.payload, idempotency=submission.idempotency
                )
            except QueueFull as full:
                if not patient:
                    raise
                await asyncio.sleep(min(_LONGEST_PAUSE_S, full.retry_after_s))
            else:
                return job

    async def _wait(self, index: int, job_id: str) -> None:
        try:
            ended: Job | Exception = await self._jobs.wait(job_id, None)
        except Exception as error:
            ended = error
        self._answers.put_nowait((index, ended))
