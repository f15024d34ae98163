"""POST /allocate: which UAV flies where, with what."""

from __future__ import annotations

import time
from typing import Annotated, Any

from fastapi import APIRouter, Body, Request
from starlette.responses import Response

from app.api.allocation_models import SOMETIMES_ANSWERED, Allocation, AllocationRequest
from app.api.allocation_payload import allocation_payload
from app.api.job_answers import accepted, gone, idempotency, written_answer_of
from app.api.job_kinds import ALLOCATE
from app.api.job_models import JobModel
from app.api.json_body import JsonRoute
from app.api.openapi_examples import ALLOCATION_EXAMPLES
from app.api.preferences import Preferences
from app.api.problem_details import responses
from app.api.routes.parameters import LOCATION, IdempotencyKey, Prefer
from app.api.services import Served

_FIELDS: dict[str, Any] = {
    name: field.get_default(call_default_factory=True)
    for name, field in Allocation.model_fields.items()
    if name not in SOMETIMES_ANSWERED
}
"""With their defaults: a retry with its key may ask for what an earlier version answered."""

router = APIRouter(route_class=JsonRoute, tags=["allocation"])

CLIENT_HAS_GONE = 499
"""Of an answer that nobody gets: what the log and the metrics say of it, as those of other servers do."""


@router.post(
    "/allocate",
    summary="Allocate tasks to a swarm",
    response_model=Allocation,
    response_description="The plan",
    responses={
        202: {
            "model": JobModel,
            "description": "Accepted: the job goes on, see `Location`",
            "headers": LOCATION,
        },
        **responses(
            "malformed-json",
            "no-compatible-source",
            "job-cancelled",
            "body-too-large",
            "unsupported-media-type",
            "invalid-request",
            "invalid-problem",
            "problem-too-large",
            "unknown-algorithm",
            "invalid-parameters",
            "idempotency-key-reused",
            "queue-full",
            "draining",
            "time-limit-exceeded",
        ),
    },
)
async def allocate(
    body: Annotated[AllocationRequest, Body(openapi_examples=ALLOCATION_EXAMPLES)],
    request: Request,
    services: Served,
    prefer: Prefer = None,  # noqa: ARG001 - documents the header; several of it are read from the request
    idempotency_key: IdempotencyKey = None,
) -> Any:
    """Find a plan for a problem.

    The call waits for the plan and answers 200. With `Prefer: respond-async` it answers 202 at once, with
    `Prefer: wait=N` after N seconds at most; `Location` is then the job to poll, to listen to, or to cancel.
    If the client closes the connection before, the job is cancelled, unless an `Idempotency-Key` lets it come
    again or somebody else follows the job.
    """
    payload = allocation_payload(body, services)
    job, _ = await services.jobs.submit(
        ALLOCATE,
        # Not part of what makes a request the same: an operator may change it between two tries.
        payload | {"threads": services.settings.threads_per_job},
        time_limit_s=_left(body.time_limit_s, request),
        idempotency=idempotency(idempotency_key, ALLOCATE, body),
    )
    preferences = Preferences.of(request.headers.getlist("prefer"))
    patience_s = preferences.patience_s
    if patience_s == 0:
        return accepted(job, preferences)
    if idempotency_key is not None:
        job = await services.jobs.wait(job.id, patience_s)
    elif (ended := await services.jobs.wait_for_client(job.id, patience_s, gone(request))) is None:
        return Response(status_code=CLIENT_HAS_GONE)
    else:
        job = ended
    if patience_s is not None and not job.status.finished:
        return accepted(job, preferences)
    return Response(
        # Checked where it was made: to check it once more would hold up everybody else.
        written_answer_of(job, _FIELDS),
        media_type="application/json",
        headers={"Preference-Applied": preferences.applied} if preferences.applied else None,
    )


def _left(time_limit_s: float | None, request: Request) -> float | None:
    """Return what is left of a time limit that began with the request's arrival."""
    if time_limit_s is None:
        return None
    arrived_s: float = request.state.arrived_s
    return max(0.0, time_limit_s - (time.monotonic() - arrived_s))
