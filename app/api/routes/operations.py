"""Is the service alive, is it ready, and what does it do."""

from __future__ import annotations

from fastapi import APIRouter
from prometheus_client import CONTENT_TYPE_PLAIN_0_0_4
from pydantic import Field
from sqlalchemy.exc import SQLAlchemyError
from starlette.responses import Response

import app
from app.api.allocation_models import AnswerModel
from app.api.errors import NotReady
from app.api.problem_details import responses
from app.api.services import Served
from app.domain.said import said

router = APIRouter(tags=["operations"])


class Health(AnswerModel):
    """The process answers."""

    status: str = Field(description="ok")
    version: str = Field(description="Version of the service")


class Readiness(AnswerModel):
    """Store and workers answer."""

    status: str = Field(description="ready")
    workers_ready: int = Field(description="Workers that are warm, busy or not")
    workers: int = Field(description="Workers there are when all are well")
    jobs_running: int = Field(description="Jobs that run")
    jobs_waiting: int = Field(description="Jobs that wait")
    policies: int = Field(description="Source policies in the library")


@router.get("/healthz", summary="Liveness", response_model=Health, responses=responses())
async def get_health() -> Health:
    """Answer 200 as long as the process does."""
    return Health(status="ok", version=app.__version__)


@router.get("/readyz", summary="Readiness", response_model=Readiness, responses=responses("not-ready"))
def get_readiness(services: Served) -> Readiness:
    """Answer 200 once the store and a warm worker answer, 503 otherwise."""
    try:
        policies, waiting = services.library.count(), services.jobs.waiting()
    except SQLAlchemyError as error:
        raise NotReady(said("the store does not answer: {why}", why=type(error).__name__)) from error
    load = services.jobs.load()
    if load.ready == 0:
        raise NotReady(
            said(
                "none of {count} workers is ready yet; the first start compiles for minutes",
                count=load.capacity,
            )
        )
    return Readiness(
        status="ready",
        workers_ready=load.ready,
        workers=load.capacity,
        jobs_running=sum(load.running.values()),
        jobs_waiting=sum(waiting.values()),
        policies=policies,
    )


@router.get(
    "/metrics",
    summary="Metrics",
    response_class=Response,
    responses={
        200: {
            "description": "Prometheus' text format",
            "content": {"text/plain": {"schema": {"type": "string"}}},
        },
        **responses(),
    },
)
def get_metrics(services: Served) -> Response:
    """Return counts, durations and levels for Prometheus."""
    return Response(services.metrics.render(), media_type=CONTENT_TYPE_PLAIN_0_0_4)
