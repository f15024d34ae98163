"""Looking at the job table: rows as jobs, one job, a page of them, what they left, how many wait.

Nothing here changes the table, or waits for one who does.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy import Connection, RowMapping

from app.jobs.clock import Clock
from app.jobs.errors import InvalidCursor, JobNotFound
from app.jobs.model import LANES, Job, JobPage, JobStatus, JobSummary, Lane, Progress
from app.jobs.stored_json import read_later
from app.jobs.tables import Database, artifacts, jobs

_MOST_UNFINISHED = 1000
"""Results that wait to be completed, at most; one more stays as it is."""

_LEFT_ALONE_S = 60.0
"""Of another service that shares the database: its results are completed by this one after so long."""

Row = RowMapping | dict[str, Any]

is_queued = jobs.c.status == JobStatus.QUEUED
has_artifact = sa.exists().where(artifacts.c.job_id == jobs.c.id).label("has_artifact")
_TEXTS = {"payload", "result"}
# As texts, which most of those who handle a job only hand on.
whole = [
    sa.cast(column, sa.Text).label(column.name) if column.name in _TEXTS else column for column in jobs.c
]
select_jobs = sa.select(*whole, has_artifact)
# Payloads, results and plans may have a megabyte each.
_LARGE = _TEXTS | {"assignment"}
select_small = sa.select(*(column for column in jobs.c if column.name not in _LARGE), has_artifact)
select_summaries = select_small.add_columns(jobs.c.assignment)
# What is read in order to be changed is locked, where a database does not let writers take turns.
select_to_change = select_jobs.with_for_update(of=jobs)


class JobQueries:
    """Reads the job table.

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
        self.database, self.clock = database, clock

    def get(self, job_id: str) -> Job:
        """Return a job.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        return job_of(self._find(job_id, select_jobs))

    def look(self, job_id: str) -> JobSummary:
        """Return a job without its payload and result.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        return summary_of(self._find(job_id, select_summaries))

    def result_text(self, job_id: str) -> str | None:
        """Return a job's result as JSON, as it is stored; None without one."""
        statement = sa.select(sa.cast(jobs.c.result, sa.Text)).where(jobs.c.id == job_id)
        with self.database.read() as connection:
            return connection.scalar(statement)

    def artifact(self, job_id: str) -> bytes | None:
        """Return the bytes that a job left behind; None if it left none.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        left = sa.select(jobs.c.id, artifacts.c.data).outerjoin(artifacts, artifacts.c.job_id == jobs.c.id)
        data: bytes | None = self._find(job_id, left)["data"]
        return data

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
        rows = self._rows(statement)
        more, rows = len(rows) > limit, rows[:limit]
        return JobPage(tuple(summary_of(row) for row in rows), str(rows[-1]["number"]) if more else None)

    def waiting(self) -> dict[Lane, int]:
        """Return how many jobs wait in each lane."""
        statement = sa.select(jobs.c.lane, sa.func.count().label("jobs")).where(is_queued)
        counts = {row["lane"]: row["jobs"] for row in self._rows(statement.group_by(jobs.c.lane))}
        return {lane: counts.get(lane, 0) for lane in LANES}

    def deadlines(self, kinds: Iterable[str]) -> dict[str, float]:
        """Return when the time of those waiting jobs of some kinds is up that have one, by their id."""
        ends = is_queued, jobs.c.deadline.is_not(None), jobs.c.kind.in_(list(kinds))
        return {
            row["id"]: row["deadline"]
            for row in self._rows(sa.select(jobs.c.id, jobs.c.deadline).where(*ends))
        }

    def next_unfinished(self, owner: str) -> Job | None:
        """Return the ended job whose result an owner is to complete next; None if there is none.

        Those for which most tries were in vain come last.
        """
        statement = select_jobs.where(jobs.c.unfinished.is_not(None))
        if self.database.shared:
            left_alone = jobs.c.finished_at < self.clock.now() - _LEFT_ALONE_S
            statement = statement.where(sa.or_(jobs.c.owner == owner, left_alone))
        rows = self._rows(statement.order_by(jobs.c.unfinished, jobs.c.number).limit(1))
        return job_of(rows[0]) if rows else None

    def recent_durations(self, lane: Lane, limit: int) -> list[float]:
        """Return how long the newest succeeded jobs of a lane ran, in seconds, oldest first."""
        took = sa.select((jobs.c.finished_at - jobs.c.started_at).label("s"))
        succeeded = took.where(jobs.c.status == JobStatus.SUCCEEDED, jobs.c.lane == lane)
        rows = self._rows(succeeded.order_by(jobs.c.number.desc()).limit(limit))
        return [float(row["s"]) for row in reversed(rows)]

    def _rows(self, statement: sa.Select[Any]) -> Sequence[RowMapping]:
        with self.database.read() as connection:
            return connection.execute(statement).mappings().all()

    def _find(self, job_id: str, select: sa.Select[Any]) -> RowMapping:
        with self.database.read() as connection:
            return find(connection, job_id, select)


def find(connection: Connection, job_id: str, select: sa.Select[Any]) -> RowMapping:
    """Return what is selected of a job.

    Raises
    ------
    JobNotFound
        If no job has that id.
    """
    row = connection.execute(select.where(jobs.c.id == job_id)).mappings().first()
    if row is None:
        raise JobNotFound(job_id)
    return row


def count(connection: Connection, *which: sa.ColumnElement[bool]) -> int:
    """Return how many jobs there are of which all that is true."""
    return connection.execute(sa.select(sa.func.count()).where(*which)).scalar_one()


def has_place(connection: Connection) -> bool:
    """Say whether one more result can wait to be completed."""
    return count(connection, jobs.c.unfinished.is_not(None)) < _MOST_UNFINISHED


def progress_columns(progress: Progress) -> dict[str, Any]:
    """Return the columns of a progress by their names."""
    fields = progress.as_json()
    return {"assignment": fields.pop("assignment"), "progress": fields}


def progress_of(row: Row) -> Progress:
    """Return the stored progress of a row, with its plan if that was selected."""
    # Jobs of earlier versions have their plan in the other column.
    return Progress(**{"assignment": row.get("assignment"), **row["progress"]})


def job_of(row: Row) -> Job:
    """Return the job that a row with ``has_artifact`` describes."""
    return Job(**_summary(row), payload=read_later(row["payload"]), result=read_later(row["result"]))


def summary_of(row: Row) -> JobSummary:
    """Return what a row of :data:`select_summaries` or :data:`select_small` describes."""
    return JobSummary(**_summary(row))


_AS_STORED = "id", "kind", "lane", "error", "attempt", "deadline", "request_id", "key_id"
_TIMES = "created_at", "started_at", "finished_at"


def _summary(row: Row) -> Mapping[str, Any]:
    times = {name: row[name] for name in _TIMES}
    return {
        **{name: row[name] for name in _AS_STORED},
        **{name: at if at is None else datetime.fromtimestamp(at, UTC) for name, at in times.items()},
        "status": JobStatus(row["status"]),
        "progress": progress_of(row),
        "has_artifact": bool(row["has_artifact"]),
        "unfinished": row["unfinished"] is not None,
    }
