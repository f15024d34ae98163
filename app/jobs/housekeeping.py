"""What is done now and then: progress is stored, jobs that nobody runs are looked for, old ones deleted."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable

from app.jobs.channel import rung
from app.jobs.run import Runs
from app.jobs.store import JobStore
from app.jobs.writer import Writer

_TICK_S = 0.25
_SAVE_INTERVAL_S = 1.0
_LOOK_INTERVAL_S = 15.0
_EXPIRE_INTERVAL_S, _EXPIRED_AT_ONCE = 600.0, 50

_log = logging.getLogger(__name__)


class Housekeeping:
    """Keeps the job table in order while the service works.

    Parameters
    ----------
    store, writer
        The job table, and its writer.
    runs
        The jobs that run here.
    look_after
        Called now and then, to give back jobs that nobody runs any more.
    retention_s
        How long ended jobs are kept; None: for ever.
    """

    def __init__(
        self,
        store: JobStore,
        writer: Writer,
        runs: Runs,
        look_after: Callable[[], Awaitable[None]],
        retention_s: float | None,
    ) -> None:
        self._store = store
        self._writer = writer
        self._runs = runs
        self._look_after = look_after
        self._retention_s = retention_s
        self._ended = asyncio.Event()

    def end(self) -> None:
        """Make :meth:`keep` return after what it is at."""
        self._ended.set()

    async def keep(self) -> None:
        """Keep house until the end; what fails is tried again at its next time."""
        looked, expired = time.monotonic(), float("-inf")
        while not self._ended.is_set():
            await rung(self._ended, _TICK_S)
            try:
                await self._save_progress()
                if time.monotonic() - looked >= _LOOK_INTERVAL_S:
                    looked = time.monotonic()
                    await self._look_after()
                if time.monotonic() - expired >= _EXPIRE_INTERVAL_S:
                    await self._expire()
                    expired = time.monotonic()
            except Exception:
                _log.exception("housekeeping failed; there will be another try")

    async def _save_progress(self) -> None:
        now = time.monotonic()
        due = [run for run in self._runs if run.unsaved and now - run.saved_at >= _SAVE_INTERVAL_S]
        if not due:
            return
        for run in due:
            run.unsaved, run.saved_at = False, now
        await self._writer.write(
            self._store.save_progress, [(run.job.id, run.job.attempt, run.progress) for run in due]
        )

    async def _expire(self) -> None:
        """Delete ended jobs that are too old, some at a time, so that nobody waits long to write."""
        if self._retention_s is None:
            return
        before, gone, last = self._store.clock.now() - self._retention_s, 0, _EXPIRED_AT_ONCE
        while last == _EXPIRED_AT_ONCE and not self._ended.is_set():
            last = await self._writer.write(self._store.expire, before, _EXPIRED_AT_ONCE)
            gone += last
        if gone:
            _log.info("jobs of long ago were deleted", extra={"jobs": gone})
