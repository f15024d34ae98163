"""From a plan to the answer a dispatcher reads: stops with times and amounts, and what stays unmet."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from app.domain.allocation import (
    Allocation,
    BaseLeft,
    Landing,
    LandingRoute,
    LandingSomewhere,
    Path,
    Reload,
    Route,
    SortieAllocation,
    Stop,
    TimedAllocation,
    TimedStop,
    Visit,
)
from app.domain.plan import Actions, Plan
from app.domain.problem import Problem
from app.domain.world_use import uses_world
from app.simulation import simulator, visit
from app.simulation.amounts import Amounts, tidy
from app.simulation.arrays import Floats, ProblemArrays, compile_problem, homes_of
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.evaluation import replayed
from app.simulation.homes import AT_START
from app.simulation.replay import Replay, deliver, load
from app.simulation.unmet import unmet_targets
from app.simulation.ways import Ways


def explain(
    problem: Problem,
    plan: Plan,
    hurry: Callable[[], bool] = lambda: False,
    amounts: Amounts | None = None,
) -> Allocation:
    """Replay a plan and write down everything that follows from it.

    The answer is a :class:`~app.domain.allocation.TimedAllocation` where the problem uses anything of the
    world (:func:`~app.domain.world_use.uses_world`), and a :class:`~app.domain.allocation.SortieAllocation`
    where it has bases.

    Parameters
    ----------
    problem, plan
        The problem and a legal plan of it.
    hurry
        Asked every few milliseconds; once it is true, reasons for unmet needs are found out no further than
        is quick. What the plan does is always complete.
    amounts
        What its stops unload and load, where that is planned; the best amounts by default.

    Raises
    ------
    IllegalPlan
        If one of its actions is not allowed; ``details`` has step (from 1), uav_id and rule.
    """
    arrays, actions = compile_problem(problem), plan.as_array()
    result, trace, episodes = _traced(problem, arrays, actions, amounts)
    world = uses_world(problem)
    routes = _timed_routes(problem, actions, trace, episodes) if world else _routes(problem, actions, trace)
    allocation = Allocation(
        plan=plan,
        reward=float(result.reward[0]),
        satisfaction=float(result.satisfaction[0]),
        distance=float(result.distance[0]),
        distance_weight=problem.distance_weight,
        routes=tuple(routes),
        unmet=unmet_targets(
            problem,
            arrays,
            actions,
            Amounts(trace.delivered, trace.loaded),
            episodes.need[0],
            hurry,
            keep=amounts is not None or bool(problem.bases),
        ),
    )
    if not world:
        return allocation
    timed = TimedAllocation(
        **_values(allocation), makespan=float(result.makespan[0]), changes=_changes(problem, actions)
    )
    if not problem.bases:
        return timed
    left = zip(problem.bases, episodes.stock[0].tolist(), strict=True)
    bases = (BaseLeft(base.id, None if base.stock is None else tuple(stock)) for base, stock in left)
    return SortieAllocation(**_values(timed), bases=tuple(bases))


def timed_routes(problem: Problem, plan: Plan, amounts: Amounts | None = None) -> tuple[LandingRoute, ...]:
    """Return what every UAV does in a plan, with all times, whatever the problem uses of the world.

    Raises
    ------
    IllegalPlan
        As :func:`explain` does.
    """
    arrays, actions = compile_problem(problem), plan.as_array()
    _, trace, episodes = _traced(problem, arrays, actions, amounts)
    return tuple(_timed_routes(problem, actions, trace, episodes))


def _traced(
    problem: Problem, arrays: ProblemArrays, actions: Actions, amounts: Amounts | None
) -> tuple[Replay, Trace, Episodes]:
    """Replay a plan, and trace it.

    No UAV is sent home in the trace: at its end every one is still at its last stop, which is where the leg
    home begins and where one more visit would begin.
    """
    result, given = replayed(problem, arrays, actions, amounts)
    episodes = simulator.new_episodes(arrays, 1)
    trace = _new_trace(actions, problem.n_materials, given)
    _trace(arrays, episodes, actions, given is not None, given is not None and problem.plans_loading, trace)
    tidy(arrays, actions, trace.delivered, trace.loaded, episodes.need[0], episodes.stock[0])
    return result, trace, episodes


def _routes(problem: Problem, actions: Actions, trace: Trace) -> Iterator[Route]:
    """Return routes of a problem without a world."""
    for i, uav in enumerate(problem.uavs):
        stops = tuple(_stop(problem, actions, trace, s, i) for s in _steps(problem, actions, i))
        back = 0.0 if uav.ret else float(trace.return_legs[i])
        yield Route(uav.id, sum(stop.distance for stop in stops), back, stops)


def _stop(problem: Problem, actions: Actions, trace: Trace, s: int, i: int) -> Stop:
    return Stop(
        target_id=problem.targets[actions[s, i]].id,
        step=s + 1,
        arrival_time=float(trace.arrivals[s, i]),
        distance=float(trace.legs[s, i]),
        delivered=tuple(trace.delivered[s, i].tolist()),
    )


def _steps(problem: Problem, actions: Actions, i: int) -> list[int]:
    """Return the steps, from 0, in which UAV `i` visits something, or reloads."""
    steps: list[int] = np.flatnonzero(actions[:, i] != problem.n_targets).tolist()
    return steps


def _timed_routes(
    problem: Problem, actions: Actions, trace: Trace, episodes: Episodes
) -> Iterator[LandingRoute]:
    ways, homes = Ways(problem), homes_of(problem)
    for i, uav in enumerate(problem.uavs):
        at = visit.START
        stops: list[TimedStop | Reload] = []
        for s in _steps(problem, actions, i):
            path = ways.to(i, at, int(actions[s, i]), float(trace.legs[s, i]))
            at = int(actions[s, i])
            if at > problem.n_targets:
                stops.append(_reload(problem, trace, s, i, at, path))
                continue
            aloft = float(trace.aloft[s, i])
            stops.append(
                (Visit if problem.bases else TimedStop)(
                    **_values(_stop(problem, actions, trace, s, i)),
                    begin_time=float(trace.begins[s, i]),
                    departure_time=float(trace.departures[s, i]),
                    range_left=uav.voyage - float(trace.flown[s, i]),
                    endurance_left=None if uav.endurance is None else uav.endurance - aloft,
                    path=path,
                )
            )
        back = 0.0 if uav.ret else float(trace.return_legs[i])
        landing = None
        if not problem.objective.return_to_base:
            landing = _landing(problem, stops[-1].departure_time, None, AT_START) if stops else None
        elif stops or back > 0.0:
            time, base = float(episodes.clock[0, i] + trace.return_times[i]), AT_START
            if homes is not None:
                base = int(homes.from_now[i] if at == visit.START else homes.from_stop[i, at])
            landing = _landing(problem, time, ways.home(i, at, base, back), base)
        yield LandingRoute(uav.id, sum(stop.distance for stop in stops), back, tuple(stops), landing)


def _reload(problem: Problem, trace: Trace, s: int, i: int, at: int, path: Path | None) -> Reload:
    return Reload(
        base_id=problem.bases[at - problem.n_targets - 1].id,
        step=s + 1,
        arrival_time=float(trace.arrivals[s, i]),
        distance=float(trace.legs[s, i]),
        loaded=tuple(trace.loaded[s, i].tolist()),
        departure_time=float(trace.departures[s, i]),
        path=path,
    )


def _landing(problem: Problem, time: float, path: Path | None, base: int) -> Landing:
    if not problem.bases:
        return Landing(time, path)
    return LandingSomewhere(time, path, None if base == AT_START else problem.bases[base].id)


def _changes(problem: Problem, actions: Actions) -> int:
    """Count pairs of UAV and target that are visited in ``start_plan`` and not here (section 10)."""
    before, now = (
        {(i, j) for row in rows for i, j in enumerate(row) if j < problem.n_targets}
        for rows in (problem.start_plan or (), actions.tolist())
    )
    return len(before - now)


def _values(of: Any) -> dict[str, Any]:
    """Return the fields of a dataclass by their names."""
    return {each.name: getattr(of, each.name) for each in fields(of)}


class Trace(NamedTuple):
    """What a plan does, by step and UAV, (S', M) where nothing else is said; reloads have no begin.

    Attributes
    ----------
    legs, arrivals, begins, departures
        Length of the leg of each visit, when the UAV is there, when it begins, and when it has ended.
    flown, aloft
        Air length, and time in the air, at its end; the latter of UAVs for which it counts.
    delivered, loaded
        (S', M, K) what it unloads, or takes up.
    return_legs, return_times
        (M,) length of the leg home after the last visit, and time until landing.
    """

    legs: Floats
    arrivals: Floats
    begins: Floats
    departures: Floats
    flown: Floats
    aloft: Floats
    delivered: Floats
    loaded: Floats
    return_legs: Floats
    return_times: Floats


def _new_trace(actions: Actions, n_materials: int, given: Amounts | None) -> Trace:
    """Make room for a trace; amounts that are planned are in it already."""
    shape, m = actions.shape, actions.shape[1]
    return Trace(
        legs=np.zeros(shape),
        arrivals=np.zeros(shape),
        begins=np.zeros(shape),
        departures=np.zeros(shape),
        flown=np.zeros(shape),
        aloft=np.zeros(shape),
        delivered=np.zeros((*shape, n_materials)) if given is None else given.delivered.copy(),
        loaded=np.zeros((*shape, n_materials)) if given is None else given.loaded.copy(),
        return_legs=np.zeros(m),
        return_times=np.zeros(m),
    )


@compiled
def _trace(
    arrays: ProblemArrays, episodes: Episodes, actions: Actions, planned: bool, loading: bool, trace: Trace
) -> None:
    """Fly the stops of a legal plan, and write down what each does, then the legs home.

    Amounts are written down too, unless they are planned: then the trace has them. `planned` is about
    deliveries, `loading` about loads.
    """
    for s in range(actions.shape[0]):
        for i in range(actions.shape[1]):
            j = actions[s, i]
            if j == arrays.need.shape[1]:
                continue
            length = simulator.leg_to(arrays, episodes, 0, i, j)
            time = visit.leg_time(arrays, 0, i, episodes.at[0, i], j, length)
            trace.legs[s, i], trace.arrivals[s, i] = length, episodes.clock[0, i] + time
            if visit.is_base(arrays, j):
                if loading:
                    load(arrays, episodes, i, j, trace.loaded, s)
                    trace.departures[s, i] = episodes.clock[0, i]
                    continue
                for k in range(trace.loaded.shape[2]):
                    trace.loaded[s, i, k] = visit.loaded_of(
                        episodes.load[0, i, k],
                        arrays.full[0, i, k],
                        episodes.stock[0, j - arrays.need.shape[1] - 1, k],
                    )
                simulator.act(arrays, episodes, 0, i, j)
                trace.departures[s, i] = episodes.clock[0, i]
                continue
            trace.begins[s, i] = visit.begin_after(arrays, 0, j, trace.arrivals[s, i])
            if planned:
                deliver(arrays, episodes, i, j, trace.delivered, s)
            else:
                for k in range(trace.delivered.shape[2]):
                    trace.delivered[s, i, k] = min(episodes.load[0, i, k], episodes.need[0, j, k])
                simulator.act(arrays, episodes, 0, i, j)
            trace.departures[s, i], trace.flown[s, i] = episodes.clock[0, i], episodes.flown[0, i]
            trace.aloft[s, i] = episodes.aloft[0, i]
    for i in range(actions.shape[1]):
        trace.return_legs[i] = simulator.leg_home(arrays, episodes, 0, i)
        trace.return_times[i] = visit.time_home(arrays, 0, i, episodes.at[0, i])
