"""Rows of the job table and the ways from one state to the next, inside the caller's transaction."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy import Connection, RowMapping

from app.jobs.errors import JobNotFound
from app.jobs.model import Job, JobStatus, JobSummary, Progress
from app.jobs.stored_json import read_later
from app.jobs.tables import artifacts, jobs


@dataclass(frozen=True, slots=True)
class Claim:
    """A job that was taken to be run, and when its time is up by the service's clock."""

    job: Job
    deadline: float | None


has_artifact = sa.exists().where(artifacts.c.job_id == jobs.c.id).label("has_artifact")
_TEXTS = {"payload", "result"}
# As texts, which most of those who handle a job only hand on.
_whole = [
    sa.cast(column, sa.Text).label(column.name) if column.name in _TEXTS else column for column in jobs.c
]
select_jobs = sa.select(*_whole, has_artifact)
# Payloads, results and plans may have a megabyte each.
_LARGE = _TEXTS | {"assignment"}
select_small = sa.select(*(column for column in jobs.c if column.name not in _LARGE), has_artifact)
select_summaries = select_small.add_columns(jobs.c.assignment)
# What is read in order to be changed is locked, where a database does not let writers take turns.
select_jobs_to_change = select_jobs.with_for_update(of=jobs)


def find(connection: Connection, job_id: str, *, to_change: bool = False) -> RowMapping:
    """Return the row of a job; if it is to be changed, nothing can come between it and the commit.

    Raises
    ------
    JobNotFound
        If no job has that id.
    """
    select = select_jobs_to_change if to_change else select_jobs
    row = connection.execute(select.where(jobs.c.id == job_id)).mappings().first()
    if row is None:
        raise JobNotFound(job_id)
    return row


def find_attempt(connection: Connection, job_id: str, attempt: int) -> RowMapping | None:
    """Return the row if the job is still in this attempt; nothing can come between it and the commit."""
    return (
        connection.execute(
            select_jobs_to_change.where(
                jobs.c.id == job_id, jobs.c.attempt == attempt, jobs.c.status == JobStatus.RUNNING
            )
        )
        .mappings()
        .first()
    )


def queued_of_other_kinds(kinds: Iterable[str]) -> sa.Select[Any]:
    """Select the waiting jobs that none of these kinds can run."""
    return select_jobs.where(jobs.c.status == JobStatus.QUEUED, jobs.c.kind.not_in(list(kinds)))


def take(which: sa.ColumnElement[bool], owner: str, now: float) -> sa.Executable:
    """Let an owner have those of some jobs that wait, and return them."""
    return (
        sa.update(jobs)
        .where(which, jobs.c.status == JobStatus.QUEUED)
        .values(
            status=JobStatus.RUNNING,
            attempt=jobs.c.attempt + 1,
            owner=owner,
            # An earlier process may have had another idea of the time.
            started_at=sa.case((jobs.c.created_at > now, jobs.c.created_at), else_=now),
        )
        .returning(*_whole)
    )


def end(
    connection: Connection,
    row: RowMapping,
    status: JobStatus,
    progress: Progress,
    now: float,
    *,
    result: Mapping[str, Any] | None = None,
    error: dict[str, Any] | None = None,
    dropped: Set[str] = frozenset(),
    unfinished: bool = False,
) -> Job:
    """Move a job to a final state, its payload without the dropped fields."""
    # An earlier process may have had another idea of the time.
    finished_at = max(now, row["started_at"] or row["created_at"])
    values: dict[str, Any] = {
        "result": result,
        "error": error,
        "finished_at": finished_at,
        "unfinished": 0 if unfinished else None,
    }
    if dropped:
        values["payload"] = {
            name: value for name, value in read_later(row["payload"]).items() if name not in dropped
        }
    return change(connection, row, status, progress, **values)


def requeue(connection: Connection, row: RowMapping, losses: int, progress: Progress) -> Job:
    """Let a job wait again, in the place of the queue that its number gives it."""
    return change(connection, row, JobStatus.QUEUED, progress, losses=losses, owner=None, started_at=None)


def change(
    connection: Connection, row: RowMapping, status: JobStatus, progress: Progress, **values: Any
) -> Job:
    """Move a job on from the state, and the attempt, in which it was read."""
    stored = {"status": status, **progress_columns(progress), **values}
    left = (
        connection.execute(
            sa.update(jobs)
            .where(jobs.c.id == row["id"], jobs.c.attempt == row["attempt"], jobs.c.status == row["status"])
            .values(stored)
            # Not all of it: payload and result are known here, and may be large.
            .returning(has_artifact)
        )
        .mappings()
        .one()
    )
    return job_of({**row, **stored, **left})


def progress_columns(progress: Progress) -> dict[str, Any]:
    """Return the columns of a progress by their names."""
    fields = progress.as_json()
    return {"assignment": fields.pop("assignment"), "progress": fields}


def progress_of(row: RowMapping | dict[str, Any]) -> Progress:
    """Return the stored progress of a row, with its plan if that was selected."""
    # Jobs of earlier versions have their plan in the other column.
    return Progress(**{"assignment": row.get("assignment"), **row["progress"]})


def _time(seconds: float | None) -> datetime | None:
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC)


def job_of(row: RowMapping | dict[str, Any]) -> Job:
    """Return the job that a row with ``has_artifact`` describes."""
    return Job(**_summary(row), payload=read_later(row["payload"]), result=read_later(row["result"]))


def claim_of(row: RowMapping | dict[str, Any], ahead: float) -> Claim:
    """Return the claim to the job of a row; the service's clock is ``ahead`` of the one of its deadline."""
    deadline = row["deadline"]
    return Claim(job_of({"has_artifact": False, **row}), None if deadline is None else deadline + ahead)


def summary_of(row: RowMapping | dict[str, Any]) -> JobSummary:
    """Return what a row of :data:`select_summaries` or :data:`select_small` describes."""
    return JobSummary(**_summary(row))


def _summary(row: RowMapping | dict[str, Any]) -> dict[str, Any]:
    return {
        "id": row["id"],
        "kind": row["kind"],
        "status": JobStatus(row["status"]),
        "lane": row["lane"],
        "error": row["error"],
        "progress": progress_of(row),
        "attempt": row["attempt"],
        "created_at": datetime.fromtimestamp(row["created_at"], UTC),
        "started_at": _time(row["started_at"]),
        "finished_at": _time(row["finished_at"]),
        "has_artifact": bool(row["has_artifact"]),
        "unfinished": row["unfinished"] is not None,
        "request_id": row["request_id"],
        "key_id": row["key_id"],
    }
