"""Simulated annealing over plans whose unloading is planned with them.

The moves are those of the local search. A change can only alter the deliveries of visits that are connected
with it by UAVs and targets in common, so only these are worked out anew, exactly.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from app.domain.plan import Actions
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled, compiled_nogil
from app.simulation.deliveries import Unloading, any_limited, new_unloading
from app.simulation.loads import serve_at_best
from app.simulation.visit_lists import Visits, first_visit, note_flights
from app.solvers.local_search.annealing import ROUNDING, Search, draw_change, new_search, set_routes
from app.solvers.local_search.change import Change, apply, extra_closing, extra_distance, undo
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
    flight
        (S*M,) the flights that the visits of the current routes are part of.
    limited
        Whether stocks are limited, so that a change concerns all targets.
    before
        (N,) what was earned at the targets that a change concerns, in the order in which they are served.
    tally
        (3,) moves tried, visits looked at meanwhile, and the satisfaction of the current plan.
    """

    search: Search
    unloading: Unloading
    flight: Integers
    limited: bool
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
    m, n, _ = arrays.shape
    planned = PlannedSearch(
        new_search(arrays), new_unloading(arrays), np.tile(np.arange(m), int(arrays.max_steps[0])),
        bool(any_limited(arrays)), np.zeros(n), np.zeros(3),
    )  # fmt: skip
    begin_from(planned, actions)
    return planned


def begin_from(planned: PlannedSearch, actions: Actions) -> None:
    """Let a search go on from another plan, which is its incumbent then; see :func:`new_planned_search`."""
    search, unloading = planned.search, planned.unloading
    arrays = search.arrays
    m, n, _ = arrays.shape
    set_routes(search, actions)
    visits = visits_of_routes(search.routes, planned.flight)
    for i in range(m if arrays.n_bases else 0):
        note_flights(visits, i, n)
    unloading.served[:] = unloading.order
    planned.tally[SATISFACTION] = serve_at_best(arrays, visits, unloading, n)
    search.best[0] = -np.inf
    keep_if_best(planned)


@compiled
def visits_of_routes(routes: Routes, flight: Integers) -> Visits:
    """Look at the routes of a search as visits."""
    return Visits(routes.target, routes.length, routes.first, routes.following, flight)


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
    planned: PlannedSearch,
    rng: np.random.Generator,
    hot: float,
    cold: float,
    moves: int,
    work: float,
    large: float,
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
    large
        Probability of a large move.

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
        if not draw_change(search, rng, large):
            continue
        extra, closing = extra_distance(arrays, routes, change), extra_closing(arrays, routes, change)
        price = arrays.terms[0].weight * extra + closing
        least = temperature * math.log(1.0 - rng.random())
        if search.most - tally[SATISFACTION] - price < least:
            continue
        apply(arrays, routes, change, extra, closing)
        _note_flights(planned, routes, change)
        concerned = _concerned(planned, routes, change)
        before = 0.0
        for q in range(concerned):
            planned.before[q] = planned.unloading.value[planned.unloading.served[q]]
            before += planned.before[q]
        earned = serve_at_best(arrays, visits_of_routes(routes, planned.flight), planned.unloading, concerned)
        gain = earned - before - price
        tally[WORK] += planned.unloading.number[2]
        planned.unloading.number[2] = 0
        if gain >= least:
            tally[SATISFACTION] += earned - before
            if gain > 0.0:
                keep_if_best(planned)
        else:
            undo(search.arrays, routes, change)
            _note_flights(planned, routes, change)
            for q in range(concerned):
                planned.unloading.value[planned.unloading.served[q]] = planned.before[q]
    tally[MOVES] += tried
    return tried


@compiled
def _note_flights(planned: PlannedSearch, routes: Routes, change: Change) -> None:
    """Write down the flights of the routes that a change concerns, as they are now."""
    arrays = planned.search.arrays
    if arrays.stock.shape[1] > 0:
        for side in range(2):
            if change.uav[side] != NONE:
                note_flights(visits_of_routes(routes, planned.flight), change.uav[side], arrays.need.shape[1])


@compiled
def _concerned(planned: PlannedSearch, routes: Routes, change: Change) -> int:
    """List the targets whose deliveries an applied change may alter, in the order of their rank."""
    unloading, m, home = planned.unloading, routes.length.shape[0], planned.search.arrays.need.shape[1]
    if planned.limited:
        for place in range(home):
            unloading.served[place] = unloading.order[place]
        planned.tally[WORK] += home
        return home
    unloading.number[0] += 1
    mark, found = unloading.number[0], 0
    for side in range(2):
        i = change.uav[side]
        if i == NONE:
            continue
        now, before = routes.length[i], change.length[side]
        # What both routes end with has moved, and is part of the same flights, but for the first of it.
        same = 0
        if planned.search.arrays.stock.shape[1] > 0:
            least = min(now, before) - change.begin[side]
            while same < least and routes.target[i, now - 1 - same] == change.target[side, before - 1 - same]:
                same += 1
        for s in range(max(0, min(change.begin[side], now) - 1), min(now - same + 1, now)):
            f = planned.flight[s * m + i]
            if unloading.seen_flight[f] != mark:
                found = _visited_by(planned, routes, f, mark, found)
        for s in range(change.begin[side], before - same):
            found = _concerns(unloading, change.target[side, s], home, mark, found)
    planned.tally[WORK] += found
    head = 0
    while head < found:
        slot = routes.first[unloading.served[head]]
        while slot != NONE:
            planned.tally[WORK] += 1.0
            f = planned.flight[slot]
            if unloading.seen_flight[f] != mark:
                found = _visited_by(planned, routes, f, mark, found)
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
def _visited_by(planned: PlannedSearch, routes: Routes, f: int, mark: int, found: int) -> int:
    """Append the targets of a flight that are not in the list yet; return its new length."""
    unloading, m, home = planned.unloading, routes.length.shape[0], planned.search.arrays.need.shape[1]
    unloading.seen_flight[f] = mark
    i, s = f % m, first_visit(visits_of_routes(routes, planned.flight), f, home)
    while s < routes.length[i] and routes.target[i, s] < home:
        found = _concerns(unloading, routes.target[i, s], home, mark, found)
        s += 1
    return found


@compiled
def _concerns(unloading: Unloading, j: int, home: int, mark: int, found: int) -> int:
    """Append a target if it is not in the list yet; return the list's new length."""
    if j < home and unloading.seen_target[j] != mark:
        unloading.seen_target[j] = mark
        unloading.served[found] = j
        found += 1
    return found
