"""From a request for an evaluation to the payload of its job."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from app.api.evaluation_models import AmountsOfStops, EvaluationRequest
from app.api.plan_formats.flown_routes import ReadFile, ReadPlan, plan_of_files
from app.api.problem_models import to_problem
from app.domain.errors import InvalidProblem, Violation
from app.domain.problem import Problem
from app.domain.records import problem_to_record, to_record
from app.domain.said import said
from app.settings import Settings


def evaluation_payload(body: EvaluationRequest, settings: Settings) -> dict[str, Any]:
    """Return what is to be evaluated.

    Raises
    ------
    ProblemTooLarge, InvalidProblem
        As :func:`app.api.problem_models.to_problem` does, or if there is not one plan, it has rows of another
        length than the swarm has UAVs, amounts that do not fit it, or flight files that say no plan.
    """
    problem = to_problem(body, settings)
    plan = _plan(body, problem)
    payload: dict[str, Any] = {"problem": problem_to_record(problem), "assignment": plan.assignment}
    if plan.warnings:
        payload["warnings"] = to_record(plan.warnings)
    for name, amounts in _amounts(body, problem, plan.assignment).items():
        payload[name] = amounts
    if body.bound:
        payload["bound_time_limit_s"] = body.bound_time_limit_s
    if body.at is not None:
        payload["at"] = body.at
    return payload


def _plan(body: EvaluationRequest, problem: Problem) -> ReadPlan:
    """Return the plan that is to be evaluated, and what is to be said of how it was read.

    Raises
    ------
    InvalidProblem
        If there is none, two, or one that is not of this problem.
    """
    if (body.assignment is None) == (body.flight_files is None):
        detail = said("one of `assignment` and `flight_files` is needed, and only one")
        raise InvalidProblem.of([Violation("/assignment", detail)])
    if body.flight_files is not None:
        files = [ReadFile(each.name, each.uav_id, each.content) for each in body.flight_files]
        return plan_of_files(problem, files, body.match_within)
    assert body.assignment is not None
    violations = [
        Violation(
            f"/assignment/{s}",
            said("{count} actions, but there are {uavs} UAVs", count=len(row), uavs=problem.n_uavs),
        )
        for s, row in enumerate(body.assignment)
        if len(row) != problem.n_uavs
    ]
    if violations:
        raise InvalidProblem.of(violations)
    return ReadPlan(body.assignment, ())


def _amounts(
    body: EvaluationRequest, problem: Problem, assignment: list[list[int]]
) -> dict[str, list[list[list[float]]]]:
    """Return the amounts that are given, as they are planned: all or none.

    Raises
    ------
    InvalidProblem
        If they are not planned, given one without the other, or in another shape than the plan.
    """
    given = {"delivered": body.delivered, "loaded": body.loaded}
    planned = {"delivered": problem.plans_unloading, "loaded": problem.plans_loading}
    violations = []
    for name, amounts in given.items():
        if amounts is not None and not planned[name]:
            rule = "`objective.unloading`" if name == "delivered" else "`objective.loading`, with bases,"
            violations.append(
                Violation(f"/{name}", said("amounts are given, and {rule} is not planned", rule=rule))
            )
    if not violations and len({given[name] is None for name, asked in planned.items() if asked}) > 1:
        missing = next(name for name in given if given[name] is None)
        violations.append(
            Violation(f"/{missing}", said("`delivered` and `loaded` are given together, or neither is"))
        )
    if not violations:
        violations = [
            each
            for name, amounts in given.items()
            if amounts is not None
            for each in _misfits(name, amounts, body, assignment)
        ]
    if violations:
        raise InvalidProblem.of(violations)
    nothing = [0.0] * problem.n_materials
    return {
        name: [[each or nothing for each in row] for row in amounts]
        for name, amounts in given.items()
        if amounts is not None
    }


def _misfits(
    name: str, amounts: AmountsOfStops, body: EvaluationRequest, assignment: list[list[int]]
) -> Iterator[Violation]:
    """Yield where amounts have another shape than the plan, or are below 0 where nothing can be."""
    materials, steps = len(body.uavs[0].loadlist), len(assignment)
    if len(amounts) != steps:
        yield Violation(
            f"/{name}", said("{count} steps, but `assignment` has {steps}", count=len(amounts), steps=steps)
        )
    for s, row in enumerate(amounts):
        if len(row) != len(body.uavs):
            yield Violation(
                f"/{name}/{s}",
                said("amounts of {count} UAVs, but there are {uavs}", count=len(row), uavs=len(body.uavs)),
            )
        for i, each in enumerate(row):
            if each is not None and len(each) != materials:
                yield Violation(
                    f"/{name}/{s}/{i}",
                    said(
                        "{count} amounts, but there are {materials} materials",
                        count=len(each),
                        materials=materials,
                    ),
                )
            for k, amount in enumerate(each or ()):
                if amount < 0.0 and name == "delivered":
                    yield Violation(f"/{name}/{s}/{i}/{k}", said("{amount:g} is less than 0", amount=amount))
