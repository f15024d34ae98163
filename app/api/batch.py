"""Many allocations of one request: each is a job, and is answered when it has ended.

The jobs wait in a lane of their own, behind what somebody waits for one by one. They are taken in as fast as
that lane has places, also after the client has gone; what was taken in is as durable as any other job.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
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
        self._going: set[asyncio.Task[None]] = set()

    async def begin(self, prepared: Sequence[Prepare]) -> AsyncIterator[Ended]:
        """Take in the first allocation, and return the answers of all as they come.

        Raises
        ------
        QueueFull
            If the lane has no place even for the first.
        Draining
            If the service is stopping.
        """
        batch = _Batch(self._jobs, self._kind)
        await batch.take_in(0, prepared[0], patient=False)

        async def take_in_others() -> None:
            for index, prepare in enumerate(prepared[1:], 1):
                await batch.take_in(index, prepare, patient=True)

        submitting = asyncio.create_task(take_in_others())
        self._going.add(submitting)
        submitting.add_done_callback(self._going.discard)
        return batch.answers(len(prepared))


class _Batch:
    """A batch on its way."""

    def __init__(self, jobs: JobService, kind: str) -> None:
        self._jobs = jobs
        self._kind = kind
        self._answers: asyncio.Queue[Ended] = asyncio.Queue()
        self._waiting: set[asyncio.Task[None]] = set()
        self._left_alone = False

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
            if not self._left_alone:
                task = asyncio.create_task(self._wait(index, job.id))
                self._waiting.add(task)
                task.add_done_callback(self._waiting.discard)

    async def answers(self, count: int) -> AsyncIterator[Ended]:
        """Yield so many answers; if nobody takes them any more, nobody waits for the jobs either."""
        try:
            for _ in range(count):
                yield await self._answers.get()
        finally:
            self._left_alone = True
            for task in self._waiting:
                task.cancel()

    async def _submit(self, submission: Submission, patient: bool) -> Job:
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
