"""GET /algorithms: what can be asked for, with its parameters."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter
from pydantic import Field

from app.api.allocation_models import AnswerModel
from app.api.problem_details import responses
from app.solvers.registry import ALGORITHMS, Algorithm

router = APIRouter(tags=["allocation"])


class UnsupportedModel(AnswerModel):
    """A field of a problem that an algorithm refuses."""

    field: str = Field(description="Its name, such as `no_fly_zones` or `objective.half_life`")
    mode: str | None = Field(description="In which `mode` of the algorithm; null: it has none")
    reason: str = Field(description="Why, and what to do instead")


class AlgorithmModel(AnswerModel):
    """One algorithm."""

    name: str = Field(description="As `algorithm` in `POST /allocate`")
    summary: str = Field(description="What it does")
    learns: bool = Field(description="Whether the library can hold what it learns")
    comparison: bool = Field(
        description="Whether it is there to be compared with: its plans may earn less than the greedy rule's"
    )
    unsupported: list[UnsupportedModel] = Field(
        description="Fields of a problem that it refuses with 422; it takes all others"
    )
    parameters: dict[str, Any] = Field(description="JSON schema of its parameters")
    defaults: dict[str, Any] = Field(description="Its parameters where none are given")


class AlgorithmList(AnswerModel):
    """The algorithms."""

    algorithms: list[AlgorithmModel] = Field(description="All of them")


@router.get("/algorithms", summary="List the algorithms", response_model=AlgorithmList, responses=responses())
def list_algorithms() -> AlgorithmList:
    """List the algorithms: parameters with schema, limits and defaults, and fields that they refuse."""
    return AlgorithmList(algorithms=[_describe(algorithm) for algorithm in ALGORITHMS.values()])


def _describe(algorithm: Algorithm) -> AlgorithmModel:
    model = algorithm.parameter_model()
    return AlgorithmModel(
        name=algorithm.name,
        summary=algorithm.summary,
        learns=algorithm.learns,
        comparison=algorithm.comparison,
        unsupported=[UnsupportedModel(**each._asdict()) for each in algorithm.unsupported()],
        parameters=model.model_json_schema(),
        defaults=model().model_dump(mode="json"),
    )
