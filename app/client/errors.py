"""What a client raises.

ClientError
 ├─ ServiceUnreachable      no answer came, for as long as was tried
 ├─ StreamCutOff            a stream ended before its end, and could not be taken up again
 ├─ ServiceError            the service has answered with an error: problem details (RFC 9457)
 └─ JobEnded                a job ended without what was asked of it
     ├─ JobFailed           it failed
     └─ JobCancelled        it was cancelled before it had a result
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .types import FieldError, Job


class ClientError(Exception):
    """Root of the tree."""


class ServiceUnreachable(ClientError):
    """No answer came, for as long as was tried; whether the request was carried out is not known."""


class StreamCutOff(ClientError):
    """A stream ended before its end, and could not be taken up again."""


class ServiceError(ClientError):
    """The service has answered with an error.

    Parameters
    ----------
    status
        Of the response.
    problem
        Its body; empty where something between has answered.
    request_id
        ``X-Request-ID`` of the response, under which the service's log has more.
    retry_after_s
        Seconds after which the service asks to be asked again; None where it says nothing of it.

    Attributes
    ----------
    type
        Name of the problem, such as ``invalid-request``; ``problem["type"]`` leads to what it means and what
        to do about it, on a page of the service.
    title, detail
        What is wrong, for people.
    errors
        Field by field, where that is known: a JSON pointer into the body or the name of a parameter, and
        what is wrong there.
    """

    def __init__(
        self,
        status: int,
        problem: Mapping[str, Any],
        *,
        request_id: str | None = None,
        retry_after_s: float | None = None,
    ) -> None:
        self.status = status
        self.problem = dict(problem)
        self.type: str = problem.get("type", "about:blank").rpartition("#")[2]
        self.title: str = problem.get("title", "")
        self.detail: str = problem.get("detail", f"the service has answered {status}")
        self.errors: list[FieldError] = problem.get("errors") or []
        self.request_id, self.retry_after_s = request_id, retry_after_s
        lines = [f"{each.get('parameter') or each['pointer']}: {each['detail']}" for each in self.errors]
        said = f"{status} {self.type}: {self.detail}"
        # The detail has the first one in it, where it is about fields.
        super().__init__("\n".join([said, *(line for line in lines if line not in said)]))


class JobEnded(ClientError):
    """A job ended without what was asked of it.

    Parameters
    ----------
    job
        As it ended.
    """

    def __init__(self, job: Job) -> None:
        self.job = job
        error = job["error"]
        why = "" if error is None else f": {error['type'].rpartition('#')[2]}: {error['detail']}"
        super().__init__(f"job {job['id']} {job['status']}{why}")


class JobFailed(JobEnded):
    """It failed; ``job["error"]`` says why."""


class JobCancelled(JobEnded):
    """It was cancelled before it had a result."""
