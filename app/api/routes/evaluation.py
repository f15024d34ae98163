"""POST /evaluate: what a plan of somebody's own earns, and which of its actions break a rule."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Body, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app.api.evaluation_models import Evaluation, EvaluationRequest
from app.api.evaluation_payload import evaluation_payload
from app.api.job_answers import gone, written_answer_of
from app.api.job_kinds import EVALUATE
from app.api.json_body import JsonRoute
from app.api.openapi_examples import EVALUATION_EXAMPLES
from app.api.problem_details import responses
from app.api.routes.allocation import CLIENT_HAS_GONE
from app.api.services import Served

router = APIRouter(route_class=JsonRoute, tags=["allocation"])


@router.post(
    "/evaluate",
    summary="Evaluate a plan",
    response_model=Evaluation,
    response_description="What the plan earns and does",
    responses=responses(
        "malformed-json",
        "job-cancelled",
        "body-too-large",
        "unsupported-media-type",
        "invalid-request",
        "invalid-problem",
        "problem-too-large",
        "illegal-plan",
        "queue-full",
        "draining",
        "time-limit-exceeded",
    ),
)
async def evaluate(
    body: Annotated[EvaluationRequest, Body(openapi_examples=EVALUATION_EXAMPLES)],
    request: Request,
    services: Served,
) -> Any:
    """Replay a plan: the same answer as an allocation of that plan, without any search.

    An illegal plan is refused with every action that breaks a rule; `breaches` has the figures. With `at` the
    answer has the problem that remains at that moment, ready for `POST /allocate`.
    """
    # Flight files may be long.
    payload = await run_in_threadpool(evaluation_payload, body, services.settings)
    job, _ = await services.jobs.submit(EVALUATE, payload)
    ended = await services.jobs.wait_for_client(job.id, None, gone(request))
    if ended is None:
        return Response(status_code=CLIENT_HAS_GONE)
    return Response(written_answer_of(ended, {}), media_type="application/json")
