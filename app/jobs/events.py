"""What happens to jobs, told to everybody in this process who listens: remembered events, then new ones."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterator
from dataclasses import replace
from weakref import WeakValueDictionary

from app.jobs.clock import wait_for
from app.jobs.model import Job, JobEvent, JobStatus, JobSummary, Progress
from app.jobs.store import JobStore
from app.jobs.worker import REPORT_INTERVAL_S

# A progress supersedes those before it: a listener that is further behind misses nothing that still holds.
# Each may have a plan in it, of a thousand UAVs too.
_REMEMBERED_EVENTS = 32
# Where its progress is not announced, because it runs in another process, a job is looked up as often as that
# is stored, once for all who listen.
_LOOK_FOR_PROGRESS_S = 1.0
# One who may lose the right to listen is asked at least as often.
_ASK_AGAIN_S = 5.0
# Progress that is sent to all listeners together, a second: with more of them, each gets it less often.
_SENT_A_SECOND, _LONGEST_BETWEEN_S = 200.0, 2.0


class JobEvents:
    """The events of one job.

    Attributes
    ----------
    progress
        The newest; None if none was reported since the service started.
    over
        Set when the end was told.
    ended
        The job at its end, where that came while somebody listened.
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
        self._publish(JobEvent(self._next_id(_id(time.time())), "progress", progress.as_json()))

    def end(self, job: JobSummary) -> None:
        """Tell of the end; nothing is told after it."""
        if isinstance(job, Job):
            self.ended = job
        elif not self._events:
            # Nothing was told here of a job that ended earlier, or elsewhere.
            self._events.append(JobEvent(end_event(job).id - 1, "progress", job.progress.as_json()))
        if not self.over.is_set():
            self.over.set()
            final = end_event(job)
            self._publish(replace(final, id=self._next_id(final.id)))

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
        """Say whether the table was not looked at for so long, or since :meth:`notify`; it is then now."""
        due = time.monotonic() - self._looked_at >= interval_s
        if due:
            self._looked_at = time.monotonic()
        return due

    def notify(self) -> None:
        """Wake everybody who waits, to look at the table again."""
        self._looked_at = float("-inf")
        self._wake()

    def _wake(self) -> None:
        self.changed.set()
        self.changed = asyncio.Event()

    def _next_id(self, at_least: int) -> int:
        return max(at_least, self._events[-1].id + 1 if self._events else 0)

    def _publish(self, event: JobEvent) -> None:
        self._events.append(event)
        self._wake()


class EventStreams:
    """The events of the jobs that run, and of those with listeners, as long as something refers to them.

    One who comes after the end finds the job in the table, and nothing is held in memory for it.

    Parameters
    ----------
    store
        The job table.
    runs
        Says whether a job runs here; all that happens to it is then told.

    Attributes
    ----------
    listeners
        How many streams are open.
    """

    def __init__(self, store: JobStore, runs: Callable[[str], bool]) -> None:
        self._store, self._runs, self._shared = store, runs, store.database.shared
        self._known: WeakValueDictionary[str, JobEvents] = WeakValueDictionary()
        self.listeners = 0
        self._stopped = False

    def open(self, job_id: str) -> JobEvents:
        """Return a job's events, new ones if nobody has them."""
        return self._known.setdefault(job_id, JobEvents())

    def known(self, job_id: str) -> JobEvents | None:
        """Return a job's events if somebody has them."""
        return self._known.get(job_id)

    def notify(self) -> None:
        """Wake everybody who waits for any job, to look again."""
        for events in list(self._known.values()):
            events.notify()

    def stop(self) -> None:
        """End all streams."""
        self._stopped = True
        self.notify()

    async def listen(
        self, job_id: str, after: int = 0, allowed: Callable[[], Awaitable[bool]] | None = None
    ) -> AsyncGenerator[JobEvent]:
        """Yield a job's events with ids larger than ``after``: what is remembered, then what happens.

        An id that is larger than those of all events counts as none. Of many listeners each gets the progress
        less often, and only the newest. Ends after the ``"end"`` event, or at :meth:`stop`.

        Parameters
        ----------
        job_id
            The job.
        after
            Id of the last event that was seen; 0: none.
        allowed
            Asked before every event, and now and then, whether the listener still may have it; None: yes.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        events = self.open(job_id)
        events.followed = True
        looked = False
        self.listeners += 1
        try:
            while True:
                changed, pause_s = events.changed, None if allowed is None else _ASK_AGAIN_S
                if not events.over.is_set() and not self._runs(job_id):
                    if self._shared:
                        pause_s = _LOOK_FOR_PROGRESS_S
                    if not looked or (self._shared and events.is_due(_LOOK_FOR_PROGRESS_S)):
                        looked = True
                        await self.catch_up(job_id, events)
                if allowed is not None and not await allowed():
                    return
                over = events.over.is_set()
                crowded_s = min(self.listeners / _SENT_A_SECOND, _LONGEST_BETWEEN_S)
                crowded = crowded_s > REPORT_INTERVAL_S
                for event in events.since(after, newest=crowded):
                    after = event.id
                    yield event
                if over or self._stopped:
                    return
                await wait_for(changed, pause_s)
                if crowded:
                    await wait_for(events.over, crowded_s)
        finally:
            self.listeners -= 1

    async def catch_up(self, job_id: str, events: JobEvents) -> None:
        """Tell those who listen what the table says of a job that does not run here.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        job = await asyncio.to_thread(self._store.look, job_id)
        # While that was read, it may have begun to run here, or what is read may be of before.
        if not events.over.is_set() and not self._runs(job_id):
            if job.status.finished:
                events.end(job)
            elif job.status is JobStatus.RUNNING and job.progress != events.progress:
                events.report(job.progress)

    def has_told_all(self, job: JobSummary, after: int) -> bool:
        """Say whether a job has ended, and ``after`` is the id of its last event."""
        return job.status.finished and (after == end_event(job).id or self.open(job.id).has_told_all(after))


def end_event(job: JobSummary) -> JobEvent:
    """Return the last event of a finished job; its id is that of a moment after the last progress."""
    finished = job.finished_at.timestamp() if job.finished_at is not None else 0.0
    return JobEvent(_id(finished) + 1, "end", {**job.progress.as_json(), "status": job.status.value})


def _id(seconds: float) -> int:
    return int(seconds * 1000)
