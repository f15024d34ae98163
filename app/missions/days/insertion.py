"""Greedy insertion: each area that still needs something is put where it earns most, the best one first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from app.domain.problem import Problem
from app.missions.state import Routes, Stop
from app.simulation.arrays import Floats, ProblemArrays, compile_problem
from app.simulation.evaluation import rewards_of
from app.simulation.visit import ALLOWED

_LEAST = 1e-9
"""What an insertion has to bring."""


def insert(problem: Problem, planned: Sequence[Sequence[Stop]]) -> Routes:
    """Put visits into a plan until none brings anything.

    Nothing that is planned is taken out or moved. With bases, a visit may come with a reload before it.

    Parameters
    ----------
    problem
        The problem.
    planned
        A legal plan of it.
    """
    arrays = compile_problem(problem)
    routes: Routes = tuple(tuple(route) for route in planned)
    best = float(_rewards(problem, arrays, [routes])[0])
    while True:
        tried = list(_with_one_more(problem, routes))
        rewards = _rewards(problem, arrays, tried) if tried else np.zeros(0)
        if not len(rewards) or rewards.max() <= best + _LEAST:
            return routes
        best, routes = float(rewards.max()), tried[int(rewards.argmax())]


def _with_one_more(problem: Problem, routes: Routes) -> Iterator[Routes]:
    reloads: list[tuple[Stop, ...]] = [(), *((Stop(base.id, True),) for base in problem.bases)]
    for target in problem.targets:
        if not any(target.need):
            continue
        for i, route in enumerate(routes):
            if problem.uavs[i].ret:
                continue
            for place in range(len(route) + 1):
                for reload in reloads:
                    longer = (*route[:place], *reload, Stop(target.id), *route[place:])
                    if len(longer) <= problem.max_steps:
                        yield (*routes[:i], longer, *routes[i + 1 :])


def _rewards(problem: Problem, arrays: ProblemArrays, plans: Sequence[Routes]) -> Floats:
    """Return what plans earn; minus infinity for those that are not legal."""
    home = problem.n_targets
    actions = np.full((len(plans), problem.max_steps, problem.n_uavs), home, np.int64)
    place = {Stop(target.id): j for j, target in enumerate(problem.targets)}
    place |= {Stop(base.id, True): home + 1 + d for d, base in enumerate(problem.bases)}
    for b, routes in enumerate(plans):
        for i, route in enumerate(routes):
            for s, stop in enumerate(route):
                actions[b, s, i] = place[stop]
    result = rewards_of(arrays, actions)
    return np.where(result.rule == ALLOWED, result.reward, -np.inf)
