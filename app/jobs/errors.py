"""Every error that the jobs room raises on purpose, and why a job failed, as it is stored.

JobError
 ├─ QueueFull               a lane's queue has no place left; ``retry_after_s`` says when to come back
 ├─ Draining                the service is stopping and takes no new job
 ├─ JobNotFound             no job has that id
 ├─ UnknownJobKind          no kind of job has that name
 ├─ InvalidCursor           a page was asked for with a cursor that no page gave out
 └─ IdempotencyMismatch     an idempotency key was used before with another body

A retry with a known key and the same body is never an error: it gets the first job, which the caller waits
for as the first caller does, be it queued, running or finished.
"""

from __future__ import annotations

from typing import Any

from app.domain.errors import AllocatorError
from app.domain.said import said, to_record


class JobError(Exception):
    """Root of the tree."""


class QueueFull(JobError):
    """A lane's queue has no place left."""

    def __init__(self, lane: str, limit: int, retry_after_s: float) -> None:
        super().__init__(
            said(
                "the queue of {lane} jobs is full ({limit} waiting); a place is expected to be free in "
                "{seconds} s",
                lane=lane,
                limit=limit,
                seconds=round(retry_after_s),
            )
        )
        self.retry_after_s = retry_after_s


class Draining(JobError):
    """The service is stopping, or not started: it takes no new job."""

    def __init__(self) -> None:
        super().__init__(said("the service is stopping and takes no new jobs"))


class JobNotFound(JobError):
    """No job has that id."""

    def __init__(self, job_id: str) -> None:
        super().__init__(said("there is no job {id!r}", id=job_id))


class UnknownJobKind(JobError):
    """No kind of job has that name."""

    def __init__(self, kind: str) -> None:
        super().__init__(f"there is no kind of job {kind!r}")


class InvalidCursor(JobError):
    """A page was asked for with a cursor that no page gave out."""

    def __init__(self, cursor: str) -> None:
        super().__init__(said("{cursor!r} is not a cursor of a page of jobs", cursor=cursor))


class IdempotencyMismatch(JobError):
    """An idempotency key was used before with another body."""

    def __init__(self, key: str, begun: str) -> None:
        super().__init__(
            said("idempotency key {key!r} was used with another body, for {begun}", key=key, begun=begun)
        )


INTERNAL_ERROR = "internal-error"
"""Code of a failure that is a defect, or the machine's trouble."""


def failure(code: str, detail: str) -> dict[str, Any]:
    """Return the error object of a failure that has no violations and no further facts."""
    return {"code": code, **to_record(detail), "violations": [], "details": {}}


def describe(error: BaseException) -> dict[str, Any]:
    """Return the error object of an exception that ended a job.

    An :class:`AllocatorError` says for itself what is wrong. Anything else is a defect or the machine's
    trouble: the object names the type and the message, the traceback belongs into the log.
    """
    if isinstance(error, AllocatorError):
        return {
            "code": error.code,
            **to_record(error.detail),
            "violations": [{"pointer": v.pointer, **to_record(v.detail)} for v in error.violations],
            "details": error.details,
        }
    detail = said("the work ended with {kind}: {why}", kind=type(error).__name__, why=str(error))
    return failure(INTERNAL_ERROR, detail)
