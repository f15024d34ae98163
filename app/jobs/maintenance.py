"""What is done now and then: progress, heartbeats, jobs that nobody runs any more, jobs of long ago."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

from app.jobs.attempts import Attempt, Attempts, Writer
from app.jobs.clock import Loop
from app.jobs.peers import NoPeers
from app.jobs.store import JobStore

if TYPE_CHECKING:
    from app.jobs.dispatcher import Dispatcher

_TICK_S = 0.25
_SAVE_INTERVAL_S = 1.0
_LOOK_INTERVAL_S = 15.0
_EXPIRE_INTERVAL_S, _EXPIRED_AT_ONCE = 600.0, 50
_AGAIN_S = 1.0
_FAILURE = "the job table could not be kept in order"

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
    loop
        Does it.
    """

    def __init__(
        self,
        store: JobStore,
        writer: Writer,
        attempts: Attempts,
        peers: NoPeers,
        dispatcher: Dispatcher,
        retention_s: float | None,
    ) -> None:
        self._store, self._writer = store, writer
        self._attempts, self._peers, self._dispatcher = attempts, peers, dispatcher
        self._retention_s = retention_s
        self.unsettled: list[Attempt] = []
        chores: dict[Callable[[], Awaitable[None]], float] = {
            self._save_progress: _TICK_S,
            self.recover: min(_LOOK_INTERVAL_S, peers.lease_s),
            self._beat: peers.beat_s,
            self._expire: math.inf if retention_s is None else _EXPIRE_INTERVAL_S,
        }
        self._every_s = {chore: every_s for chore, every_s in chores.items() if every_s < math.inf}
        self._due_at = dict.fromkeys(self._every_s, 0.0)
        self.loop = Loop(self._do_what_is_due, _FAILURE)

    async def _do_what_is_due(self) -> float:
        """Do what is due, and return the seconds until something is again.

        What fails is tried again soon, and keeps nothing else from being done: without heartbeats the others
        would take this service for dead.
        """
        for chore, every_s in self._every_s.items():
            if time.monotonic() >= self._due_at[chore] and not self.loop.ended:
                self._due_at[chore] = time.monotonic() + every_s
                try:
                    await chore()
                except Exception:
                    _log.exception("%s; there will be another try", _FAILURE)
                    self._due_at[chore] = time.monotonic() + _AGAIN_S
        return max(0.0, min(self._due_at.values()) - time.monotonic())

    async def recover(self) -> None:
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
        await self._dispatcher.look()

    async def _save_progress(self) -> None:
        now = time.monotonic()
        due = [each for each in self._attempts if each.unsaved and now - each.saved_at >= _SAVE_INTERVAL_S]
        for each in due:
            each.unsaved, each.saved_at = False, now
        if due:
            items = [(each.job.id, each.job.attempt, each.progress) for each in due]
            await self._writer.write(self._store.save_progress, items)

    async def _beat(self) -> None:
        """Show that this service lives, and bring what runs here and what the table says of it together.

        They differ where a connection was cut in the midst of a commit, of which nobody knows then whether
        it was made, and where this service was taken for dead.
        """
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
                self._dispatcher.stop_attempt(attempt)
        known = {each.job.id for each in (*before, *self._attempts, *self.unsettled)}
        for job_id in owned.keys() - known:
            # It was taken in a commit of which this service never learned.
            job = await self._writer.write(self._store.requeue, job_id, owned[job_id].attempt, None)
            if job is not None:
                self._dispatcher.moved(job)

    async def _expire(self) -> None:
        """Delete some of the ended jobs that are too old; if there may be more, heartbeats come between."""
        before = self._store.clock.now() - (self._retention_s or 0.0)
        gone = await self._writer.write(self._store.expire, before, _EXPIRED_AT_ONCE)
        if gone == _EXPIRED_AT_ONCE:
            self._due_at[self._expire] = time.monotonic()
        if gone:
            _log.info("jobs of long ago were deleted", extra={"jobs": gone})
