"""The job table: every state a job takes is one transaction here, and nothing else knows the truth.

Taking in and taking out come first, then the ways in which an attempt ends, then what is done to jobs from
outside; what only looks at the table is in :mod:`app.jobs.reading`.

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

from app.jobs.clock import Clock
from app.jobs.errors import IdempotencyMismatch, QueueFull
from app.jobs.failure import failure
from app.jobs.lanes import QueueLimit
from app.jobs.model import (
    FINISHED,
    FollowUp,
    Idempotency,
    Job,
    JobKind,
    JobStatus,
    Lane,
    Progress,
    WorkResult,
)
from app.jobs.reading import Database, JobReader
from app.jobs.tables import artifacts, idempotency_keys, jobs
from app.jobs.transitions import (
    Claim,
    claim_of,
    end,
    find,
    find_attempt,
    job_of,
    progress_columns,
    progress_of,
    queued_of_other_kinds,
    requeue,
    select_jobs,
    select_jobs_to_change,
    take,
)
from app.jobs.unfinished import UnfinishedResults, has_place

MIGRATIONS = Path(__file__).parent / "migrations"
VERSION_TABLE = "alembic_version_jobs"

OnSuccess = Callable[[Connection, Job, WorkResult], Mapping[str, Any]]


class JobStore(JobReader):
    """Reads and writes the job table on behalf of one owner.

    Parameters
    ----------
    database
        Where the tables are.
    owner
        Recorded with every job that is taken, see :mod:`app.jobs.owner`.
    max_attempts
        How often a job may be lost with its worker or its owner; then it fails.
    dropped_fields
        By kind of job, the fields of the payload that go when it ends.
    clock
        Of the service; None: a new one.

    Attributes
    ----------
    unfinished
        The results that are completed after their job's end.
    """

    def __init__(
        self,
        database: Database,
        owner: str,
        max_attempts: int,
        dropped_fields: Mapping[str, frozenset[str]] = MappingProxyType({}),
        clock: Clock | None = None,
    ) -> None:
        super().__init__(database, clock or Clock())
        self._owner = owner
        self._max_attempts = max_attempts
        self._dropped_fields = dropped_fields
        self.unfinished = UnfinishedResults(self, owner, max_attempts)

    def migrate(self) -> None:
        """Make the tables, or bring them to this version."""
        self._database.migrate(MIGRATIONS, VERSION_TABLE)

    def insert(
        self,
        kind: JobKind,
        payload: Mapping[str, Any],
        *,
        run_now: bool,
        limit: QueueLimit,
        time_limit_s: float | None = None,
        idempotency: Idempotency | None = None,
        request_id: str | None = None,
        key_id: str | None = None,
    ) -> tuple[Claim, bool]:
        """Add a job, or find the one that was added with the same idempotency key.

        Parameters
        ----------
        run_now
            A worker is reserved: the job begins as running, which saves the transaction that takes it.
        request_id, key_id
            The request that asks for it, and its API key.

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
        with self._database.write() as connection:
            if idempotency is not None:
                self._database.take_turn(connection, f"key {idempotency.client} {idempotency.key}")
                known = self._known(connection, idempotency)
                if known is not None:
                    return known, False
            if not run_now:
                self._database.take_turn(connection, f"queue {kind.lane}")
                waiting = connection.scalar(
                    sa.select(sa.func.count()).where(
                        jobs.c.status == JobStatus.QUEUED, jobs.c.lane == kind.lane
                    )
                )
                if (waiting or 0) >= limit.places:
                    raise QueueFull(kind.lane, limit.places, limit.retry_after_s)
            now = self._now(connection)
            row: dict[str, Any] = {
                "id": uuid.uuid4().hex,
                "kind": kind.name,
                "lane": kind.lane,
                "status": JobStatus.RUNNING if run_now else JobStatus.QUEUED,
                "payload": payload,
                "result": None,
                "error": None,
                **progress_columns(Progress()),
                "attempt": 1 if run_now else 0,
                "losses": 0,
                "owner": self._owner if run_now else None,
                "cancel_requested": False,
                "deadline": None if time_limit_s is None else now + time_limit_s,
                "created_at": now,
                "started_at": now if run_now else None,
                "finished_at": None,
                "request_id": request_id,
                "key_id": key_id,
                "unfinished": None,
            }
            connection.execute(sa.insert(jobs).values(row))
            if idempotency is not None:
                connection.execute(
                    sa.insert(idempotency_keys).values(
                        client=idempotency.client,
                        key=idempotency.key,
                        body_hash=idempotency.body_hash,
                        job_id=row["id"],
                    )
                )
            ahead = self._ahead(connection)
        return claim_of(row, ahead), True

    def _known(self, connection: Connection, idempotency: Idempotency) -> Claim | None:
        found = connection.execute(
            sa.select(idempotency_keys.c.body_hash, idempotency_keys.c.job_id).where(
                idempotency_keys.c.client == idempotency.client, idempotency_keys.c.key == idempotency.key
            )
        ).first()
        if found is None:
            return None
        if found.body_hash != idempotency.body_hash:
            raise IdempotencyMismatch(idempotency.key, found.job_id)
        row = connection.execute(select_jobs.where(jobs.c.id == found.job_id)).mappings().one()
        return claim_of(row, self._ahead(connection))

    def claim(self, lane: Lane) -> Claim | None:
        """Take the job of a lane that has waited longest; None if none waits."""
        oldest = (
            sa.select(jobs.c.number)
            .where(jobs.c.status == JobStatus.QUEUED, jobs.c.lane == lane)
            .order_by(jobs.c.number)
            .limit(1)
            # One that another dispatcher is about to take is passed over, where they do not take turns.
            .with_for_update(skip_locked=True)
            .scalar_subquery()
        )
        return next(iter(self._take(jobs.c.number == oldest)), None)

    def claim_these(self, job_ids: Sequence[str]) -> list[Claim]:
        """Take jobs out of their turn; those that wait, in the order of their deadlines."""
        claims = self._take(jobs.c.id.in_(job_ids))
        return sorted(claims, key=lambda claim: claim.deadline or 0.0)

    def _take(self, which: sa.ColumnElement[bool]) -> list[Claim]:
        with self._database.write() as connection:
            now = self._now(connection)
            rows = connection.execute(take(which, self._owner, now)).mappings().all()
            ahead = self._ahead(connection)
        return [claim_of(row, ahead) for row in rows]

    def succeed(
        self,
        job_id: str,
        attempt: int,
        work: WorkResult,
        progress: Progress,
        on_success: OnSuccess | None,
        follow_up: FollowUp | None = None,
    ) -> Job | None:
        """Store what the work returned; the job has succeeded, or is cancelled if that was asked for.

        Returns
        -------
        Job or None
            None if the job has gone on without this attempt: nothing was stored, ``on_success`` not called.
        """
        with self._database.write() as connection:
            row = find_attempt(connection, job_id, attempt)
            if row is None:
                return None
            cancelled = row["cancel_requested"]
            result = work.result
            if on_success is not None and not cancelled:
                result = on_success(connection, job_of(row), work)
            if work.artifact is not None:
                connection.execute(sa.insert(artifacts).values(job_id=job_id, data=work.artifact))
            unfinished = False
            if work.unfinished and follow_up is not None:
                unfinished = not cancelled and has_place(connection)
                result = result if unfinished else {**result, **follow_up.given_up}
            if cancelled:
                return self._end(connection, row, JobStatus.CANCELLED, progress, result=result)
            done = replace(progress, fraction=1.0)
            return self._end(connection, row, JobStatus.SUCCEEDED, done, result=result, unfinished=unfinished)

    def fail(self, job_id: str, attempt: int, error: dict[str, Any], progress: Progress) -> Job | None:
        """Mark a job failed, or cancelled if that was asked for; None if it went on without this attempt."""
        with self._database.write() as connection:
            row = find_attempt(connection, job_id, attempt)
            if row is None:
                return None
            status = JobStatus.CANCELLED if row["cancel_requested"] else JobStatus.FAILED
            return self._end(connection, row, status, progress, error=error)

    def lose(self, job_id: str, attempt: int, reason: str, progress: Progress) -> Job | None:
        """Give a job back whose worker died: it waits again, or has failed if that was the last attempt.

        A job that was to be cancelled is cancelled. None if the job has gone on without this attempt.
        """
        with self._database.write() as connection:
            row = find_attempt(connection, job_id, attempt)
            return None if row is None else self._lose(connection, row, reason, progress)

    def release(self, job_id: str, attempt: int, progress: Progress | None) -> Job | None:
        """Put a job back into the queue that was stopped through no fault of its own.

        Without a progress it keeps the one that is stored.
        """
        with self._database.write() as connection:
            row = find_attempt(connection, job_id, attempt)
            if row is None:
                return None
            if progress is None:
                progress = progress_of(row)
            if row["cancel_requested"]:
                return self._end(connection, row, JobStatus.CANCELLED, progress)
            return requeue(connection, row, row["losses"], progress)

    def _lose(self, connection: Connection, row: RowMapping, reason: str, progress: Progress) -> Job:
        if row["cancel_requested"]:
            return self._end(connection, row, JobStatus.CANCELLED, progress)
        losses = row["losses"] + 1
        if losses >= self._max_attempts:
            error = failure("worker-lost", f"{reason}; given up after {losses} attempts")
            return self._end(connection, row, JobStatus.FAILED, progress, error=error)
        return requeue(connection, row, losses, progress)

    def _end(
        self, connection: Connection, row: RowMapping, status: JobStatus, progress: Progress, **values: Any
    ) -> Job:
        dropped = self._dropped_fields.get(row["kind"], frozenset())
        return end(connection, row, status, progress, self._now(connection), dropped=dropped, **values)

    def recover(self, kinds: Iterable[str], alive: Callable[[str], bool]) -> list[Job]:
        """Give back the running jobs of owners that are dead, and fail jobs of kinds that are no more.

        Returns
        -------
        list of Job
            Every job that was changed.
        """
        changed = []
        with self._database.read() as connection:
            owners = connection.scalars(
                sa.select(jobs.c.owner).where(jobs.c.status == JobStatus.RUNNING).distinct()
            ).all()
            strangers = connection.scalar(queued_of_other_kinds(kinds).with_only_columns(sa.func.count()))
        dead = [owner for owner in owners if not alive(owner)]
        if not dead and not strangers:
            return []
        with self._database.write() as connection:
            lost = select_jobs_to_change.where(jobs.c.status == JobStatus.RUNNING, jobs.c.owner.in_(dead))
            for row in connection.execute(lost).mappings().all():
                changed.append(
                    self._lose(connection, row, "the service stopped in its midst", progress_of(row))
                )
            unknown = queued_of_other_kinds(kinds).with_for_update(of=jobs)
            for row in connection.execute(unknown).mappings().all():
                error = failure("unknown-job-kind", f"this version has no jobs of kind {row['kind']!r}")
                changed.append(self._end(connection, row, JobStatus.FAILED, progress_of(row), error=error))
        return changed

    def save_progress(self, items: Iterable[tuple[str, int, Progress]]) -> None:
        """Store the newest progress of running jobs, given as id, attempt and progress."""
        with self._database.write() as connection:
            for job_id, attempt, progress in items:
                connection.execute(
                    sa.update(jobs)
                    .where(
                        jobs.c.id == job_id,
                        jobs.c.attempt == attempt,
                        jobs.c.status == JobStatus.RUNNING,
                    )
                    .values(progress_columns(progress))
                )

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
        with self._database.write() as connection:
            row = find(connection, job_id, to_change=True)
            if row["status"] == JobStatus.QUEUED:
                return self._end(connection, row, JobStatus.CANCELLED, progress_of(row)), JobStatus.QUEUED
            if row["status"] == JobStatus.RUNNING:
                connection.execute(
                    sa.update(jobs).where(jobs.c.number == row["number"]).values(cancel_requested=True)
                )
            job = job_of(row)
        return job, job.status

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
        oldest = (
            sa.select(jobs.c.number)
            .where(jobs.c.finished_at < before)
            .order_by(jobs.c.finished_at)
            .limit(limit)
        )
        with self._database.write() as connection:
            ended = jobs.c.number.in_(oldest), jobs.c.status.in_(FINISHED)
            return connection.execute(sa.delete(jobs).where(*ended)).rowcount
