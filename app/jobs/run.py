"""A job that runs here, as the dispatcher sees it."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from app.jobs.channel import Channel
from app.jobs.executor import Execution
from app.jobs.model import BEST_KNOWN, Job, Lane, Progress

Reason = Literal["time", "cancel", "stop", "gone"]
"""Why a worker was killed: its work did not end with its time, or its cancellation, or the service; or the
job is no longer this service's."""


@dataclass(slots=True, eq=False)
class Run:
    """One attempt at a job.

    Attributes
    ----------
    job, deadline
        As they were taken from the queue.
    channel
        Tells what happens to it.
    begun_at
        When it was handed to a worker, by the service's clock.
    progress
        The newest; ``unsaved`` if it is not in the table yet, where the last went at ``saved_at``.
    execution
        The work; None until it is handed over.
    at_once
        Whether it holds no worker, because its time is up and it is answered beside them.
    killed_for
        Why its worker was killed, if it was.
    timers
        What would kill it later.
    asked_to_stop
        Whether somebody cancelled it, or it took longer than its kind may.
    """

    job: Job
    deadline: float | None
    channel: Channel
    progress: Progress
    begun_at: float
    saved_at: float
    unsaved: bool = False
    at_once: bool = False
    execution: Execution | None = None
    killed_for: Reason | None = None
    timers: list[asyncio.TimerHandle] = field(default_factory=list)
    asked_to_stop: bool = False

    def stop(self, grace_s: float, reason: Reason = "cancel") -> None:
        """Ask the work to stop by itself, and end its worker if it has not after so many seconds."""
        if self.execution is not None and not self.asked_to_stop:
            self.asked_to_stop = True
            self.execution.cancel()
            self.timers.append(asyncio.get_running_loop().call_later(grace_s, self.kill, reason))

    def kill(self, reason: Reason) -> None:
        """End the worker, for the first reason that is given."""
        if self.killed_for is None and self.execution is not None:
            self.killed_for = reason
            self.execution.kill()


class Runs:
    """The attempts that run here, each until its end is settled.

    A job may have two: where this service was taken for dead by another and has then taken the job again, the
    earlier attempt counts no more, and ends while the later one works.
    """

    def __init__(self) -> None:
        self._runs: dict[tuple[str, int], Run] = {}

    def __iter__(self) -> Iterator[Run]:
        return iter(list(self._runs.values()))

    def __len__(self) -> int:
        return len(self._runs)

    def __contains__(self, run: Run) -> bool:
        return self._runs.get((run.job.id, run.job.attempt)) is run

    def add(self, run: Run) -> None:
        """Take note of an attempt, and end an earlier one at the same job."""
        earlier = self.of(run.job.id)
        self._runs[run.job.id, run.job.attempt] = run
        if earlier is not None:
            earlier.kill("gone")

    def remove(self, run: Run) -> None:
        """Take note that an attempt is settled."""
        del self._runs[run.job.id, run.job.attempt]

    def times(self, now: float) -> Iterator[tuple[Lane, float, float | None]]:
        """Return of each that holds a worker its lane, how long it has run, and what its limit leaves it."""
        for run in self:
            if not run.at_once:
                yield run.job.lane, now - run.begun_at, None if run.deadline is None else run.deadline - now

    def of(self, job_id: str) -> Run | None:
        """Return the newest attempt at a job; None if it does not run here."""
        attempts = [run for (of, _), run in self._runs.items() if of == job_id]
        return max(attempts, key=lambda run: run.job.attempt, default=None)


def handed_over(job: Job) -> Mapping[str, Any]:
    """Return what the work gets: the payload, and the progress of an earlier attempt if it has a plan."""
    if job.attempt == 1 or job.progress.assignment is None:
        return job.payload
    return {**job.payload, BEST_KNOWN: job.progress.as_json()}
