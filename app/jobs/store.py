"""The job table: every state a job takes is one transaction here, and nothing else knows the truth.

Taking in and taking out come first, then the ways in which an attempt ends, then what is done to jobs from
outside; what only looks at the table is in :mod:`app.jobs.queries`.

A transition out of ``running`` names the attempt it belongs to and touches nothing if the job has gone on
without it: a worker that was given up on cannot overwrite what came after it.

The methods block on the disk (a commit is one fsync): call them from a thread, not from an event loop.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import sqlalchemy as sa
from sqlalchemy import Connection, RowMapping

from app.jobs import queries
from app.jobs.clock import Clock
from app.jobs.errors import QueueFull, failure
from app.jobs.model import FINISHED, LANES, Idempotency, Job, JobKind, JobStatus, Lane, Progress, WorkResult
from app.jobs.queries import JobQueries, is_queued
from app.jobs.stored_json import read_later
from app.jobs.tables import DATABASE_NOW, Database, artifacts, claim_key, idempotency_keys, jobs, keep

MIGRATIONS = Path(__file__).parent / "migrations"
VERSION_TABLE = "alembic_version_jobs"

_UNFINISHED = JobStatus.QUEUED, JobStatus.RUNNING
_RUNNING = jobs.c.status == JobStatus.RUNNING
# Of each lane the job that has waited longest; one that another dispatcher is about to take is passed over,
# where they do not take turns.
_OLDEST = {
    lane: sa.select(jobs.c.number)
    .where(is_queued, jobs.c.lane == lane)
    .order_by(jobs.c.number)
    .limit(1)
    .with_for_update(skip_locked=True)
    .scalar_subquery()
    for lane in LANES
}


class JobStore(JobQueries):
    """Reads and writes the job table on behalf of one owner.

    Parameters
    ----------
    database
        Where the tables are.
    owner
        Recorded with every job that is taken: the service, by a name that no other one has.
    max_attempts
        How often a job may be lost with its worker or its owner; then it fails.
    kinds
        The kinds of job that there are.
    clock
        Of the service; None: a new one.

    Attributes
    ----------
    kinds
        By their names.
    """

    def __init__(
        self,
        database: Database,
        owner: str,
        max_attempts: int,
        kinds: Iterable[JobKind] = (),
        clock: Clock | None = None,
    ) -> None:
        super().__init__(database, clock or Clock())
        self.owner, self.max_attempts = owner, max_attempts
        self.kinds = {kind.name: kind for kind in kinds}

    def migrate(self) -> None:
        """Make the tables, or bring them to this version."""
        self.database.migrate(MIGRATIONS, VERSION_TABLE)
        self.follow_database()

    def follow_database(self) -> None:
        """Take over the time of a database that several services share."""
        if self.database.shared:
            with self.database.read() as connection:
                self.clock.follow(connection.scalar(sa.select(DATABASE_NOW)))

    def insert(
        self,
        kind: JobKind,
        payload: Mapping[str, Any],
        *,
        run_now: bool,
        places: int,
        retry_after_s: float = 1.0,
        time_limit_s: float | None = None,
        idempotency: Idempotency | None = None,
        asked_by: Mapping[str, str] = MappingProxyType({}),
    ) -> tuple[Job, bool]:
        """Add a job, or find the one that was added with the same idempotency key.

        Parameters
        ----------
        run_now
            A worker is reserved: the job begins as running, which saves the transaction that takes it, unless
            another waits that comes before it.
        places, retry_after_s
            How many may wait in its lane, where it has to, and when one more is expected to have a place.
        asked_by
            The ids of the request and of its API key, by the names of their columns, where there are any.

        Returns
        -------
        tuple
            The job, and whether it is new.

        Raises
        ------
        IdempotencyMismatch
            If the key came with another body before.
        QueueFull
            If the job would have to wait and its lane has no place left.
        """
        with self.database.write() as connection:
            if idempotency is not None:
                known = claim_key(self.database, connection, idempotency_keys, idempotency)
                if known is not None:
                    return queries.job_of(queries.find(connection, known, queries.select_jobs)), False
            if not (self.database.shared or _is_there(connection, jobs.c.status.in_(_UNFINISHED))):
                self.clock.follow()
            before = jobs.c.lane.in_(LANES[: LANES.index(kind.lane) + 1])
            if not run_now or _is_there(connection, is_queued, before):
                run_now = False
                self.database.take_turn(connection, f"queue {kind.lane}")
                if queries.count(connection, is_queued, jobs.c.lane == kind.lane) >= places:
                    raise QueueFull(kind.lane, places, retry_after_s)
            now = self.clock.now()
            row: dict[str, Any] = {
                **dict.fromkeys(jobs.c.keys()[1:]),
                **queries.progress_columns(Progress()),
                "id": uuid.uuid4().hex,
                "kind": kind.name,
                "lane": kind.lane,
                "status": JobStatus.RUNNING if run_now else JobStatus.QUEUED,
                "payload": payload,
                "attempt": int(run_now),
                "losses": 0,
                "owner": self.owner if run_now else None,
                "cancel_requested": False,
                "deadline": None if time_limit_s is None else now + time_limit_s,
                "created_at": now,
                "started_at": now if run_now else None,
                "request_id": asked_by.get("request_id"),
                "key_id": asked_by.get("key_id"),
            }
            connection.execute(sa.insert(jobs).values(row))
            if idempotency is not None:
                keep(connection, idempotency_keys, idempotency, row["id"])
        return queries.job_of({**row, "has_artifact": False}), True

    def claim(self, lanes: Sequence[Lane]) -> Job | None:
        """Take the job that has waited longest in the first of the lanes that has one; None if none has."""
        first = sa.func.coalesce(*(_OLDEST[lane] for lane in lanes), sa.null())
        return next(iter(self._take(jobs.c.number == first)), None)

    def claim_these(self, job_ids: Sequence[str]) -> list[Job]:
        """Take jobs out of their turn; those that wait, in the order of their deadlines."""
        return sorted(self._take(jobs.c.id.in_(job_ids)), key=lambda job: job.deadline or 0.0)

    def _take(self, which: sa.ColumnElement[bool]) -> list[Job]:
        with self.database.write() as connection:
            now = self.clock.now()
            # An earlier process may have had another idea of the time.
            started_at = sa.case((jobs.c.created_at > now, jobs.c.created_at), else_=now)
            begins = {"status": JobStatus.RUNNING, "attempt": jobs.c.attempt + 1, "owner": self.owner}
            take = sa.update(jobs).where(which, is_queued).values(**begins, started_at=started_at)
            rows = connection.execute(take.returning(*queries.whole, queries.has_artifact)).mappings().all()
            if not rows:
                connection.rollback()  # nothing is there to be committed
        return [queries.job_of(row) for row in rows]

    def succeed(self, job_id: str, attempt: int, work: WorkResult, progress: Progress) -> Job | None:
        """Store what the work returned; the job has succeeded, or is cancelled if that was asked for.

        Returns
        -------
        Job or None
            None if the job has gone on without this attempt: nothing was stored, and the
            ``on_success`` of its kind not called.
        """
        with self.database.write() as connection:
            row = self._find_attempt(connection, job_id, attempt)
            if row is None:
                return None
            kind, cancelled = self.kinds[row["kind"]], row["cancel_requested"]
            result, unfinished = work.result, False
            if kind.on_success is not None and not cancelled:
                result = kind.on_success(connection, queries.job_of(row), work)
            if work.artifact is not None:
                connection.execute(sa.insert(artifacts).values(job_id=job_id, data=work.artifact))
            if work.unfinished and kind.follow_up is not None:
                unfinished = not cancelled and queries.has_place(connection)
                result = result if unfinished else {**result, **kind.follow_up.given_up}
            done = progress if cancelled else replace(progress, fraction=1.0)
            tries = 0 if unfinished else None
            return self._move(connection, row, JobStatus.SUCCEEDED, done, result=result, unfinished=tries)

    def fail(self, job_id: str, attempt: int, error: dict[str, Any], progress: Progress) -> Job | None:
        """Mark a job failed, or cancelled if that was asked for; None if it went on without this attempt."""
        return self._end_attempt(job_id, attempt, JobStatus.FAILED, progress, error=error)

    def requeue(self, job_id: str, attempt: int, progress: Progress) -> Job | None:
        """Put a job back into the queue that was stopped through no fault of its own.

        A job that was to be cancelled is cancelled. None if the job has gone on without this attempt.
        """
        return self._end_attempt(job_id, attempt, JobStatus.QUEUED, progress)

    def mark_crashed(self, job_id: str, attempt: int, reason: str, progress: Progress | None) -> Job | None:
        """Put a job back whose worker died: it waits again, or has failed if that was the last attempt.

        Without a progress it keeps the one that is stored. A job that was to be cancelled is cancelled. None
        if the job has gone on without this attempt.
        """
        return self._end_attempt(job_id, attempt, JobStatus.QUEUED, progress, crash=reason)

    def _end_attempt(
        self, job_id: str, attempt: int, status: JobStatus, progress: Progress | None, **values: Any
    ) -> Job | None:
        with self.database.write() as connection:
            row = self._find_attempt(connection, job_id, attempt)
            return None if row is None else self._move(connection, row, status, progress, **values)

    def _find_attempt(self, connection: Connection, job_id: str, attempt: int) -> RowMapping | None:
        """Return the row if the job is still in this attempt; nothing can come between it and the commit."""
        of_attempt = jobs.c.id == job_id, jobs.c.attempt == attempt, _RUNNING
        return connection.execute(queries.select_to_change.where(*of_attempt)).mappings().first()

    def _move(
        self,
        connection: Connection,
        row: RowMapping,
        status: JobStatus,
        progress: Progress | None = None,
        crash: str | None = None,
        **values: Any,
    ) -> Job:
        """Move a job on from the state, and the attempt, in which it was read: cancelled if it was to be.

        Parameters
        ----------
        progress
            None: the one that is stored.
        crash
            Why its worker or its owner is gone, for which it fails after the last attempt.
        values
            Of other columns.
        """
        if row["cancel_requested"]:
            status = JobStatus.CANCELLED
        elif crash is not None:
            values["losses"] = crashes = row["losses"] + 1
            if crashes >= self.max_attempts:
                status = JobStatus.FAILED
                values["error"] = failure("worker-lost", f"{crash}; given up after {crashes} attempts")
        if status.finished:
            # An earlier process may have had another idea of the time.
            values["finished_at"] = max(self.clock.now(), row["started_at"] or row["created_at"])
            kind = self.kinds.get(row["kind"])
            if kind is not None and kind.dropped_fields:
                payload = read_later(row["payload"]).items()
                values["payload"] = {name: it for name, it in payload if name not in kind.dropped_fields}
        else:
            # It waits in the place of the queue that its number gives it.
            values.update(owner=None, started_at=None)
        progress = queries.progress_of(row) if progress is None else progress
        stored = {"status": status, **queries.progress_columns(progress), **values}
        as_read = jobs.c.id == row["id"], jobs.c.attempt == row["attempt"], jobs.c.status == row["status"]
        # Not all of it is read again: payload and result are known here, and may be large.
        change = sa.update(jobs).where(*as_read).values(stored).returning(queries.has_artifact)
        return queries.job_of({**row, **stored, **connection.execute(change).mappings().one()})

    def recover(self, alive: Callable[[str], bool]) -> list[Job]:
        """Put back the running jobs of owners that are dead, and fail jobs of kinds that are no more.

        Returns
        -------
        list of Job
            Every job that was changed.
        """
        owners = [row["owner"] for row in self._rows(sa.select(jobs.c.owner).where(_RUNNING).distinct())]
        left = sa.and_(_RUNNING, jobs.c.owner.in_([owner for owner in owners if not alive(owner)]))
        which = sa.or_(left, sa.and_(is_queued, jobs.c.kind.not_in(list(self.kinds))))
        if not self._rows(sa.select(jobs.c.number).where(which).limit(1)):
            return []
        with self.database.write() as connection:
            rows = connection.execute(queries.select_to_change.where(which)).mappings().all()
            return [self._give_back(connection, row) for row in rows]

    def _give_back(self, connection: Connection, row: RowMapping) -> Job:
        if row["status"] == JobStatus.RUNNING:
            reason = "the service stopped in its midst"
            return self._move(connection, row, JobStatus.QUEUED, crash=reason)
        error = failure("unknown-job-kind", f"this version has no jobs of kind {row['kind']!r}")
        return self._move(connection, row, JobStatus.FAILED, error=error)

    def complete_result(
        self, job_id: str, attempt: int, fields: Mapping[str, Any], *, failed: bool = False
    ) -> bool:
        """Store the fields of an ended job's result that complete it.

        Parameters
        ----------
        fields
            The fields.
        failed
            The try was in vain. The result gets the fields after the last one, as often as a job may be lost.

        Returns
        -------
        bool
            False if the result was completed by another, or the job is no more.
        """
        ended = jobs.c.status.in_(FINISHED), jobs.c.unfinished.is_not(None)
        unfinished = queries.select_to_change.where(jobs.c.id == job_id, jobs.c.attempt == attempt, *ended)
        with self.database.write() as connection:
            row = connection.execute(unfinished).mappings().first()
            if row is None:
                return False
            values: dict[str, Any] = {"unfinished": row["unfinished"] + 1}
            if not failed or values["unfinished"] >= self.max_attempts:
                values = {"result": {**read_later(row["result"]), **fields}, "unfinished": None}
            connection.execute(sa.update(jobs).where(jobs.c.number == row["number"]).values(values))
        return True

    def save_progress(self, items: Iterable[tuple[str, int, Progress]]) -> None:
        """Store the newest progress of running jobs, given as id, attempt and progress."""
        with self.database.write() as connection:
            for job_id, attempt, progress in items:
                of_attempt = jobs.c.id == job_id, jobs.c.attempt == attempt, _RUNNING
                values = queries.progress_columns(progress)
                connection.execute(sa.update(jobs).where(*of_attempt).values(values))

    def cancel(self, job_id: str) -> tuple[Job, JobStatus]:
        """Cancel a waiting job, note for a running one that it should stop, and leave a finished one alone.

        Returns
        -------
        tuple
            The job as it is now, and the status it had before.

        Raises
        ------
        JobNotFound
            If no job has that id.
        """
        with self.database.write() as connection:
            row = queries.find(connection, job_id, queries.select_to_change)
            before = JobStatus(row["status"])
            if before is JobStatus.QUEUED:
                return self._move(connection, row, JobStatus.CANCELLED), before
            if before is JobStatus.RUNNING:
                connection.execute(
                    sa.update(jobs).where(jobs.c.number == row["number"]).values(cancel_requested=True)
                )
            return queries.job_of(row), before

    def expire(self, before: float, limit: int) -> int:
        """Delete finished jobs with what they left and the idempotency keys they came with.

        Parameters
        ----------
        before
            Seconds since 1970: only jobs that ended before then.
        limit
            How many at most, the oldest first: other writers wait that long.

        Returns
        -------
        int
            How many were deleted.
        """
        old = sa.select(jobs.c.number).where(jobs.c.finished_at < before)
        oldest = jobs.c.number.in_(old.order_by(jobs.c.finished_at).limit(limit))
        with self.database.write() as connection:
            return connection.execute(sa.delete(jobs).where(oldest, jobs.c.status.in_(FINISHED))).rowcount


def _is_there(connection: Connection, *which: sa.ColumnElement[bool]) -> bool:
    return connection.scalar(sa.select(sa.literal(1)).where(*which).limit(1)) is not None
