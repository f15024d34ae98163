"""The work of a job that looks for a better plan of a mission; only worker processes import this."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from app.allocation import tasks
from app.domain.plan import Plan
from app.domain.records import problem_from_record, to_record
from app.jobs.model import WorkResult
from app.jobs.worker import WorkContext
from app.missions.effects import differences
from app.missions.state import routes_of
from app.simulation.evaluation import reward_of
from app.simulation.explain import timed_routes


def replan(payload: dict[str, Any], context: WorkContext) -> WorkResult:
    """Look for a better plan, from the state of a mission and beginning with the plan in force.

    Parameters
    ----------
    payload
        As :func:`app.allocation.tasks.allocate` takes it, with the plan in force as ``start_plan``; and
        ``mission_id``, ``number`` and ``done``, which are for the service.
    context
        As there.

    Returns
    -------
    WorkResult
        As there, and ``proposal``, see :class:`app.missions.model.Proposal`.
    """
    work = tasks.allocate(payload, context)
    problem = problem_from_record(payload["problem"])
    start, plan = Plan(problem.start_plan or ()), Plan(tuple(map(tuple, work.result["assignment"])))
    reward, stops = reward_of(problem, plan), routes_of(problem, plan.assignment)
    proposal = {
        "assignment": work.result["assignment"],
        "reward": reward,
        "gained": reward - reward_of(problem, start),
        "routes": to_record(timed_routes(problem, plan)),
        "stops": [[stop.to_record() for stop in route] for route in stops],
        "differences": differences([uav.id for uav in problem.uavs], routes_of(problem), stops),
        "done": payload["done"],
    }
    return replace(work, result={**work.result, "proposal": proposal})
