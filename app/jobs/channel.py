"""What happens to a job, told to everybody in this process who listens."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from weakref import WeakValueDictionary

from app.jobs.model import Job, JobEvent, JobSummary, Progress

# A progress supersedes those before it: a listener that is further behind misses nothing that still holds.
# Each may have a plan in it, of a thousand UAVs too.
_REMEMBERED_EVENTS = 32


class Channel:
    """The events of one job, and a bell that rings at each.

    Attributes
    ----------
    progress
        The newest; None if none was reported since the service started.
    over
        Set when the end was told.
    ended
        The job at its end, where that came while the channel was open.
    changed
        Set at the next event, and then replaced: take it before looking, wait for it after.
    followed
        Whether somebody has asked for the job by its id.
    """

    def __init__(self) -> None:
        self.progress: Progress | None = None
        self.over = asyncio.Event()
        self.ended: Job | None = None
        self.changed = asyncio.Event()
        self.followed = False
        self._events: deque[JobEvent] = deque(maxlen=_REMEMBERED_EVENTS)
        self._looked_at = float("-inf")

    def report(self, progress: Progress) -> None:
        """Tell of progress."""
        self.progress = progress
        self._publish(JobEvent(self._next_id(time.time()), "progress", progress.as_json()))

    def end(self, job: Job) -> None:
        """Tell of the end; nothing is told after it."""
        self.ended = job
        self._tell_end(job)

    def catch_up(self, job: JobSummary) -> None:
        """Tell of the end of a job of which nothing was told here, or no more than progress."""
        if not self._events:
            final = end_event(job)
            self._events.append(JobEvent(final.id - 1, "progress", job.progress.as_json()))
        self._tell_end(job)

    def _tell_end(self, job: JobSummary) -> None:
        if not self.over.is_set():
            self.over.set()
            final = end_event(job)
            self._publish(replace(final, id=max(final.id, self._next_id(0.0))))

    def has_told_all(self, after: int) -> bool:
        """Say whether the end was told, in an event of that id."""
        return self.over.is_set() and self._events[-1].id == after

    def since(self, after: int, *, newest: bool = False) -> Iterator[JobEvent]:
        """Return the remembered events with a larger id; all, if the id is larger than that of every one.

        Parameters
        ----------
        after
            The id.
        newest
            Of several progresses only the newest.
        """
        known = bool(self._events) and after <= self._events[-1].id
        later = [event for event in self._events if not known or event.id > after]
        if newest:
            later = later[-2:] if self.over.is_set() else later[-1:]
        return iter(later)

    def is_due(self, interval_s: float) -> bool:
        """Say whether the table was not looked at for so long, or not since :meth:`ring`; it is then now."""
        due = time.monotonic() - self._looked_at >= interval_s
        if due:
            self._looked_at = time.monotonic()
        return due

    def ring(self) -> None:
        """Wake everybody who waits, to look again."""
        self._looked_at = float("-inf")
        self._wake()

    def _wake(self) -> None:
        self.changed.set()
        self.changed = asyncio.Event()

    def _next_id(self, now: float) -> int:
        return max(_id(now), self._events[-1].id + 1 if self._events else 0)

    def _publish(self, event: JobEvent) -> None:
        self._events.append(event)
        self._wake()


class Channels:
    """The channels of the jobs that run, and of those that somebody listens to: kept by whoever has one.

    Who comes after the end finds the job in the table, and nothing is held in memory for it.
    """

    def __init__(self) -> None:
        self._known: WeakValueDictionary[str, Channel] = WeakValueDictionary()

    def open(self, job_id: str) -> Channel:
        """Return a job's channel, a new one if nobody has it."""
        channel = self._known.get(job_id)
        if channel is None:
            channel = self._known[job_id] = Channel()
        return channel

    def follow(self, job_id: str) -> None:
        """Take note that somebody has asked for a job by its id."""
        channel = self._known.get(job_id)
        if channel is not None:
            channel.followed = True

    def end(self, job: Job) -> None:
        """Tell a job's end to those who listen."""
        channel = self._known.get(job.id)
        if channel is not None:
            channel.end(job)

    def look_again(self, job_id: str) -> None:
        """Wake those who wait for a job of which something happened elsewhere."""
        channel = self._known.get(job_id)
        if channel is not None:
            channel.ring()

    def ring(self) -> None:
        """Wake everybody who waits on any channel, to look again."""
        for channel in list(self._known.values()):
            channel.ring()


def end_event(job: JobSummary) -> JobEvent:
    """Return the last event of a finished job; its id is that of a moment after the last progress."""
    finished = job.finished_at.timestamp() if job.finished_at is not None else 0.0
    return JobEvent(_id(finished) + 1, "end", {**job.progress.as_json(), "status": job.status.value})


async def rung(bell: asyncio.Event, timeout_s: float | None) -> None:
    """Wait for a bell, at most so long; None: without a limit."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(timeout_s):
            await bell.wait()


def _id(seconds: float) -> int:
    return int(seconds * 1000)
