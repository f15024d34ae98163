"""The policy library: register, list, compare, download, delete."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Body, Header, Query
from starlette.concurrency import run_in_threadpool
from starlette.responses import JSONResponse, Response

from app.api.job_answers import accepted, answer_of, idempotency
from app.api.job_kinds import REGISTER, TRAIN
from app.api.job_models import JobModel
from app.api.json_body import JsonRoute
from app.api.library_models import (
    PolicyList,
    PolicyModel,
    RegisterJob,
    RegisterTraining,
    Registration,
    SimilarList,
    SimilarRequest,
    policy_list,
    policy_model,
    similar_list,
)
from app.api.openapi_examples import REGISTRATION_EXAMPLES, SIMILAR_EXAMPLES
from app.api.problem_details import responses
from app.api.problem_models import to_problem
from app.api.registration import checkpoint_payload, job_payload, training_payload
from app.api.routes.parameters import LOCATION, Cursor, IdempotencyKey, PolicyId
from app.api.services import Served
from app.library.description import description_space, task_description
from app.library.summary import SUMMARY_SPACE, task_summary
from app.solvers.registry import unusable_architecture

router = APIRouter(prefix="/library", route_class=JsonRoute, tags=["library"])


@router.post(
    "",
    status_code=201,
    summary="Register a source policy",
    response_model=PolicyModel,
    response_description="Registered",
    responses={
        201: {"headers": LOCATION},
        202: {
            "model": JobModel,
            "description": "The training has been accepted as a job",
            "headers": LOCATION,
        },
        **responses(
            "malformed-json",
            "job-not-found",
            "job-without-checkpoint",
            "job-cancelled",
            "body-too-large",
            "unsupported-media-type",
            "invalid-request",
            "invalid-problem",
            "problem-too-large",
            "invalid-checkpoint",
            "unknown-algorithm",
            "invalid-parameters",
            "idempotency-key-reused",
            "queue-full",
            "draining",
        ),
    },
)
async def register_policy(
    body: Annotated[Registration, Body(openapi_examples=REGISTRATION_EXAMPLES)],
    services: Served,
    idempotency_key: IdempotencyKey = None,
) -> Any:
    """Register a source policy, in one of three ways.

    `checkpoint`: weights that were trained elsewhere. `train`: a job trains them and registers them at its
    end. `job_id`: what an earlier allocation or training has learned. Weights are checked before they are
    taken: exactly the tensors of a known architecture that fit the task, all of them finite.
    """
    if isinstance(body, RegisterTraining):
        payload = training_payload(body, services)
        job, _ = await services.jobs.submit(
            TRAIN, payload, idempotency=idempotency(idempotency_key, TRAIN, body)
        )
        return accepted(job)
    if isinstance(body, RegisterJob):
        payload, blamed = await job_payload(body, services), "/job_id"
    else:
        payload, blamed = checkpoint_payload(body, services), "/checkpoint"
    job, _ = await services.jobs.submit(
        REGISTER, payload, idempotency=idempotency(idempotency_key, REGISTER, body)
    )
    answer = answer_of(await services.jobs.wait(job.id, None), blamed)
    policy = await run_in_threadpool(services.library.get, answer["policy_id"])
    return JSONResponse(
        policy_model(policy).model_dump(mode="json"), 201, {"Location": f"/library/{policy.id}"}
    )


@router.get(
    "",
    summary="List the source policies",
    response_model=PolicyList,
    responses=responses("invalid-request", "invalid-cursor"),
)
def list_policies(
    services: Served,
    limit: Annotated[int, Query(ge=1, le=100, description="Policies a page")] = 20,
    cursor: Cursor = None,
) -> PolicyList:
    """List the source policies, newest first, without their tasks."""
    return policy_list(services.library.page(limit, cursor))


@router.post(
    "/similar",
    summary="Find similar source tasks",
    response_model=SimilarList,
    responses=responses(
        "malformed-json",
        "body-too-large",
        "unsupported-media-type",
        "invalid-request",
        "invalid-problem",
        "problem-too-large",
    ),
)
def find_similar(
    body: Annotated[SimilarRequest, Body(openapi_examples=SIMILAR_EXAMPLES)], services: Served
) -> SimilarList:
    """Compare a task with the source tasks (lines 1 to 6 of Algorithm 2), nearest first.

    Policies that cannot serve the task are left out: those for one size, where it uses a field that paper
    mode refuses (`GET /algorithms`).
    """
    task = to_problem(body.task, services.settings, "/task")
    if body.similarity == "paper":
        space, vector = description_space(task), task_description(task)
    else:
        space, vector = SUMMARY_SPACE, task_summary(task)
    without = unusable_architecture(task)
    return similar_list(services.library.nearest(space, vector, body.k, without=without))


@router.get(
    "/{policy_id}",
    summary="Get a source policy",
    response_model=PolicyModel,
    responses=responses("policy-not-found", "invalid-request"),
)
def get_policy(policy_id: PolicyId, services: Served) -> PolicyModel:
    """Return a source policy with its task and what its checkpoint says of itself."""
    return policy_model(services.library.get(policy_id))


@router.get(
    "/{policy_id}/checkpoint",
    summary="Download a checkpoint",
    response_class=Response,
    responses={
        200: {
            "description": "A safetensors file",
            "headers": {"ETag": {"description": "Its SHA-256, in quotes", "schema": {"type": "string"}}},
            "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        },
        304: {"description": "It is the one that `If-None-Match` names"},
        **responses("policy-not-found", "invalid-request", "damaged-checkpoint"),
    },
)
def get_checkpoint(
    policy_id: PolicyId,
    services: Served,
    if_none_match: Annotated[str | None, Header(description="`ETag`s that are known already")] = None,
) -> Response:
    """Return the weights of a source policy as they were registered."""
    policy = services.library.get(policy_id)
    etag = f'"{policy.checkpoint_sha256}"'
    headers = {"ETag": etag, "Cache-Control": "no-cache"}
    known = {tag.strip().removeprefix("W/") for tag in (if_none_match or "").split(",")}
    if etag in known or "*" in known:
        return Response(status_code=304, headers=headers)
    headers["Content-Disposition"] = f'attachment; filename="{policy.id}.safetensors"'
    return Response(services.library.checkpoint(policy_id), 200, headers, "application/octet-stream")


@router.delete(
    "/{policy_id}",
    status_code=204,
    summary="Delete a source policy",
    responses=responses("policy-not-found", "invalid-request"),
)
def delete_policy(policy_id: PolicyId, services: Served) -> None:
    """Delete a source policy. Plans that were found with it stay."""
    services.library.delete(policy_id)
