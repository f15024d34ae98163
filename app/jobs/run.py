"""A job that runs here, as the dispatcher sees it."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import Literal

from app.jobs.channel import Channel
from app.jobs.executor import Execution
from app.jobs.model import Job, Progress

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
        Whether somebody cancelled it.
    """

    job: Job
    deadline: float | None
    channel: Channel
    progress: Progress
    saved_at: float
    unsaved: bool = False
    at_once: bool = False
    execution: Execution | None = None
    killed_for: Reason | None = None
    timers: list[asyncio.TimerHandle] = field(default_factory=list)
    asked_to_stop: bool = False

    def stop(self, grace_s: float) -> None:
        """Ask the work to stop by itself, and end its worker if it has not after so many seconds."""
        if self.execution is not None and not self.asked_to_stop:
            self.asked_to_stop = True
            self.execution.cancel()
            self.timers.append(asyncio.get_running_loop().call_later(grace_s, self.kill, "cancel"))

    def kill(self, reason: Reason) -> None:
        """End the worker, for the first reason that is given."""
        if self.killed_for is None and self.execution is not None:
            self.killed_for = reason
            self.execution.kill()
