"""Replanning over sampled futures: what may still turn out is drawn several times, and each time planned for.

What is drawn are legs that take longer, and areas that appear. Losses are not, nor are wrong reports. Where
legs take as long as planned, nothing is drawn: waiting for areas that may not come costs more (README.md).

Each of the plans, and the one for what is known alone, is then tried in all of the futures: stops that
cannot be made there are dropped, and what is left is put in greedily. The plan with the best mean is taken.
A UAV that it sends first to an area that is only drawn stays, or flies home, until the next look.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import UAV, Problem, Target
from app.missions.days.insertion import insert
from app.missions.days.kinds import APPEARING_UNTIL, KINDS, N_AREAS, Kind, area
from app.missions.flying import settle
from app.missions.state import MissionState, Routes, Stop, routes_of, with_routes, without_plan
from app.simulation.evaluation import reward_of
from app.solvers.protocol import Solver
from app.solvers.stop import Deadline

FUTURES = 4
"""How many futures are drawn for a decision."""

_SHARE_OF_SEARCHES = 0.6
"""Of the time; the rest is for trying their plans."""

_LEGS = 3
"""A UAV's speed in a future is by the mean slowness of so many legs."""

_DRAWN = "drawn-"


def over_futures(solver: Solver, seconds: float, kind_name: str) -> Any:
    """Return a decision over sampled futures.

    Parameters
    ----------
    solver
        Plans for each of them, and for what is known alone.
    seconds
        Of processor time, for all of that.
    kind_name
        The kind of the day: what may still turn out, and how likely, is all that is known of it.
    """
    kind = KINDS[kind_name]

    def decide(state: MissionState, _number: int, rng: np.random.Generator) -> Routes | None:
        known = without_plan(state.problem)
        futures = [_future(state, kind, rng) for _ in range(FUTURES if kind.slowest > 1.0 else 0)]
        share = seconds * (_SHARE_OF_SEARCHES if futures else 1.0) / (1 + len(futures))
        plans = [_search(solver, each, state.routes, share, rng) for each in [known, *futures]]
        if not futures:
            return plans[0]
        # Without the areas that were drawn something may be of no use, such as a reload for one.
        candidates = dict.fromkeys(routes_of(settle(known, _of_known(plan)).problem) for plan in plans)
        return max(candidates, key=lambda routes: sum(_value(future, routes) for future in futures))

    return decide


def _future(state: MissionState, kind: Kind, rng: np.random.Generator) -> Problem:
    """Draw what may turn out to remain."""
    return without_plan(
        state.problem,
        uavs=_uavs(state, kind, rng),
        targets=(*state.problem.targets, *_appearing(state.clock, kind, rng)),
    )


def _appearing(clock: float, kind: Kind, rng: np.random.Generator) -> list[Target]:
    share = max(0.0, 1.0 - clock / APPEARING_UNTIL)
    number = int(rng.binomial(round(kind.appearing * N_AREAS), share))
    times = rng.uniform(clock, max(clock, APPEARING_UNTIL), number).tolist()
    drawn = [area(f"{_DRAWN}{k}", at, kind, rng) for k, at in enumerate(times)]
    return [replace(each, earliest=max(at, each.earliest)) for each, at in zip(drawn, times, strict=True)]


def _uavs(state: MissionState, kind: Kind, rng: np.random.Generator) -> tuple[UAV, ...]:
    uavs = state.problem.uavs
    slower = rng.uniform(1.0, kind.slowest, (len(uavs), _LEGS)).mean(axis=1)
    return tuple(replace(uav, speed=uav.speed / by) for uav, by in zip(uavs, slower.tolist(), strict=True))


def _search(
    solver: Solver, problem: Problem, start: Routes, seconds: float, rng: np.random.Generator
) -> Routes:
    settled = settle(problem, start).problem
    stop = Deadline(seconds, time.process_time)
    plan: Plan = solver.solve(settled, int(rng.integers(2**31)), stop, lambda _progress: None).plan
    return routes_of(settled, plan.assignment)


def _of_known(routes: Routes) -> Routes:
    """Return a plan without the areas that were drawn; who flies to one of them first stays."""
    return tuple(
        () if route and _is_drawn(route[0]) else tuple(stop for stop in route if not _is_drawn(stop))
        for route in routes
    )


def _value(future: Problem, routes: Routes) -> float:
    """Return what a plan earns in a future, without what cannot be made, and with the rest put in."""
    problem = settle(future, routes).problem
    better = insert(problem, routes_of(problem))
    return reward_of(problem, Plan(with_routes(problem, better).start_plan or ()))


def _is_drawn(stop: Stop) -> bool:
    return stop.id.startswith(_DRAWN)
