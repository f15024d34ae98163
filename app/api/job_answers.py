"""From a job to a response: waiting for it, its result, or where to find it later."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from fastapi import Request
from starlette.responses import Response

from app.api.access.guard import client
from app.api.errors import JobCancelled, JobFailed
from app.api.job_models import job_response, result_of, written_result_of
from app.api.preferences import Preferences
from app.api.wire_fields import WireModel
from app.jobs.errors import Draining
from app.jobs.model import Idempotency, Job, JobStatus
from app.jobs.stored_json import StoredJson, write


def idempotency(key: str | None, kind: str, body: WireModel) -> Idempotency | None:
    """Make the promise of an ``Idempotency-Key``: the same key comes with the same request only.

    What is compared is what the client sent, whatever order its fields had: a default may have another value
    in the version of the service that gets the retry. Keys of the service tell its clients apart.
    """
    if key is None:
        return None
    text = json.dumps([kind, body.model_dump(mode="json", exclude_unset=True)], sort_keys=True)
    return Idempotency(client.get(), key, hashlib.sha256(text.encode()).hexdigest())


def accepted(job: Job, preferences: Preferences | None = None) -> Response:
    """Answer 202 with the job and where to follow it."""
    headers = {"Location": f"/jobs/{job.id}"}
    if preferences is not None and preferences.applied:
        headers["Preference-Applied"] = preferences.applied
    return job_response(job, None if job.result is None else write(job.result), 202, headers)


async def gone(request: Request) -> None:
    """Return when the client of a request, whose body was read, has closed the connection."""
    while (await request.receive())["type"] != "http.disconnect":
        continue


def answer_of(job: Job, blamed: str | None = None) -> dict[str, Any]:
    """Return the result of a job that was waited for.

    Parameters
    ----------
    job
        The job as the waiting left it.
    blamed
        Pointer of the request's field that is at fault if the job failed and does not say which is.

    Raises
    ------
    JobFailed
        If it failed.
    JobCancelled
        If it was cancelled before it had a result.
    Draining
        If it has not ended, because the service stops; it goes on with the next start.
    """
    _require_result(job, blamed)
    result = result_of(job)
    assert result is not None
    return result


def written_answer_of(job: Job, fields: Mapping[str, Any]) -> str:
    """Return the same as JSON, with the defaults of fields that an earlier version did not answer.

    Fields of the answer that have no default here are kept.

    Raises
    ------
    JobFailed, JobCancelled, Draining
        As :func:`answer_of` does.
    """
    _require_result(job, None)
    if isinstance(job.result, StoredJson) and job.result.is_new:
        text = written_result_of(job)
        assert text is not None
        return text
    answer = answer_of(job)
    return write({name: answer.get(name, default) for name, default in fields.items()} | answer)


def _require_result(job: Job, blamed: str | None) -> None:
    if not job.status.finished:
        raise Draining
    if job.status is JobStatus.FAILED and job.error is not None:
        raise JobFailed(job.id, job.error, blamed)
    if job.result is None:
        raise JobCancelled(job.id)
