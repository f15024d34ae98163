"""Simulated annealing over plans whose unloading is planned with them.

The moves are those of the local search. A change can only alter the deliveries of visits that are connected
with it by UAVs and targets in common, so only these are worked out anew, exactly.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from app.domain.plan import Actions
from app.simulation.arrays import NONE, Floats, ProblemArrays
from app.simulation.decorators import compiled, compiled_nogil
from app.simulation.deliveries import Unloading, Visits, new_unloading, serve
from app.solvers.local_search.annealing import ROUNDING, Search, new_search, set_routes
from app.solvers.local_search.change import Change, apply, extra_closing, extra_distance, feasible, undo
from app.solvers.local_search.moves import draw_move
from app.solvers.local_search.routes import CLOSING, DISTANCE, Routes

MOVES, WORK, SATISFACTION = 0, 1, 2
"""Places in ``PlannedSearch.tally``."""


class PlannedSearch(NamedTuple):
    """One search.

    Attributes
    ----------
    search
        The routes, and what the moves need; its ``best`` is the incumbent's reward with planned unloading.
        What it keeps of greedy unloading is not read.
    unloading
        What the visits earn when they unload at best.
    before
        (N,) what was earned at the targets that a change concerns, in the order in which they are served.
    tally
        (3,) moves tried, visits looked at meanwhile, and the satisfaction of the current plan.
    """

    search: Search
    unloading: Unloading
    before: Floats
    tally: Floats


def new_planned_search(arrays: ProblemArrays, actions: Actions) -> PlannedSearch:
    """Begin a search from a plan.

    Parameters
    ----------
    arrays
        A stack of one problem.
    actions
        (S', M) joint actions of a plan that is legal but for visits that unload nothing.
    """
    search, unloading = new_search(arrays), new_unloading(arrays)
    set_routes(search, actions)
    routes = search.routes
    unloading.served[:] = unloading.order
    earned = serve(arrays, visits_of_routes(routes), unloading, len(unloading.served))
    planned = PlannedSearch(search, unloading, np.zeros(arrays.shape[1]), np.array([0.0, 0.0, earned]))
    search.best[0] = -np.inf
    keep_if_best(planned)
    return planned


@compiled
def visits_of_routes(routes: Routes) -> Visits:
    """Look at the routes of a search as visits."""
    return Visits(routes.target, routes.length, routes.first, routes.following)


@compiled
def keep_if_best(planned: PlannedSearch) -> None:
    """Make the current plan the incumbent if it is better."""
    search, routes = planned.search, planned.search.routes
    cost = search.arrays.terms[0].weight * routes.total[DISTANCE] + routes.total[CLOSING]
    reward = planned.tally[SATISFACTION] - cost
    rounding = ROUNDING * (planned.tally[SATISFACTION] + cost)
    if reward > search.best[0] + rounding:
        search.best[0] = reward
        for i in range(routes.length.shape[0]):
            search.best_length[i] = routes.length[i]
            for s in range(routes.length[i]):
                search.best_target[i, s] = routes.target[i, s]


@compiled_nogil
def anneal_planned(
    planned: PlannedSearch, rng: np.random.Generator, hot: float, cold: float, moves: int, work: float
) -> int:
    """Try moves while the temperature falls geometrically from `hot` towards `cold`.

    Parameters
    ----------
    planned
        Changed: its current plan, and its incumbent where a better one is found.
    rng
        The only source of randomness.
    hot, cold
        Temperatures, in reward, of the first and of the last move.
    moves
        How many to try, at least 1.
    work
        Visits to look at, after which it ends early.

    Returns
    -------
    int
        How many were tried.
    """
    search, tally = planned.search, planned.tally
    arrays, routes, change = search.arrays, search.routes, search.change
    cooling, temperature = math.exp(math.log(cold / hot) / moves), hot
    end = tally[WORK] + work
    tried = 0
    while tried < moves and tally[WORK] < end:
        tried += 1
        temperature *= cooling
        tally[WORK] += 1.0
        if not draw_move(arrays, routes, search.near, change, rng) or not feasible(arrays, change):
            continue
        extra, closing = extra_distance(arrays, routes, change), extra_closing(arrays, routes, change)
        price = arrays.terms[0].weight * extra + closing
        least = temperature * math.log(1.0 - rng.random())
        if search.most - tally[SATISFACTION] - price < least:
            continue
        apply(arrays, routes, change, extra, closing)
        concerned = _concerned(planned, routes, change)
        before = 0.0
        for q in range(concerned):
            planned.before[q] = planned.unloading.value[planned.unloading.served[q]]
            before += planned.before[q]
        earned = serve(arrays, visits_of_routes(routes), planned.unloading, concerned)
        gain = earned - before - price
        tally[WORK] += planned.unloading.number[2]
        planned.unloading.number[2] = 0
        if gain >= least:
            tally[SATISFACTION] += earned - before
            if gain > 0.0:
                keep_if_best(planned)
        else:
            undo(search.arrays, routes, change)
            for q in range(concerned):
                planned.unloading.value[planned.unloading.served[q]] = planned.before[q]
    tally[MOVES] += tried
    return tried


@compiled
def _concerned(planned: PlannedSearch, routes: Routes, change: Change) -> int:
    """List the targets whose deliveries an applied change may alter, in the order of their rank."""
    unloading, m = planned.unloading, routes.length.shape[0]
    unloading.number[0] += 1
    mark, found = unloading.number[0], 0
    for side in range(2):
        i = change.uav[side]
        if i != NONE:
            found = _visited_by(planned, routes, i, mark, found)
            for s in range(change.begin[side], change.length[side]):
                j = change.target[side, s]
                if unloading.seen_target[j] != mark:
                    unloading.seen_target[j] = mark
                    unloading.served[found] = j
                    found += 1
    planned.tally[WORK] += found
    head = 0
    while head < found:
        slot = routes.first[unloading.served[head]]
        while slot != NONE:
            planned.tally[WORK] += 1.0
            if unloading.seen_uav[slot % m] != mark:
                found = _visited_by(planned, routes, slot % m, mark, found)
            slot = routes.following[slot]
        head += 1
    if found * found > unloading.order.shape[0]:
        q = 0
        for place in range(unloading.order.shape[0]):
            if unloading.seen_target[unloading.order[place]] == mark:
                unloading.served[q] = unloading.order[place]
                q += 1
        return found
    for q in range(1, found):
        j, place = unloading.served[q], q
        while place > 0 and unloading.rank[unloading.served[place - 1]] > unloading.rank[j]:
            unloading.served[place] = unloading.served[place - 1]
            place -= 1
        unloading.served[place] = j
    return found


@compiled
def _visited_by(planned: PlannedSearch, routes: Routes, i: int, mark: int, found: int) -> int:
    """Append the targets of UAV `i` that are not in the list yet; return its new length."""
    unloading = planned.unloading
    unloading.seen_uav[i] = mark
    for s in range(routes.length[i]):
        j = routes.target[i, s]
        if unloading.seen_target[j] != mark:
            unloading.seen_target[j] = mark
            unloading.served[found] = j
            found += 1
    return found
