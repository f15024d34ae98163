"""Time that passes in a mission, and whether its plan can still be flown; only worker processes import this.

What is not reported goes as planned: a mission is moved on by the rules of its plan, and events correct it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from app.domain.allocation import LandingRoute, LandingSomewhere, Reload, TimedStop
from app.domain.errors import IllegalPlan
from app.domain.geometry import distance
from app.domain.plan import Plan
from app.domain.problem import UAV, Problem
from app.missions.effects import Broken, stop_of
from app.missions.state import Done, MissionState, Routes, Stop, routes_of, with_routes, without_plan
from app.simulation.breaches import breaches_of
from app.simulation.explain import timed_routes
from app.simulation.mid_mission import remaining_at


@dataclass(frozen=True, slots=True)
class Flown:
    """A mission at a later moment, with nothing but what was planned.

    Attributes
    ----------
    state
        Then.
    routes
        The rest of the plan in force, with its times.
    broken
        Stops of it that have lost their use.
    """

    state: MissionState
    routes: tuple[LandingRoute, ...]
    broken: tuple[Broken, ...]


def fly(state: MissionState, at: float) -> Flown:
    """Move a mission on to a moment, as its plan says (section 11 of the rules).

    A stop that has begun is done. A UAV with nothing left to do flies home, if it must return, and can be
    sent again: ``returning`` is only one that was so from the start, or is lost.

    Parameters
    ----------
    state
        With a legal plan in force.
    at
        No earlier than the state's clock.
    """
    problem = state.problem
    plan = Plan(problem.start_plan or ((problem.n_targets,) * problem.n_uavs,))
    routes = timed_routes(problem, plan)
    left = remaining_at(problem, plan, at)
    uavs = tuple(
        uav if uav.ret else _available(problem, uav, then, route, at)
        for uav, then, route in zip(problem.uavs, left.uavs, routes, strict=True)
    )
    done = [_begun(route, uav, at) for uav, route in zip(problem.uavs, routes, strict=True)]
    rest = [stops[len(begun) :] for stops, begun in zip(routes_of(problem), done, strict=True)]
    settled = settle(replace(left, uavs=uavs), rest)
    began = sorted((each for of_one in done for each in of_one), key=lambda each: each.time)
    state = replace(state, clock=at, problem=settled.problem, done=(*state.done, *began))
    return Flown(state, settled.routes, settled.broken)


def _begun(route: LandingRoute, uav: UAV, at: float) -> list[Done]:
    """Return the stops of a route that have begun, as :mod:`app.simulation.mid_mission` has it."""
    if uav.ret or at <= uav.available_from:
        return []
    begun = []
    for stop in route.stops:
        if isinstance(stop, Reload) and stop.arrival_time <= at:
            begun.append(Done(uav.id, stop_of(stop), stop.arrival_time, stop.loaded))
        elif isinstance(stop, TimedStop) and stop.begin_time <= at:
            begun.append(Done(uav.id, stop_of(stop), stop.begin_time, stop.delivered))
        else:
            break
    return begun


def _available(problem: Problem, before: UAV, then: UAV, route: LandingRoute, at: float) -> UAV:
    """Return a UAV at a moment, so that it can be sent again when it has landed or is on its way home."""
    if then.ret:
        return replace(then, ret=False)
    if route.stops or route.landing is None or not problem.objective.return_to_base:
        return then
    if before.begins_on_ground or at <= before.available_from:
        return then
    return _on_way_home(problem, before, route, at)


def _on_way_home(problem: Problem, uav: UAV, route: LandingRoute, at: float) -> UAV:
    """Return a UAV in the air that has nothing to do: at a moment of its way home, or there."""
    landing = route.landing
    assert landing is not None
    whole = landing.time - uav.available_from
    share = 1.0 if whole <= 0.0 else min(1.0, (at - uav.available_from) / whole)
    length = whole * uav.speed if problem.wind is not None else route.return_distance
    flown = replace(
        uav,
        dis=uav.dis + share * length,
        airborne=uav.airborne + share * max(0.0, whole),
        available_from=max(at, landing.time) if problem.matrices is not None else at,
    )
    base = None
    if isinstance(landing, LandingSomewhere) and landing.base_id is not None:
        base = next(each for each in problem.bases if each.id == landing.base_id)
    end = (uav.x_s, uav.y_s) if base is None else (base.x, base.y)
    home = uav.location if uav.home_location is None else uav.home_location
    if share >= 1.0 or problem.matrices is not None:
        location = home if base is None else base.location
        return replace(flown, x_c=end[0], y_c=end[1], location=location, home_location=home)
    x, y = _along(problem.crs, landing.path or ((uav.x_c, uav.y_c), end), share)
    return replace(flown, x_c=x, y_c=y)


def _along(crs: str, path: Sequence[tuple[float, float]], share: float) -> tuple[float, float]:
    """Return the point at a share of a way's length; each piece is straight in its coordinates."""
    pieces = [distance(crs, *a, *b) for a, b in pairwise(path)]
    left = share * sum(pieces)
    for (a, b), length in zip(pairwise(path), pieces, strict=True):
        if left < length:
            part = left / length
            return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])
        left -= length
    return path[-1]


@dataclass(frozen=True, slots=True)
class Settled:
    """A problem with a plan that is legal.

    Attributes
    ----------
    problem
        Its ``start_plan`` is the plan.
    routes
        The plan with its times.
    broken
        The stops that were dropped from what was asked for.
    """

    problem: Problem
    routes: tuple[LandingRoute, ...]
    broken: tuple[Broken, ...]


def settle(problem: Problem, routes: Sequence[Sequence[Stop]]) -> Settled:
    """Drop from a plan the stops that cannot be made, one after the other, until it is legal.

    A UAV is not committed any more to an area that it was to visit and cannot.

    Parameters
    ----------
    problem
        The problem; its own plan does not count.
    routes
        The stops of each UAV.
    """
    left = [list(route) for route in routes]
    broken: list[Broken] = []
    while True:
        tried = with_routes(without_plan(problem), left)
        plan = Plan(tried.start_plan or ())
        try:
            return Settled(tried, timed_routes(tried, plan), tuple(broken))
        except IllegalPlan:
            i, s, fault = _first_broken(tried, plan)
        stop = left[i].pop(s)
        broken.append(replace(fault, stop=stop))
        uav = problem.uavs[i]
        if not stop.is_base and stop.id in uav.committed and stop not in left[i]:
            kept = tuple(each for each in uav.committed if each != stop.id)
            uavs = (*problem.uavs[:i], replace(uav, committed=kept), *problem.uavs[i + 1 :])
            problem = without_plan(problem, uavs=uavs)


def _first_broken(problem: Problem, plan: Plan) -> tuple[int, int, Broken]:
    """Return UAV and step of the first action that breaks a rule, and which rule that is."""
    breach = breaches_of(problem, plan)[0]
    uav_id = str(breach.uav_id)
    fault = Broken(uav_id, Stop(""), breach.rule, breach.says, breach.needed, breach.had)
    return [uav.id for uav in problem.uavs].index(uav_id), breach.step - 1, fault


def with_positions(problem: Problem, positions: Mapping[str, Mapping[str, Any]], at: float) -> Problem:
    """Return a problem with UAVs where they were seen.

    A UAV that is at work, or returning, is where the plan has it. One that was seen before ``at`` goes on
    from there to the area that it is committed to; otherwise it is there at ``at``.

    Parameters
    ----------
    problem
        What remains at a clock.
    positions
        By id; each with ``time``, ``x``, ``y``, and maybe ``dis``, ``airborne``, ``location``.
    at
        The clock.
    """
    uavs = []
    for uav in problem.uavs:
        seen = positions.get(uav.id)
        if seen is None or uav.ret or uav.available_from > at:
            uavs.append(uav)
            continue
        home = uav.location if uav.home_location is None else uav.home_location
        rows = {} if seen.get("location") is None else {"location": seen["location"], "home_location": home}
        used = {name: seen[name] for name in ("dis", "airborne") if seen.get(name) is not None}
        # Matrices know no places between two rows; coordinates are for display then.
        uavs.append(
            replace(
                uav,
                x_c=seen["x"],
                y_c=seen["y"],
                available_from=min(seen["time"], at) if uav.committed else at,
                **(rows if problem.matrices is not None else {}),
                **used,
            )
        )
    return without_plan(problem, uavs=tuple(uavs))


def carried(routes: Routes, begun: Sequence[Sequence[Stop]]) -> Routes | None:
    """Return what is left of routes once each UAV has made some stops; None if they are not its first ones.

    Parameters
    ----------
    routes
        Of a plan that was made before.
    begun
        What each UAV has done since.
    """
    if any(tuple(route[: len(made)]) != tuple(made) for route, made in zip(routes, begun, strict=True)):
        return None
    return tuple(route[len(made) :] for route, made in zip(routes, begun, strict=True))
