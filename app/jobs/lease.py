"""Who is alive among the services that share a database: each shows itself, by the database's clock.

An owner that was not seen for a lease is dead, and its jobs are given back. If it lives on after all (it was
suspended, or cut off), nothing is finished twice: its attempts are outdated from then on.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import sqlalchemy as sa

from app.jobs.model import JobStatus
from app.jobs.reading import Database
from app.jobs.tables import DATABASE_NOW, jobs, owners

_SHOWS_A_LEASE = 5
_FORGOTTEN_LEASES = 1000


@dataclass(frozen=True, slots=True)
class Held:
    """A job that this owner runs, as the table has it."""

    attempt: int
    cancel_requested: bool


class Lease:
    """An owner's entry among the living; its methods block.

    Parameters
    ----------
    database
        A PostgreSQL database.
    owner
        This service.
    lease_s
        How long after it was seen last an owner counts as alive, in seconds.
    clock
        Seconds that pass here, by which this owner knows for how long it could not show itself.
    """

    def __init__(
        self,
        database: Database,
        owner: str,
        lease_s: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock = clock
        self._database = database
        self._owner = owner
        self._lease_s = lease_s
        self._shown = float("-inf")
        self._judges_from = float("inf")

    @property
    def pause_s(self) -> float:
        """Seconds between two signs of life."""
        return self._lease_s / _SHOWS_A_LEASE

    def show(self) -> dict[str, Held]:
        """Give a sign of life, and return the jobs that the table says this owner runs, by their id.

        After a time in which it could not, the others could not either: nobody is judged until all who live
        have had the time of a lease to show themselves.
        """
        begun = self._clock()
        with self._database.write() as connection:
            seen = connection.execute(
                sa.update(owners).where(owners.c.owner == self._owner).values(seen_at=DATABASE_NOW)
            )
            if not seen.rowcount:
                connection.execute(sa.insert(owners).values(owner=self._owner, seen_at=DATABASE_NOW))
            rows = connection.execute(
                sa.select(jobs.c.id, jobs.c.attempt, jobs.c.cancel_requested).where(
                    jobs.c.status == JobStatus.RUNNING, jobs.c.owner == self._owner
                )
            ).all()
        if begun - self._shown > self._lease_s / 2:
            self._judges_from = begun + self._lease_s
        self._shown = begun
        return {row.id: Held(row.attempt, row.cancel_requested) for row in rows}

    def is_alive(self, owner: str) -> bool:
        """Say whether an owner was seen within the lease; yes as long as this one must not judge."""
        if owner == self._owner or self._clock() < self._judges_from:
            return True
        with self._database.read() as connection:
            age = connection.scalar(sa.select(DATABASE_NOW - owners.c.seen_at).where(owners.c.owner == owner))
        return age is not None and age <= self._lease_s

    def end(self) -> None:
        """Remove this owner, and those that died so long ago that no job can be theirs."""
        with self._database.write() as connection:
            forgotten = owners.c.seen_at < DATABASE_NOW - _FORGOTTEN_LEASES * self._lease_s
            connection.execute(sa.delete(owners).where(sa.or_(owners.c.owner == self._owner, forgotten)))
