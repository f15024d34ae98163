"""What happens to a job, told to everybody in this process who listens."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from weakref import WeakValueDictionary

from app.jobs.model import Job, JobEvent, Progress

# A progress supersedes those before it: a listener that is further behind misses nothing that still holds.
# Each may have a plan in it, of a thousand UAVs too.
_REMEMBERED_EVENTS = 32


class Channel:
    """The events of one job, and a bell that rings at each.

    Attributes
    ----------
    progress
        The newest; None if none was reported since the service started.
    ended
        The job at its end.
    changed
        Set at the next event, and then replaced: take it before looking, wait for it after.
    """

    def __init__(self) -> None:
        self.progress: Progress | None = None
        self.ended: Job | None = None
        self.changed = asyncio.Event()
        self._events: deque[JobEvent] = deque(maxlen=_REMEMBERED_EVENTS)

    def report(self, progress: Progress) -> None:
        """Tell of progress."""
        self.progress = progress
        self._publish(JobEvent(self._next_id(time.time()), "progress", progress.as_json()))

    def end(self, job: Job) -> None:
        """Tell of the end; nothing is told after it."""
        if self.ended is None:
            self.ended = job
            final = end_event(job)
            self._publish(replace(final, id=max(final.id, self._next_id(0.0))))

    def catch_up(self, job: Job) -> None:
        """Tell of the end of a job of which nothing was told here, or no more than progress."""
        if self.ended is None and not self._events:
            final = end_event(job)
            self._events.append(JobEvent(final.id - 1, "progress", job.progress.as_json()))
        self.end(job)

    def since(self, after: int) -> Iterator[JobEvent]:
        """Return the remembered events with a larger id."""
        return iter([event for event in self._events if event.id > after])

    def ring(self) -> None:
        """Wake everybody who waits, to look again."""
        self.changed.set()
        self.changed = asyncio.Event()

    def _next_id(self, now: float) -> int:
        return max(_id(now), self._events[-1].id + 1 if self._events else 0)

    def _publish(self, event: JobEvent) -> None:
        self._events.append(event)
        self.ring()


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


def end_event(job: Job) -> JobEvent:
    """Return the last event of a finished job; its id is that of a moment after the last progress."""
    finished = job.finished_at.timestamp() if job.finished_at is not None else 0.0
    return JobEvent(_id(finished) + 1, "end", {**job.progress.as_json(), "status": job.status.value})


async def rung(bell: asyncio.Event, timeout_s: float) -> None:
    """Wait for a bell, at most so long."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(timeout_s):
            await bell.wait()


def _id(seconds: float) -> int:
    return int(seconds * 1000)
