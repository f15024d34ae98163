"""POST /allocate/batch: many allocations, each answered when it is done."""

from __future__ import annotations

import hashlib
from collections.abc import AsyncIterator
from functools import partial
from typing import Annotated

from fastapi import APIRouter, Body, Request
from starlette.responses import Response, StreamingResponse

from app.api.allocation_models import Allocation
from app.api.allocation_payload import allocation_payload
from app.api.batch import Ended, Submission
from app.api.batch_models import BatchItem, BatchLine, BatchRequest
from app.api.error_handlers import problem_of
from app.api.job_answers import answer_of, idempotency
from app.api.job_kinds import BATCH
from app.api.json_body import JsonRoute
from app.api.openapi_examples import BATCH_EXAMPLES
from app.api.problem_details import responses
from app.api.routes.parameters import IdempotencyKey
from app.api.services import Served, Services
from app.jobs.model import Job

router = APIRouter(route_class=JsonRoute, tags=["allocation"])

NDJSON = "application/x-ndjson"


@router.post(
    "/allocate/batch",
    summary="Allocate many problems",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "A line of JSON for each allocation, in the order in which they end",
            "content": {NDJSON: {"schema": {"$ref": "#/components/schemas/BatchLine"}}},
        },
        **responses(
            "malformed-json",
            "body-too-large",
            "batch-too-large",
            "unsupported-media-type",
            "invalid-request",
            "queue-full",
            "draining",
        ),
    },
)
async def allocate_batch(
    body: Annotated[BatchRequest, Body(openapi_examples=BATCH_EXAMPLES)],
    request: Request,
    services: Served,
    idempotency_key: IdempotencyKey = None,
) -> Response:
    """Find plans for many problems, on all workers but one, which is left to single requests.

    The answer is streamed: a line for each problem as soon as it is solved, with its `index` in the request,
    its `id` if it has one, and either the `allocation` or the `problem` that it failed with. A request whose
    shape is wrong is refused as a whole.

    Each allocation is a job that waits behind those of `POST /allocate`; its `time_limit_s` counts from when
    its work begins. With an `Idempotency-Key` the jobs go on if the client goes; sent again with the same
    key, the request gets the answers of the first time, and what was not taken in yet is. Without one they
    are cancelled when the client goes, but for those that somebody else follows.
    """
    prepared = [
        partial(_submission, item, services, idempotency_key, index)
        for index, item in enumerate(body.problems)
    ]
    ended = await services.batches.begin(prepared)
    return StreamingResponse(_lines(ended, body.problems, request), media_type=NDJSON)


def _submission(item: BatchItem, services: Services, key: str | None, index: int) -> Submission:
    payload = allocation_payload(item, services)
    if item.time_limit_s is not None:
        payload["run_time_limit_s"] = item.time_limit_s
    own_key = None if key is None else f"batch {hashlib.sha256(key.encode()).hexdigest()} {index}"
    promise = idempotency(own_key, BATCH, item)
    return Submission(payload | {"threads": services.settings.threads_per_job}, promise)


async def _lines(ended: AsyncIterator[Ended], items: list[BatchItem], request: Request) -> AsyncIterator[str]:
    async for index, outcome in ended:
        line = _line(index, items[index].id, outcome, request)
        yield line.model_dump_json(exclude_unset=True) + "\n"


def _line(index: int, identifier: str | None, outcome: Job | Exception, request: Request) -> BatchLine:
    named = {} if identifier is None else {"id": identifier}
    try:
        if isinstance(outcome, Exception):
            raise outcome
        return BatchLine(index=index, **named, allocation=Allocation(**answer_of(outcome)))
    except Exception as error:
        return BatchLine(index=index, **named, problem=problem_of(request, error))
