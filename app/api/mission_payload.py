"""From requests about missions to what the missions room takes, and from what it keeps to answers."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from app.api.errors import InvalidBody
from app.api.mission_models import MissionRequest
from app.api.problem_details import FieldError
from app.api.problem_models import to_problem
from app.api.problem_types import title_of
from app.api.wire_fields import WireModel, from_wire
from app.domain.errors import InvalidProblem, Violation
from app.domain.identifiers import fault_of
from app.domain.problem import Problem
from app.domain.said import from_record, to_record
from app.missions import events
from app.missions.model import Mission, Planning, Proposal
from app.missions.state import without_plan
from app.settings import Settings
from app.solvers.registry import parse_parameters, require_supported


def mission_of(body: MissionRequest, settings: Settings) -> tuple[Problem, Planning]:
    """Return the problem of a mission, and how it is planned.

    Raises
    ------
    ProblemTooLarge, InvalidProblem
        As :func:`app.api.problem_models.to_problem` does, or if the algorithm cannot take a field.
    UnknownAlgorithm, InvalidParameters
        If there is no such algorithm, or its parameters are unknown or out of range.
    """
    problem = to_problem(body.problem, settings, "/problem")
    if problem.start_plan is None:
        problem = without_plan(problem)
    if body.change_weight is not None:
        objective = replace(problem.objective, change_weight=body.change_weight)
        problem = replace(problem, objective=objective)
    parameters = parse_parameters(body.algorithm, body.parameters)
    try:
        require_supported(body.algorithm, parameters, problem)
    except InvalidProblem as error:
        inside = [Violation(f"/problem{each.pointer}", each.detail) for each in error.violations]
        raise InvalidProblem.of(inside) if inside else error from None
    planning = Planning(
        body.algorithm, parameters.model_dump(mode="json"), body.seed, body.time_limit_s, body.plans
    )
    return problem, planning


def event_of(body: WireModel) -> tuple[events.Event, str, float | None, str]:
    """Return the event of a request, its id, when it became known, and the digest of what was sent.

    Raises
    ------
    InvalidBody
        If the id has a character that none may have.
    """
    given = vars(body)
    if (fault := fault_of(given["id"])) is not None:
        raise InvalidBody([FieldError(pointer="/id", detail=fault)])
    event: events.Event = from_wire(body, events.TYPES[given["type"]])
    text = json.dumps(body.model_dump(mode="json", exclude_unset=True), sort_keys=True)
    return event, given["id"], given.get("at"), hashlib.sha256(text.encode()).hexdigest()


def mission_answer(mission: Mission) -> dict[str, Any]:
    """Describe a mission; see :class:`~app.api.mission_models.MissionModel`."""
    trouble = mission.trouble
    return {
        "id": mission.id,
        "name": mission.name,
        "clock": mission.clock,
        "last_number": mission.last_number,
        "state_number": mission.state_number,
        "searching": mission.is_searching,
        "planning": mission.planning.to_record(),
        "trouble": None
        if trouble is None
        else {
            "type": trouble["code"],
            "title": title_of(trouble["code"]),
            **to_record(from_record(trouble)),
            "errors": trouble["violations"],
            "details": trouble["details"],
        },
        "created_at": mission.created_at.isoformat(),
    }


def proposal_answer(proposal: Proposal) -> dict[str, Any]:
    """Describe a proposal; see :class:`~app.api.mission_models.ProposalModel`."""
    content: Mapping[str, Any] = proposal.content
    told = ("assignment", "reward", "gained", "routes", "differences")
    return {
        "number": proposal.number,
        "status": proposal.status.value,
        "of_number": proposal.of_number,
        "job_id": proposal.job_id,
        **{name: content[name] for name in told},
    }
