"""Errors of the web room itself.

RequestError
 ├─ MalformedJson           the body is no JSON
 ├─ InvalidBody             the body's fields are not those of the request
 ├─ UnsupportedMediaType    the body is not sent as JSON
 ├─ UnsupportedContentEncoding  the body is sent compressed
 ├─ BodyTooLarge            the body has more bytes than are taken
 ├─ BatchTooLarge           a batch has more allocations than are taken
 ├─ NotReady                a part of the service does not answer
 ├─ JobCancelled            a job that somebody waits for was cancelled before it had a plan
 ├─ JobFailed               a job that somebody waits for ended with an error
 ├─ JobWithoutCheckpoint    a job is to be registered that has learned nothing
 └─ ExampleNotFound         no example has that name
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from app.api.problem_details import FieldError
from app.domain.said import from_record, noun, said


class RequestError(Exception):
    """Root of the tree: a problem's type, detail, and what else its response has.

    Parameters
    ----------
    code
        The problem's type.
    detail
        What is wrong.
    errors, extensions, headers
        As in :func:`app.api.problem_details.problem_response`.
    """

    def __init__(
        self,
        code: str,
        detail: str,
        *,
        errors: Sequence[FieldError] = (),
        extensions: Mapping[str, Any] | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(detail)
        self.code = code
        self.detail = detail
        self.errors = tuple(errors)
        self.extensions = dict(extensions or {})
        self.headers = dict(headers or {})


class MalformedJson(RequestError):
    """The body is no JSON (RFC 8259) in UTF-8, or has a name twice in one object."""

    def __init__(self, reason: str) -> None:
        super().__init__("malformed-json", said("the body is not JSON in UTF-8: {why}", why=reason))
        self.reason = reason


class InvalidBody(RequestError):
    """The body's fields are not those of the request, or hold what they cannot.

    Parameters
    ----------
    errors
        At least one.
    all_listed
        False where the check ended before the body did.
    built
        How many errors the validator has made.
    """

    def __init__(self, errors: Sequence[FieldError], *, all_listed: bool = True, built: int = 0) -> None:
        first, others = errors[0], len(errors) - 1
        more = f" (and {'' if all_listed else 'at least '}{others} more)" if others else ""
        super().__init__(
            "invalid-request",
            f"{first.parameter or first.pointer or 'the body'}: {first.detail}{more}",
            errors=errors,
        )
        self.built = built


class UnsupportedMediaType(RequestError):
    """The body is not sent as JSON."""

    def __init__(self, given: str) -> None:
        super().__init__(
            "unsupported-media-type",
            said(
                "the body's content type is {given}, it has to be application/json",
                given=given or noun("not given"),
            ),
            headers={"Accept": "application/json"},
        )


class UnsupportedContentEncoding(RequestError):
    """The body is sent compressed."""

    def __init__(self, given: str) -> None:
        super().__init__(
            "unsupported-media-type",
            said("the body's content encoding is {given}, it has to be sent as it is", given=given),
            headers={"Accept-Encoding": "identity"},
        )


class BodyTooLarge(RequestError):
    """The body has more bytes than are taken."""

    def __init__(self, limit: int, announced: int | None) -> None:
        if announced is None:
            detail = said("at most {limit} bytes are taken, the body has more", limit=limit)
        else:
            detail = said(
                "at most {limit} bytes are taken, the body has {size} bytes", limit=limit, size=announced
            )
        super().__init__("body-too-large", detail, extensions={"limit": limit})


class BatchTooLarge(RequestError):
    """A batch has more allocations than are taken."""

    def __init__(self, limit: int, given: int) -> None:
        detail = said(
            "at most {limit} allocations are taken at once, the batch has {count}", limit=limit, count=given
        )
        super().__init__(
            "batch-too-large",
            detail,
            errors=[FieldError(pointer="/problems", detail=detail)],
            extensions={"limit": limit},
        )


class NotReady(RequestError):
    """A part of the service does not answer."""

    def __init__(self, reason: str) -> None:
        super().__init__("not-ready", reason, headers={"Retry-After": "1"})


class JobCancelled(RequestError):
    """A job that somebody waits for was cancelled before it had a plan."""

    def __init__(self, job_id: str) -> None:
        super().__init__(
            "job-cancelled",
            said("job {id} was cancelled before it had a plan", id=job_id),
            extensions={"job_id": job_id},
        )


class JobFailed(RequestError):
    """A job that somebody waits for ended with an error, which is answered as if it were the request's own.

    Parameters
    ----------
    job_id, error
        The job and its error object.
    blamed
        Pointer of the field at fault where the error names none.
    """

    def __init__(self, job_id: str, error: Mapping[str, Any], blamed: str | None = None) -> None:
        detail = from_record(error)
        errors = [FieldError(**violation) for violation in error["violations"]]
        if not errors and blamed is not None:
            errors = [FieldError(pointer=blamed, detail=detail)]
        super().__init__(
            error["code"],
            detail,
            errors=errors,
            extensions={**error["details"], "job_id": job_id},
        )


class JobWithoutCheckpoint(RequestError):
    """A job is to be registered that has learned nothing."""

    def __init__(self, job_id: str, status: str, *, could_keep: bool) -> None:
        job = {"id": job_id, "status": str(status)}
        if could_keep:
            detail = said(
                "job {id} ({status}) has left no checkpoint that could be registered; an allocation keeps "
                'what it learns if it is sent with "keep_checkpoint": true',
                **job,
            )
        else:
            detail = said("job {id} ({status}) has left no checkpoint that could be registered", **job)
        super().__init__("job-without-checkpoint", detail)


class ExampleNotFound(RequestError):
    """No example has that name."""

    def __init__(self, name: str) -> None:
        super().__init__("not-found", said("there is no example {name!r}", name=name))
