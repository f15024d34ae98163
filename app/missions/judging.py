"""What is asked about missions beside the search for plans; only worker processes import this.

Each function takes a payload of plain values and gives one back, so that the service, which loads no compiled
code, can hand it to a process that does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from app.allocation.legality import require_legal
from app.domain.allocation import LandingRoute
from app.domain.plan import Plan
from app.domain.problem import UAV, Problem, Target
from app.domain.records import problem_from_record, to_record
from app.domain.said import said
from app.jobs.model import WorkResult
from app.jobs.worker import WorkContext
from app.missions import events
from app.missions.changes import change
from app.missions.draft import Draft
from app.missions.effects import Effect, later_stops
from app.missions.errors import EventRefused, ProposalClosed
from app.missions.flying import Settled, carried, fly, settle, with_positions
from app.missions.state import MissionState, Routes, Stop
from app.simulation.compilation import compile_in_turns
from app.simulation.evaluation import reward_of
from app.simulation.explain import timed_routes


def begin(payload: Mapping[str, Any], context: WorkContext) -> WorkResult:  # noqa: ARG001 - quick
    """Begin a mission.

    Parameters
    ----------
    payload
        ``problem``, a record, with a ``start_plan``.
    context
        Not used: this takes milliseconds.

    Returns
    -------
    WorkResult
        ``state`` and ``plan``, as :func:`apply` returns them.

    Raises
    ------
    IllegalPlan
        If the plan breaks a rule.
    """
    problem = problem_from_record(payload["problem"])
    # The default weight of distance is by where everything is, which changes in the course of a mission.
    weight = replace(problem.objective, distance_weight=problem.distance_weight)
    problem = replace(problem, objective=weight)
    plan = Plan(problem.start_plan or ())
    require_legal(problem, plan, "/problem/start_plan")
    state = MissionState(0.0, problem)
    return WorkResult({"state": state.to_record(), "plan": plan_record(problem, timed_routes(problem, plan))})


def apply(payload: Mapping[str, Any], context: WorkContext) -> WorkResult:  # noqa: ARG001 - quick
    """Let an event change a mission.

    Parameters
    ----------
    payload
        ``state``, a record; ``matrices`` of the problem, or None; ``event``, a record, and its ``at``;
        ``positions``, by the ids of UAVs, those that came since the state; and for an event about a proposal
        ``proposal``: its ``stops`` and ``done``, how many stops were done when it was made.
    context
        Not used: this takes milliseconds.

    Returns
    -------
    WorkResult
        ``state``, ``plan`` (its ``assignment``, ``reward`` and timed ``routes``), ``effect``, and
        ``wants_plan``, whether another plan may be better now.

    Raises
    ------
    EventRefused
        If the event is from the past, about something unknown, or impossible.
    ProposalClosed
        If the proposal does not fit what has happened since.
    """
    state = MissionState.from_record(payload["state"], payload["matrices"])
    event, at, positions = events.event_from_record(payload["event"]), payload["at"], payload["positions"]
    if at < state.clock:
        detail = said("{time} is in the past: the mission's clock is {clock}", time=at, clock=state.clock)
        raise EventRefused.at("/at", detail)
    flown = fly(state, at)
    before = reward_of(flown.state.problem, Plan(flown.state.problem.start_plan or ()))
    draft = Draft.of(flown.state, flown.routes)
    draft.problem = with_positions(draft.problem, positions, at)
    if isinstance(event, events.ProposalAccepted):
        draft.take(_carried(payload["proposal"], flown.state))
    elif not isinstance(event, events.ProposalRefused):
        change(draft, event)
    settled = settle(draft.problem, draft.routes)
    if isinstance(event, events.ProposalAccepted) and settled.broken:
        first = settled.broken[0]
        raise ProposalClosed(
            said(
                "the proposal cannot be flown any more: {uav} to {stop}: {why}",
                uav=first.uav_id,
                stop=first.stop.id,
                why=first.says,
            )
        )
    effect = _effect(settled, flown.routes, (*flown.broken, *draft.gone), before)
    return WorkResult(
        {
            "state": replace(
                flown.state,
                problem=settled.problem,
                done=tuple(draft.done),
                lost=draft.lost,
                cancelled=draft.cancelled,
            ).to_record(),
            "plan": plan_record(settled.problem, settled.routes),
            "effect": effect.to_record(),
            "wants_plan": _wants_plan(event, draft, effect, bool(positions)),
        }
    )


def _carried(proposal: Mapping[str, Any], state: MissionState) -> Routes:
    """Return what is left of a proposal after the stops that were made since."""
    routes = [tuple(map(Stop.from_record, route)) for route in proposal["stops"]]
    since: dict[str, list[Stop]] = {uav.id: [] for uav in state.problem.uavs}
    for each in state.done[proposal["done"] :]:
        since[each.uav_id].append(each.stop)
    begun = list(since.values())
    left = carried(tuple(routes), begun) if len(routes) == len(begun) else None
    if left is None:
        raise ProposalClosed(said("the proposal cannot be flown any more: UAVs have made other stops since"))
    return left


def _effect(
    settled: Settled, before: Sequence[LandingRoute], gone: Sequence[Any], reward_before: float
) -> Effect:
    reward = reward_of(settled.problem, Plan(settled.problem.start_plan or ()))
    late = later_stops(before, settled.routes)
    return Effect((*gone, *settled.broken), late, reward_before, reward)


def _wants_plan(event: events.Event, draft: Draft, effect: Effect, seen: bool) -> bool:
    """Say whether another plan may be better after an event; none is where all goes as planned."""
    if isinstance(event, events.ProposalAccepted | events.ProposalRefused):
        return False
    disturbed = bool(effect.broken) or (seen and bool(effect.late))
    return disturbed or not draft.as_planned


def look(payload: Mapping[str, Any], context: WorkContext) -> WorkResult:  # noqa: ARG001 - quick
    """Look at a mission at a later moment, as it is planned to be then.

    Parameters
    ----------
    payload
        ``state``, ``matrices``, ``at`` and ``positions`` as :func:`apply` takes them.
    context
        Not used: this takes milliseconds.

    Returns
    -------
    WorkResult
        ``state`` and ``plan``, as :func:`apply` returns them.
    """
    state = MissionState.from_record(payload["state"], payload["matrices"])
    at = max(payload["at"], state.clock)
    flown = fly(state, at)
    seen = with_positions(flown.state.problem, payload["positions"], at)
    settled = settle(seen, flown.state.routes)
    state = replace(flown.state, problem=settled.problem)
    return WorkResult({"state": state.to_record(), "plan": plan_record(settled.problem, settled.routes)})


def plan_record(problem: Problem, routes: Sequence[LandingRoute]) -> dict[str, Any]:
    """Return a plan in force as answers have it."""
    rows = problem.start_plan or ()
    return {
        "assignment": [list(row) for row in rows],
        "reward": reward_of(problem, Plan(rows)),
        "routes": to_record(tuple(routes)),
    }


def warm_up() -> None:
    """Load and compile what the functions of this module need."""
    compile_in_turns()
    home = (0.0, 0.0)
    problem = Problem(
        uavs=tuple(UAV(f"uav-{i}", *home, *home, 1.0, 10.0, (2.0, 1.0)) for i in (1, 2)),
        targets=tuple(Target(f"area-{j}", 1.0, 2.0, 9.0, (1.0, 2.0), deadline=9.0) for j in (1, 2, 3)),
        max_steps=2,
        start_plan=((0, 1),),
    )
    for unloading in ("greedy", "planned"):
        tried = replace(problem, objective=replace(problem.objective, unloading=unloading))
        state = MissionState(0.0, tried).to_record()
        payload = {"state": state, "matrices": None, "at": 1.0, "positions": {}}
        context = WorkContext.in_process(lambda _progress: None)
        apply({**payload, "event": {"type": "area_cancelled", "target_id": "area-1"}}, context)
