"""From a request for an evaluation to the payload of its job."""

from __future__ import annotations

from typing import Any

from app.api.evaluation_models import EvaluationRequest
from app.api.problem_models import to_problem
from app.domain.errors import InvalidProblem, Violation
from app.domain.records import problem_to_record
from app.settings import Settings


def evaluation_payload(body: EvaluationRequest, settings: Settings) -> dict[str, Any]:
    """Return what is to be evaluated.

    Raises
    ------
    ProblemTooLarge, InvalidProblem
        As :func:`app.api.problem_models.to_problem` does, or if the plan has rows of another length than the
        swarm has UAVs.
    """
    problem = to_problem(body, settings)
    violations = [
        Violation(f"/assignment/{s}", f"{len(row)} actions for {problem.n_uavs} UAVs")
        for s, row in enumerate(body.assignment)
        if len(row) != problem.n_uavs
    ]
    if violations:
        raise InvalidProblem.of(violations)
    payload: dict[str, Any] = {"problem": problem_to_record(problem), "assignment": body.assignment}
    if body.bound:
        payload["bound_time_limit_s"] = body.bound_time_limit_s
    if body.at is not None:
        payload["at"] = body.at
    return payload
