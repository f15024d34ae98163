"""Listening to jobs: what is remembered of each, then what happens, to many listeners at once."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable

from app.jobs.channel import Channel, Channels, end_event, rung
from app.jobs.dispatcher import Dispatcher
from app.jobs.model import JobEvent, JobStatus, JobSummary
from app.jobs.store import JobStore
from app.jobs.worker import REPORT_INTERVAL_S

# Where its progress is not announced, because it runs in another process, a job is looked up as often as that
# is stored, once for all who listen.
_LOOK_FOR_PROGRESS_S = 1.0
# One who may lose the right to listen is asked at least as often.
_ASK_AGAIN_S = 5.0
# Progress that is sent to all listeners together, a second: with more of them, each gets it less often.
_SENT_A_SECOND, _LONGEST_BETWEEN_S = 200.0, 2.0


class Listening:
    """The event streams.

    Parameters
    ----------
    store
        The job table.
    dispatcher
        Knows what runs here.
    channels
        Of the jobs that run, and those that somebody listens to.
    """

    def __init__(self, store: JobStore, dispatcher: Dispatcher, channels: Channels) -> None:
        self._store, self._dispatcher, self._channels = store, dispatcher, channels
        self._shared = store.database.shared
        self._listeners = 0
        self._ended = False

    def end(self) -> None:
        """End all streams."""
        self._ended = True
        self._channels.ring()

    async def events(
        self, job_id: str, after: int = 0, allowed: Callable[[], Awaitable[bool]] | None = None
    ) -> AsyncGenerator[JobEvent]:
        """Yield a job's events with ids larger than ``after``: what is remembered, then what happens.

        An id that is larger than those of all events counts as none. Of many listeners each gets the progress
        less often, and only the newest. Ends after the ``"end"`` event, or at :meth:`end`.

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
        channel = self._channels.open(job_id)
        channel.followed = True
        looked = False
        self._listeners += 1
        try:
            while True:
                bell, pause_s = channel.changed, None if allowed is None else _ASK_AGAIN_S
                if not channel.over.is_set() and not self._dispatcher.runs(job_id):
                    if self._shared:
                        pause_s = _LOOK_FOR_PROGRESS_S
                    if not looked or (self._shared and channel.is_due(_LOOK_FOR_PROGRESS_S)):
                        looked = True
                        await self._catch_up(job_id, channel)
                if allowed is not None and not await allowed():
                    return
                over = channel.over.is_set()
                crowded_s = min(self._listeners / _SENT_A_SECOND, _LONGEST_BETWEEN_S)
                crowded = crowded_s > REPORT_INTERVAL_S
                for event in channel.since(after, newest=crowded):
                    after = event.id
                    yield event
                if over or self._ended:
                    return
                await rung(bell, pause_s)
                if crowded:
                    await rung(channel.over, crowded_s)
        finally:
            self._listeners -= 1

    async def _catch_up(self, job_id: str, channel: Channel) -> None:
        """Tell those who listen what the table says of a job that does not run here."""
        job = await asyncio.to_thread(self._store.look, job_id)
        # While that was read, it may have begun to run here, or what is read may be of before.
        if not channel.over.is_set() and not self._dispatcher.runs(job_id):
            if job.status.finished:
                channel.catch_up(job)
            elif job.status is JobStatus.RUNNING and job.progress != channel.progress:
                channel.report(job.progress)

    def has_told_all(self, job: JobSummary, after: int) -> bool:
        """Say whether a job has ended, and ``after`` is the id of its last event."""
        return job.status.finished and (
            after == end_event(job).id or self._channels.open(job.id).has_told_all(after)
        )
