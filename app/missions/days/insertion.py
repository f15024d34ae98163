"""Greedy insertion: each area that still needs something is put where it earns most, the best one first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.domain.plan import Actions
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
        The problem, with greedy unloading.
    planned
        A legal plan of it.
    """
    arrays = compile_problem(problem)
    places = {Stop(target.id): j for j, target in enumerate(problem.targets)}
    places |= {Stop(base.id, True): problem.n_targets + 1 + d for d, base in enumerate(problem.bases)}
    routes = [[places[stop] for stop in route] for route in planned]
    best = float(_rewards(arrays, _actions(problem, routes)[None])[0])
    while True:
        tried, which = _with_one_more(problem, routes)
        rewards = _rewards(arrays, tried) if which else np.zeros(1)
        chosen = int(rewards.argmax())
        if not which or rewards[chosen] <= best + _LEAST:
            stops = {action: stop for stop, action in places.items()}
            return tuple(tuple(stops[action] for action in route) for route in routes)
        best, i = float(rewards[chosen]), which[chosen]
        routes[i] = [action for action in tried[chosen, :, i].tolist() if action != problem.n_targets]


def _with_one_more(problem: Problem, routes: list[list[int]]) -> tuple[Actions, list[int]]:
    """Return plans with one more visit, (B, S, M), and the UAV that makes it in each."""
    wanting = [j for j, target in enumerate(problem.targets) if any(target.need)]
    reloads = [[], *([problem.n_targets + 1 + d] for d in range(problem.n_bases))]
    base, found, which = _actions(problem, routes, more=2), [], []
    for i, route in enumerate(routes):
        for reload in () if problem.uavs[i].ret else reloads:
            if len(route) + len(reload) >= problem.max_steps:
                continue
            for place in range(len(route) + 1):
                longer = [*route[:place], *reload, 0, *route[place:]]
                plans = np.repeat(base[None], len(wanting), axis=0)
                plans[:, : len(longer), i] = longer
                plans[:, place + len(reload), i] = wanting
                found.append(plans)
                which += [i] * len(wanting)
    return np.concatenate(found) if found else base[None], which


def _actions(problem: Problem, routes: list[list[int]], more: int = 1) -> Actions:
    """Return routes as joint actions, with some rows in which everybody is home, if there may be so many."""
    steps = min(max(map(len, routes)) + more, problem.max_steps)
    actions = np.full((steps, problem.n_uavs), problem.n_targets, np.int64)
    for i, route in enumerate(routes):
        actions[: len(route), i] = route
    return actions


def _rewards(arrays: ProblemArrays, plans: Actions) -> Floats:
    """Return what plans earn, (B,); minus infinity for those that are not legal."""
    result = rewards_of(arrays, plans)
    return np.where(result.rule == ALLOWED, result.reward, -np.inf)
