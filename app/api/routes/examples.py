"""Example problems that can be sent as they are."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path
from pydantic import Field
from starlette.responses import JSONResponse

from app.api.allocation_models import AnswerModel
from app.api.errors import ExampleNotFound
from app.api.openapi_examples import example_names, example_problem
from app.api.problem_details import responses
from app.api.problem_models import ProblemModel

router = APIRouter(prefix="/examples", tags=["allocation"])


class ExampleModel(AnswerModel):
    """A shipped example problem."""

    name: str = Field(description="Its name")
    href: str = Field(description="Where it is")


class ExampleList(AnswerModel):
    """The shipped example problems."""

    examples: list[ExampleModel] = Field(description="All of them")


@router.get("", summary="List the examples", response_model=ExampleList, responses=responses())
def list_examples() -> ExampleList:
    """List the example problems."""
    return ExampleList(
        examples=[ExampleModel(name=name, href=f"/examples/{name}") for name in example_names()]
    )


@router.get(
    "/{name}",
    summary="Get an example",
    response_model=ProblemModel,
    responses=responses("not-found", "invalid-request"),
)
def get_example(
    name: Annotated[str, Path(description="Its name", examples=["paper-5x10"])],
) -> Any:
    """Return an example problem, ready for `POST /allocate`."""
    if name not in example_names():
        raise ExampleNotFound(name)
    return JSONResponse(example_problem(name))
