"""What a job is: its states, its progress, its result; plain values without behaviour.

States and the only ways between them::

    queued ──> running ──> succeeded | failed | cancelled
       │  <─────┘ (its worker or its owner is gone, or the service stopped)
       └──> cancelled | failed

Every dispatch counts ``attempt`` up, so a result of an earlier dispatch can be told and is dropped.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    from sqlalchemy import Connection

BEST_KNOWN = "best_known"
"""The field of the payload in which a job that is begun again gets its progress, where that has a plan."""

Lane = Literal["interactive", "batch", "training"]
LANES: tuple[Lane, ...] = ("interactive", "batch", "training")
"""In the order in which they get free workers."""


class JobStatus(StrEnum):
    """Where a job is in its life."""

    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def finished(self) -> bool:
        """Whether the state is final."""
        return self not in (JobStatus.QUEUED, JobStatus.RUNNING)


FINISHED = tuple(status for status in JobStatus if status.finished)


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a job is, and the best it has found.

    Attributes
    ----------
    fraction
        0 to 1.
    epoch
        Epochs done, where the work has epochs.
    best_reward
        Reward of the best plan so far.
    assignment
        The best plan so far: at most S joint actions of M targets each.
    answered_by
        The algorithm that found it; None where nothing says so.
    """

    fraction: float = 0.0
    epoch: int | None = None
    best_reward: float | None = None
    assignment: list[list[int]] | None = None
    answered_by: str | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the fields as a JSON object."""
        # Not copied: nobody changes a plan, and it may have a hundred thousand numbers.
        return {field.name: getattr(self, field.name) for field in fields(self)}


@dataclass(frozen=True, slots=True, kw_only=True)
class JobSummary:
    """One job without what it works on and what came of it, which may be large.

    Attributes
    ----------
    id
        32 lower-case hexadecimal digits.
    kind, lane
        What is done, and the lane it waits in.
    status
        Where it is in its life.
    error
        ``{"code", "detail", "violations": [{"pointer", "detail"}], "details": {}}`` of a failed job.
    progress
        The newest progress; after a crash the last one that was stored.
    attempt
        How often it was handed to a worker.
    created_at, started_at, finished_at
        UTC; ``started_at`` is of the newest attempt.
    has_artifact
        Whether the work left bytes behind.
    deadline
        When its time is up, by the service's clock; None for never.
    unfinished
        Whether its result is still to be completed.
    request_id, key_id
        The request that asked for it, and the API key of that request; None where there is none.
    """

    id: str
    kind: str
    status: JobStatus
    lane: Lane
    error: dict[str, Any] | None
    progress: Progress
    attempt: int
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    has_artifact: bool
    deadline: float | None = None
    unfinished: bool = False
    request_id: str | None = None
    key_id: str | None = None

    @property
    def labels(self) -> dict[str, str]:
        """What the lines have that are logged while it is worked on, ids by their names."""
        given = {"request_id": self.request_id, "key_id": self.key_id, "job_id": self.id}
        return {name: value for name, value in given.items() if value is not None}


@dataclass(frozen=True, slots=True, kw_only=True)
class Job(JobSummary):
    """One job as it is in the table, with the newest progress.

    Attributes
    ----------
    payload
        What the work function gets.
    result
        What the work function returned; a cancelled job has one if its work stopped by itself.
    """

    payload: Mapping[str, Any]
    result: Mapping[str, Any] | None


@dataclass(frozen=True, slots=True)
class JobPage:
    """Jobs without their plans, newest first; ``next_cursor`` is None on the last page."""

    jobs: tuple[JobSummary, ...]
    next_cursor: str | None


@dataclass(frozen=True, slots=True)
class Load:
    """How busy the service is.

    Attributes
    ----------
    capacity
        Jobs that can run at a time when all workers are well.
    ready
        Workers that are warm now; the service answers quickly once there is one.
    running
        Jobs by lane.
    restarts
        Workers that were replaced since the start because they died or were killed.
    """

    capacity: int
    ready: int
    running: dict[Lane, int]
    restarts: int


@dataclass(frozen=True)
class JobEvent:
    """One event of a job's stream.

    Attributes
    ----------
    id
        Grows within a job, over restarts of the service too (it is made of the time).
    name
        ``"progress"``, or ``"end"``, which comes once and last.
    data
        The progress fields; at the end also ``status``.
    """

    id: int
    name: Literal["progress", "end"]
    data: dict[str, Any]

    @cached_property
    def text(self) -> str:
        """The data as JSON, written once however many listen."""
        return json.dumps(self.data)


@dataclass(frozen=True, slots=True)
class Idempotency:
    """A client's promise that requests with the same key are the same request.

    Attributes
    ----------
    client
        Whose key it is; keys of different clients never meet.
    key
        The key.
    body_hash
        Digest of everything in the request that must not differ.
    """

    client: str
    key: str
    body_hash: str


@dataclass(frozen=True, slots=True)
class WorkResult:
    """What a work function returns.

    Attributes
    ----------
    result
        JSON-ready, without NaN; on its way from the worker as its text.
    artifact
        Bytes to keep beside it.
    unfinished
        Whether the kind's follow-up is to complete the result after the job's end.
    """

    result: Mapping[str, Any]
    artifact: bytes | None = None
    unfinished: bool = False


@dataclass(frozen=True, slots=True)
class FollowUp:
    """What completes a result.

    Attributes
    ----------
    work
        ``"module:function"``, light as ``at_once``. It gets the payload with the ``result`` beside, and
        returns the fields of the result that change; where it is unfinished itself, nothing does.
    given_up
        The fields of the result that change where it will not be completed: the job was cancelled, too many
        wait for it, or it failed too often.
    """

    work: str
    given_up: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class JobKind:
    """What can be submitted.

    Attributes
    ----------
    name
        Its name in :meth:`app.jobs.service.JobService.submit`.
    work
        ``"module:function"``, resolved only in the worker; the function takes the payload and a
        :class:`app.jobs.worker.WorkContext` and returns a :class:`WorkResult`.
    lane
        ``"interactive"`` for what somebody waits for, ``"batch"`` for what comes by the hundred,
        ``"training"`` for what takes long.
    on_success
        Called inside the transaction that marks a job succeeded, in a thread of the web process; what it
        returns is the stored result. It gets the job as it was while running. What it raises rolls the
        transaction back, and the job fails with that reason. It must be quick: writers wait for it.
    dropped_fields
        Of the payload: large ones that nobody needs any more once the job has ended.
    at_once
        As ``work``, but light and quick: answers a job that still waits when its time limit ends. None: such
        a job waits for a worker all the same.
    max_run_s
        How long its work may take, in seconds, whatever its time limit; then it is stopped as by that. None:
        as long as it likes.
    effort
        How much ``at_once`` has to do for a payload, in the least that there can be.
    follow_up
        Completes, after the job's end, a result that was returned as unfinished. None: it stays so.
    """

    name: str
    work: str
    lane: Lane
    on_success: Callable[[Connection, Job, WorkResult], Mapping[str, Any]] | None = None
    dropped_fields: frozenset[str] = frozenset()
    at_once: str | None = None
    max_run_s: float | None = None
    effort: Callable[[Mapping[str, Any]], float] = lambda _payload: 1.0
    follow_up: FollowUp | None = None


class JobObserver(Protocol):
    """Told of jobs on the event loop; it must be quick and must not raise."""

    def started(self, job: Job, waited_s: float) -> None:
        """Take note of a job's first attempt, and how long it waited for it in seconds."""

    def ended(self, job: Job, ran_s: float | None) -> None:
        """Take note of a job's end.

        Parameters
        ----------
        job
            Succeeded, failed or cancelled.
        ran_s
            How long its last attempt took in seconds; None if it ended without one in this process.
        """
