"""The other services on a job table: each shows that it lives, and they tell each other what happens.

On SQLite there are none. On PostgreSQL what is told is only a hint to look, and may get lost: waiting jobs
and dead owners are looked for once a lease, cancellations with every heartbeat, and those who wait for a job
look at the table now and then. With every heartbeat, on SQLite too, a service compares what runs in it with
what the table says of that.

An owner that was not seen for a lease, by the database's clock, is dead, and its jobs are given back. If it
lives on after all (it was suspended, or cut off), nothing is finished twice: its attempts are outdated from
then on.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import Callable
from typing import Literal

import sqlalchemy as sa

from app.jobs.attempts import Writer
from app.jobs.model import JobStatus
from app.jobs.store import JobStore
from app.jobs.tables import DATABASE_NOW, Announcements, jobs, owners

_CHANNEL = "allocator_jobs"
_BEATS_A_LEASE = 5
_FORGOTTEN_LEASES = 1000

News = Literal["waiting", "ended", "cancelled"]
"""A job waits, in a lane; a job has ended; a job, which another service runs, should stop."""

Hear = Callable[[str, str], None]
"""Gets what is heard and of which lane or job; two empty strings where something may have been missed."""


class Peers:
    """The services that share a database with this one.

    Parameters
    ----------
    store
        The job table; its owner is this service.
    lease_s
        How long after it was seen last an owner counts as alive, in seconds.
    clock
        Seconds that pass here, by which this owner knows for how long it could not show itself.

    Attributes
    ----------
    lease_s
        The same; infinite where there can be no others.
    beat_s
        Seconds between two heartbeats.
    """

    def __init__(self, store: JobStore, lease_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._store, self._owner, self._clock = store, store.owner, clock
        self._shared = store.database.shared
        self.lease_s = lease_s if self._shared else math.inf
        self.beat_s = lease_s / _BEATS_A_LEASE
        self._announcements: Announcements | None = None
        self._beaten = float("-inf")
        self._judges_from = float("inf")

    async def join(self, writer: Writer, hear: Hear) -> None:
        """Show this service among the living, and begin to listen, before the first job is taken.

        What is told is given to ``hear`` on the event loop.
        """
        if not self._shared:
            return
        await writer.write_with_retry(self.beat)
        loop = asyncio.get_running_loop()

        def heard(message: str | None) -> None:
            what, _, of = (message or "").partition(" ")
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(hear, what, of)

        self._announcements = await asyncio.to_thread(self._store.database.announcements, _CHANNEL, heard)

    async def leave(self, writer: Writer) -> None:
        """Say nothing any more, and be forgotten, after the last job was settled or put back."""
        if self._announcements is not None:
            await asyncio.to_thread(self._announcements.close)
            # The server may be gone: the others will see that this one is.
            with contextlib.suppress(Exception):
                await writer.write(self.forget)

    def beat(self) -> dict[str, tuple[int, bool]]:
        """Show that this service lives, and return which jobs the table says it runs. Blocks.

        Where there can be no others, nothing is written.

        After a time in which it could not, the others could not either: no service counts as dead until all
        that live have had the time of a lease to show themselves.

        Returns
        -------
        dict
            Of each job by its id the attempt, and whether it is to be cancelled.
        """
        begun = self._clock()
        me, mine = owners.c.owner == self._owner, jobs.c.owner == self._owner
        running = sa.select(jobs.c.id, jobs.c.attempt, jobs.c.cancel_requested)
        seen = sa.update(owners).where(me).values(seen_at=DATABASE_NOW)
        database = self._store.database
        with database.write() if self._shared else database.read() as connection:
            if self._shared and not connection.execute(seen).rowcount:
                connection.execute(sa.insert(owners).values(owner=self._owner, seen_at=DATABASE_NOW))
            rows = connection.execute(running.where(mine, jobs.c.status == JobStatus.RUNNING)).all()
        self._store.follow_database()
        if begun - self._beaten > self.lease_s / 2:
            self._judges_from = begun + self.lease_s
        self._beaten = begun
        return {row.id: (row.attempt, row.cancel_requested) for row in rows}

    def is_alive(self, owner: str) -> bool:
        """Say whether an owner can still finish its jobs: it was seen within the lease. Blocks.

        Yes, as long as this one must not judge. Where there can be no others, all but this one have ended,
        or the database would be occupied.
        """
        if owner == self._owner or not self._shared:
            return owner == self._owner
        if self._clock() < self._judges_from:
            return True
        age = sa.select(DATABASE_NOW - owners.c.seen_at).where(owners.c.owner == owner)
        with self._store.database.read() as connection:
            seen_before_s = connection.scalar(age)
        return seen_before_s is not None and seen_before_s <= self.lease_s

    def forget(self) -> None:
        """Remove this owner, and those that died so long ago that no job can be theirs. Blocks."""
        forgotten = owners.c.seen_at < DATABASE_NOW - _FORGOTTEN_LEASES * self.lease_s
        with self._store.database.write() as connection:
            connection.execute(sa.delete(owners).where(sa.or_(owners.c.owner == self._owner, forgotten)))

    def tell(self, what: News, of: str) -> None:
        """Tell the others."""
        if self._announcements is not None:
            self._announcements.tell(f"{what} {of}")
