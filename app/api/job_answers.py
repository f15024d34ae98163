"""From a job to a response: waiting for it, its result, or where to find it later."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from starlette.responses import JSONResponse

from app.api.access.guard import client
from app.api.errors import JobCancelled, JobFailed
from app.api.job_models import job_model, result_of
from app.api.preferences import Preferences
from app.jobs.errors import Draining
from app.jobs.model import Idempotency, Job, JobStatus


def idempotency(
    key: str | None, kind: str, payload: dict[str, Any], time_limit_s: float | None = None
) -> Idempotency | None:
    """Make the promise of an ``Idempotency-Key``: the same key comes with the same request only.

    What is compared is the request as it was understood, so that a default which is spelled out, or another
    order of fields, is the same request. Keys of the service tell its clients apart.
    """
    if key is None:
        return None
    text = json.dumps([kind, payload, time_limit_s], sort_keys=True)
    return Idempotency(client.get(), key, hashlib.sha256(text.encode()).hexdigest())


def accepted(job: Job, preferences: Preferences | None = None) -> JSONResponse:
    """Answer 202 with the job and where to follow it."""
    headers = {"Location": f"/jobs/{job.id}"}
    if preferences is not None and preferences.applied:
        headers["Preference-Applied"] = preferences.applied
    return JSONResponse(job_model(job).model_dump(mode="json"), 202, headers)


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
    if not job.status.finished:
        raise Draining
    if job.status is JobStatus.FAILED and job.error is not None:
        raise JobFailed(job.id, job.error, blamed)
    result = result_of(job)
    if result is None:
        raise JobCancelled(job.id)
    return result
