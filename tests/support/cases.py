"""Small requests that once got a wrong answer, from ``tests/cases``."""

import json
from pathlib import Path
from typing import Any

from app.api.allocation_models import AllocationRequest
from app.api.problem_models import to_problem
from app.domain.problem import Problem
from app.settings import Settings

FOLDER = Path(__file__).resolve().parents[1] / "cases"
_OF_PROBLEM = ("uavs", "targets", "max_steps", "crs", "objective")


def case(name: str) -> dict[str, Any]:
    """A request; of a file that has a problem beside other things, the problem."""
    content = json.loads((FOLDER / f"{name}.json").read_text("utf-8"))
    return content.get("problem", content)


def problem_of(name: str) -> Problem:
    """The problem of a request, as the service takes it."""
    return to_problem(
        AllocationRequest(**{k: v for k, v in case(name).items() if k in _OF_PROBLEM}), Settings()
    )
