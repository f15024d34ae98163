"""What is done now and then: progress, heartbeats, jobs that nobody runs any more, jobs of long ago."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from app.jobs.attempts import Attempt, Attempts, Writer
from app.jobs.clock import Loop
from app.jobs.peers import Peers
from app.jobs.store import JobStore

if TYPE_CHECKING:
    from app.jobs.dispatcher import Dispatcher

_SAVE_INTERVAL_S = 1.0
_LOOK_INTERVAL_S = 15.0
_EXPIRE_INTERVAL_S, _EXPIRED_AT_ONCE = 600.0, 50
_AGAIN_S = 1.0

_log = logging.getLogger(__name__)


class Maintenance:
    """Keeps the job table in order while the service works, and brings what is known here of it in order.

    Parameters
    ----------
    store, writer
        The job table, and its writer.
    attempts
        The attempts that run here.
    peers
        The other services.
    dispatcher
        Told of what is found.
    retention_s
        How long ended jobs are kept; None: for ever.

    Attributes
    ----------
    unsettled
        Attempts whose end could not be stored.
    loops
        Do it, each a chore of its own. What fails is tried again soon, and keeps no other from being done:
        without heartbeats the others would take this service for dead.
    """

    def __init__(
        self,
        store: JobStore,
        writer: Writer,
        attempts: Attempts,
        peers: Peers,
        dispatcher: Dispatcher,
        retention_s: float | None,
    ) -> None:
        self._store, self._writer = store, writer
        self._attempts, self._peers, self._dispatcher = attempts, peers, dispatcher
        self._retention_s = retention_s
        self.unsettled: list[Attempt] = []
        chores = self._save_progress, self.recover, self._beat, self._expire
        self.loops = [Loop(chore, "the job table could not be kept in order", _AGAIN_S) for chore in chores]

    async def _save_progress(self) -> float:
        unsaved = [attempt for attempt in self._attempts if attempt.unsaved]
        for attempt in unsaved:
            attempt.unsaved = False
        if unsaved:
            items = [(each.job.id, each.job.attempt, each.progress) for each in unsaved]
            await self._writer.write(self._store.save_progress, items)
        return _SAVE_INTERVAL_S

    async def recover(self) -> float:
        """Put back the jobs whose end could not be stored, and those of other processes that have died."""
        while self.unsettled:
            attempt = self.unsettled[0]
            ended = attempt.job.id, attempt.job.attempt, "its end could not be stored", attempt.progress
            job = await self._writer.write(self._store.mark_crashed, *ended)
            self.unsettled.pop(0)
            if job is not None:
                self._dispatcher.moved(job)
        for job in await self._writer.write(self._store.recover, self._peers.is_alive):
            about = {"job_id": job.id, "status": job.status.value}
            _log.warning("a job was left behind by an earlier process", extra=about)
            self._dispatcher.moved(job)
        self._dispatcher.look()
        return min(_LOOK_INTERVAL_S, self._peers.lease_s)

    async def _beat(self) -> float | None:
        """Show that this service lives, and bring what runs here and what the table says of it together.

        They differ where a connection was cut in the midst of a commit, of which nobody knows then whether
        it was made, and where this service was taken for dead.
        """
        if self._peers.beat_s is None:
            return None
        before = list(self._attempts)
        owned = await self._writer.write(self._peers.beat)
        for attempt in before:
            mine = owned.get(attempt.job.id)
            if attempt not in self._attempts:
                continue
            if mine is None or mine.attempt != attempt.job.attempt:
                _log.warning("a job was taken from this service", extra={"job_id": attempt.job.id})
                attempt.kill("gone")
            elif mine.cancel_requested:
                attempt.stop()
        known = {each.job.id for each in (*before, *self._attempts, *self.unsettled)}
        for job_id in owned.keys() - known:
            # It was taken in a commit of which this service never learned.
            job = await self._writer.write(self._store.requeue, job_id, owned[job_id].attempt, None)
            if job is not None:
                self._dispatcher.moved(job)
        return self._peers.beat_s

    async def _expire(self) -> float | None:
        """Delete some of the ended jobs that are too old; if there may be more, others write in between."""
        if self._retention_s is None:
            return None
        before = self._store.clock.now() - self._retention_s
        gone = await self._writer.write(self._store.expire, before, _EXPIRED_AT_ONCE)
        if gone:
            _log.info("jobs of long ago were deleted", extra={"jobs": gone})
        return 0.0 if gone == _EXPIRED_AT_ONCE else _EXPIRE_INTERVAL_S
