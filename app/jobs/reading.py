"""Looking at the job table: one job, a page of them, what they left, how many wait and how long they ran."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

import sqlalchemy as sa
from sqlalchemy import Connection

from app.jobs.clock import Clock
from app.jobs.errors import InvalidCursor, JobNotFound
from app.jobs.model import Job, JobPage, JobStatus, JobSummary, Lane
from app.jobs.tables import DATABASE_NOW, artifacts, jobs
from app.jobs.transitions import find, job_of, select_small, select_summaries, summary_of


class Announcements(Protocol):
    """Short messages between the services that share a database; one may get lost."""

    def tell(self, message: str) -> None:
        """Send a message soon; never blocks."""

    def close(self) -> None:
        """End; what was told is sent if that is possible."""


class Database(Protocol):
    """What the jobs room needs of a database."""

    shared: bool
    """Whether several services may work on it; otherwise transactions that write take turns."""

    def occupy(self) -> None:
        """Keep other services off, where it is not shared."""

    def vacate(self) -> None:
        """Let another service have it."""

    def write(self) -> AbstractContextManager[Connection]:
        """Open a write transaction, committed at its end and rolled back by an exception."""

    def read(self) -> AbstractContextManager[Connection]:
        """Open a read transaction."""

    def migrate(self, script_location: Path, version_table: str) -> None:
        """Bring the tables of an Alembic folder to its newest version."""

    def take_turn(self, connection: Connection, name: str) -> None:
        """Let the transactions that call this with one name follow one another."""

    def announcements(self, channel: str, heard: Callable[[str | None], None]) -> Announcements:
        """Open a channel; ``heard`` is called in a thread, with None if messages may have been lost."""


class JobReader:
    """Reads the job table; nothing here changes it, or waits for one who does.

    Parameters
    ----------
    database
        Where the tables are.
    clock
        Of the service.

    Attributes
    ----------
    database, clock
        The same.
    """

    def __init__(self, database: Database, clock: Clock) -> None:
        self.database = self._database = database
        self.clock = clock

    def _now(self, connection: Connection) -> float:
        """Return the time by the clock that all who write to the table share, in seconds since 1970."""
        if not self._database.shared:
            return self.clock.now()
        return float(connection.execute(sa.select(DATABASE_NOW)).scalar_one())

    def _ahead(self, connection: Connection) -> float:
        """Return how many seconds the service's clock is ahead of the one that the table's times are by."""
        return self.clock.now() - self._now(connection) if self._database.shared else 0.0

    def get(self, job_id: str) -> Job:
        """Return a job.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        with self._database.read() as connection:
            return job_of(find(connection, job_id))

    def look(self, job_id: str) -> JobSummary:
        """Return a job without its payload and result.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        with self._database.read() as connection:
            row = connection.execute(select_summaries.where(jobs.c.id == job_id)).mappings().first()
        if row is None:
            raise JobNotFound(job_id)
        return summary_of(row)

    def result_text(self, job_id: str) -> str | None:
        """Return a job's result as JSON, as it is stored; None without one."""
        with self._database.read() as connection:
            text: str | None = connection.scalar(
                sa.select(sa.cast(jobs.c.result, sa.Text)).where(jobs.c.id == job_id)
            )
            return text

    def page(self, limit: int, cursor: str | None, status: JobStatus | None = None) -> JobPage:
        """Return jobs, newest first, after the cursor; new jobs do not shift the pages that follow.

        Parameters
        ----------
        limit
            How many at most.
        cursor
            Of the page before; None for the first.
        status
            Only the jobs of that status; None: all.

        Raises
        ------
        InvalidCursor
            If no page gave out such a cursor.
        """
        statement = select_small.order_by(jobs.c.number.desc()).limit(limit + 1)
        if status is not None:
            statement = statement.where(jobs.c.status == status)
        if cursor is not None:
            if not (cursor.isascii() and cursor.isdigit() and len(cursor) <= 18):
                raise InvalidCursor(cursor)
            statement = statement.where(jobs.c.number < int(cursor))
        with self._database.read() as connection:
            rows = connection.execute(statement).mappings().all()
        more = len(rows) > limit
        rows = rows[:limit]
        return JobPage(tuple(summary_of(row) for row in rows), str(rows[-1]["number"]) if more else None)

    def artifact(self, job_id: str) -> bytes | None:
        """Return the bytes that a job left behind; None if it left none.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        left = sa.select(jobs.c.id, artifacts.c.data).outerjoin(artifacts, artifacts.c.job_id == jobs.c.id)
        with self._database.read() as connection:
            row = connection.execute(left.where(jobs.c.id == job_id)).first()
        if row is None:
            raise JobNotFound(job_id)
        data: bytes | None = row.data
        return data

    def waiting(self) -> dict[Lane, int]:
        """Return how many jobs wait in each lane that has any."""
        with self._database.read() as connection:
            rows = connection.execute(
                sa.select(jobs.c.lane, sa.func.count().label("jobs"))
                .where(jobs.c.status == JobStatus.QUEUED)
                .group_by(jobs.c.lane)
            )
            return {row.lane: row.jobs for row in rows}

    def deadlines(self) -> list[tuple[str, str, float]]:
        """Return id, kind and deadline (by the service's clock) of the waiting jobs that have one."""
        with self._database.read() as connection:
            ahead = self._ahead(connection)
            rows = connection.execute(
                sa.select(jobs.c.id, jobs.c.kind, jobs.c.deadline).where(
                    jobs.c.status == JobStatus.QUEUED, jobs.c.deadline.is_not(None)
                )
            )
            return [(row.id, row.kind, row.deadline + ahead) for row in rows]

    def recent_durations(self, lane: Lane, limit: int) -> list[float]:
        """Return how long the newest succeeded jobs of a lane ran, in seconds, oldest first."""
        with self._database.read() as connection:
            rows = connection.execute(
                sa.select(jobs.c.finished_at - jobs.c.started_at)
                .where(jobs.c.status == JobStatus.SUCCEEDED, jobs.c.lane == lane)
                .order_by(jobs.c.number.desc())
                .limit(limit)
            )
            return [float(seconds) for (seconds,) in rows][::-1]
