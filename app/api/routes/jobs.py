"""Jobs: list, poll, listen, cancel."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import aclosing
from typing import Annotated

from fastapi import APIRouter, Query
from sse_starlette import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app.api.access.guard import key_is_valid
from app.api.event_streams import LastEventId, event_stream, last_seen
from app.api.job_models import JobList, JobModel, job_list, job_response, problem_of
from app.api.problem_details import responses
from app.api.problem_models import ProblemModel
from app.api.routes.parameters import Cursor, JobId
from app.api.services import Served
from app.jobs.model import JobStatus
from app.jobs.service import JobService
from app.jobs.stored_json import write

router = APIRouter(prefix="/jobs", tags=["jobs"])

_EVENT = {
    "description": "One event",
    "type": "object",
    "properties": {
        "id": {"type": "string", "pattern": "^[0-9]+$", "description": "For `Last-Event-ID`"},
        "event": {"type": "string", "enum": ["progress", "end"]},
        "data": {"type": "string", "contentMediaType": "application/json"},
    },
    "required": ["id", "event", "data"],
}


@router.get(
    "",
    summary="List the jobs",
    response_model=JobList,
    responses=responses("invalid-request", "invalid-cursor"),
)
async def list_jobs(
    services: Served,
    limit: Annotated[int, Query(ge=1, le=100, description="Jobs a page")] = 20,
    cursor: Cursor = None,
    status: Annotated[JobStatus | None, Query(description="Only jobs of this status")] = None,
) -> JobList:
    """List the jobs, newest first, without plans and results. New jobs do not shift the pages that follow."""
    return job_list(await services.jobs.list(limit, cursor, status))


@router.get(
    "/{job_id}",
    summary="Poll a job",
    response_model=JobModel,
    responses=responses("job-not-found", "invalid-request"),
)
async def get_job(job_id: JobId, services: Served) -> Response:
    """Return a job: its progress and the best plan so far, at its end the result or the error."""
    job = await services.jobs.look(job_id)
    return job_response(job, await services.jobs.result_text(job_id) if job.status.finished else None)


@router.get(
    "/{job_id}/problem",
    summary="Read the problem of a job",
    response_model=ProblemModel,
    response_model_exclude_defaults=True,
    response_description="The problem, without what is the default anyway",
    responses=responses("job-not-found", "invalid-request"),
)
async def get_job_problem(job_id: JobId, services: Served) -> ProblemModel:
    """Return the problem that a job was given, as `POST /allocate` takes it; all ids are filled in."""
    job = await services.jobs.get(job_id)
    return await run_in_threadpool(problem_of, job)


@router.get(
    "/{job_id}/events",
    summary="Listen to a job",
    response_class=EventSourceResponse,
    responses={
        200: {
            "description": "Server-sent events: `progress` with the fields of a job's progress, and one "
            "`end`, which has its `status` too",
            "content": {"text/event-stream": {"schema": _EVENT}},
        },
        204: {"description": "The job has ended, and `Last-Event-ID` is its last event: there are no more"},
        **responses("job-not-found", "invalid-request"),
    },
)
async def get_job_events(
    job_id: JobId,
    services: Served,
    last_event_id: LastEventId = None,
) -> Response:
    """Stream a job's progress until it ends; a client that was cut off goes on after its last event."""
    job = await services.jobs.look(job_id)  # an unknown job is answered before the stream begins
    after = last_seen(last_event_id)
    if services.jobs.has_told_all(job, after):
        return Response(status_code=204)
    return event_stream(_events(services.jobs, job_id, after, key_is_valid.get()))


@router.delete(
    "/{job_id}",
    summary="Cancel a job",
    response_model=JobModel,
    response_description="The job had ended, or has now",
    responses={
        202: {"model": JobModel, "description": "The job will stop"},
        **responses("job-not-found", "invalid-request", "draining"),
    },
)
async def cancel_job(job_id: JobId, services: Served) -> Response:
    """Cancel a job. One that is running stops soon, and the best plan so far becomes its result."""
    job = await services.jobs.cancel(job_id)
    result = None if job.result is None else write(job.result)
    return job_response(job, result, 200 if job.status.finished else 202)


async def _events(
    jobs: JobService, job_id: str, after: int, allowed: Callable[[], Awaitable[bool]] | None
) -> AsyncIterator[ServerSentEvent]:
    """Yield a job's events until it ends, the server stops, or the client may not have them any more."""
    async with aclosing(jobs.events(job_id, after, allowed)) as events:
        async for event in events:
            yield ServerSentEvent(event.text, event=event.name, id=str(event.id))
