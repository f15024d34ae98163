"""Who wants to know of jobs as they begin and end, for instance to count them."""

from __future__ import annotations

from typing import Protocol

from app.jobs.model import Job


class JobObserver(Protocol):
    """Told of jobs on the event loop; it must be quick and must not raise."""

    def started(self, job: Job, waited_s: float) -> None:
        """Take note of a job's first attempt, and how long it waited for it in seconds."""

    def ended(self, job: Job, ran_s: float | None) -> None:
        """Take note of a job's end.

        Parameters
        ----------
        job
            Succeeded, failed or cancelled.
        ran_s
            How long its last attempt took in seconds; None if it ended without one in this process.
        """


class NoObserver:
    """A :class:`JobObserver` for which nothing is of interest."""

    def started(self, job: Job, waited_s: float) -> None:
        """Take no note."""

    def ended(self, job: Job, ran_s: float | None) -> None:
        """Take no note."""
