"""Looking at the job table: one job, a page of them, what they left, how many wait and how long they ran."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

import sqlalchemy as sa
from sqlalchemy import Connection

from app.jobs.errors import InvalidCursor
from app.jobs.model import Job, JobPage, JobStatus, Lane
from app.jobs.tables import artifacts, jobs
from app.jobs.transitions import find, job_of, select_jobs


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

    Attributes
    ----------
    database
        The same.
    """

    def __init__(self, database: Database) -> None:
        self.database = self._database = database

    def get(self, job_id: str) -> Job:
        """Return a job.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        with self._database.read() as connection:
            return job_of(find(connection, job_id))

    def page(self, limit: int, cursor: str | None) -> JobPage:
        """Return jobs, newest first, after the cursor; new jobs do not shift the pages that follow.

        Raises
        ------
        InvalidCursor
            If no page gave out such a cursor.
        """
        statement = select_jobs.order_by(jobs.c.number.desc()).limit(limit + 1)
        if cursor is not None:
            if not (cursor.isascii() and cursor.isdigit() and len(cursor) <= 18):
                raise InvalidCursor(cursor)
            statement = statement.where(jobs.c.number < int(cursor))
        with self._database.read() as connection:
            rows = connection.execute(statement).mappings().all()
        more = len(rows) > limit
        rows = rows[:limit]
        return JobPage(tuple(job_of(row) for row in rows), str(rows[-1]["number"]) if more else None)

    def artifact(self, job_id: str) -> bytes | None:
        """Return the bytes that a job left behind; None if it left none.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        with self._database.read() as connection:
            find(connection, job_id)
            data: bytes | None = connection.scalar(
                sa.select(artifacts.c.data).where(artifacts.c.job_id == job_id)
            )
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
        """Return id, kind and deadline (seconds since 1970) of the waiting jobs that have one."""
        with self._database.read() as connection:
            rows = connection.execute(
                sa.select(jobs.c.id, jobs.c.kind, jobs.c.deadline).where(
                    jobs.c.status == JobStatus.QUEUED, jobs.c.deadline.is_not(None)
                )
            )
            return [(row.id, row.kind, row.deadline) for row in rows]

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
