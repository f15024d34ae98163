"""GET /algorithms: what can be asked for, with its parameters."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from pydantic import Field

from app.api.allocation_models import AnswerModel
from app.api.problem_details import responses
from app.solvers.registry import ALGORITHMS, Algorithm

router = APIRouter(tags=["allocation"])


class AlgorithmModel(AnswerModel):
    """One algorithm."""

    name: str = Field(description="As `algorithm` in `POST /allocate`")
    summary: str = Field(description="What it does")
    learns: bool = Field(description="Whether the library can hold what it learns")
    parameters: dict[str, Any] = Field(description="JSON schema of its parameters")
    defaults: dict[str, Any] = Field(description="Its parameters where none are given")


class AlgorithmList(AnswerModel):
    """The algorithms."""

    algorithms: list[AlgorithmModel] = Field(description="All of them")


@router.get("/algorithms", summary="List the algorithms", response_model=AlgorithmList, responses=responses())
def list_algorithms() -> AlgorithmList:
    """List the algorithms with their parameters: schema, limits, defaults."""
    return AlgorithmList(algorithms=[_describe(algorithm) for algorithm in ALGORITHMS.values()])


def _describe(algorithm: Algorithm) -> AlgorithmModel:
    model = algorithm.parameter_model()
    return AlgorithmModel(
        name=algorithm.name,
        summary=algorithm.summary,
        learns=algorithm.learns,
        parameters=model.model_json_schema(),
        defaults=model().model_dump(mode="json"),
    )
