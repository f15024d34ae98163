"""Simulated annealing over plans."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled, compiled_nogil
from app.solvers.column_generation.pool import Pool, collect, new_pool
from app.solvers.local_search.ceiling import most_satisfaction
from app.solvers.local_search.change import (
    Change,
    apply,
    extra_closing,
    extra_distance,
    extra_time,
    feasible,
    new_change,
    propose,
    undo,
)
from app.solvers.local_search.flights import is_reload
from app.solvers.local_search.moves import draw_move
from app.solvers.local_search.neighbourhood import Neighbourhood, neighbourhood
from app.solvers.local_search.placing import Placing, new_placing
from app.solvers.local_search.rebuild import rebuild
from app.solvers.local_search.routes import (
    CLOSING,
    DISTANCE,
    SATISFACTION,
    USELESS,
    Routes,
    empty_routes,
    sum_up,
)

ROUNDING = 1e-11
"""Relative error that the totals of a plan may have after the changes of a call, and more."""


class Prices(NamedTuple):
    """What an annealing charges beside what the objective does, in reward.

    Attributes
    ----------
    useless
        A visit that unloads nothing; more than 0, so that it goes.
    haste, thrift
        A unit of time, and of distance beyond its weight: room in the routes is worth something before
        anything is put into it.
    """

    useless: float
    haste: float = 0.0
    thrift: float = 0.0


class Search(NamedTuple):
    """One search: its problem, its current plan, its incumbent.

    Attributes
    ----------
    arrays
        A stack of one problem.
    near, routes, change
        What the moves draw from, the current plan, scratch space.
    best_target, best_length
        (M, S) and (M,) the routes of the incumbent.
    best
        (1,) its reward.
    most
        What no plan's satisfaction exceeds.
    pool
        Where routes are collected, if they are.
    placing
        Scratch space of large moves.
    """

    arrays: ProblemArrays
    near: Neighbourhood
    routes: Routes
    change: Change
    best_target: Integers
    best_length: Integers
    best: Floats
    most: float
    pool: Pool
    placing: Placing


def new_search(arrays: ProblemArrays) -> Search:
    """Begin a search from the plan in which nobody flies; its pool has no room."""
    return _begin(arrays, neighbourhood(arrays), most_satisfaction(arrays), new_pool(arrays, 0))


def replica(search: Search) -> Search:
    """Begin another search of the same problem from the incumbent of one, for another thread."""
    other = _begin(search.arrays, search.near, search.most, search.pool)
    set_routes(other, actions_of(search))
    return other


def _begin(arrays: ProblemArrays, near: Neighbourhood, most: float, pool: Pool) -> Search:
    routes = empty_routes(arrays)
    if arrays.terms["charge_return"][0]:
        at_home = arrays.uavs["start_home"][0][~arrays.ret[0]]
        routes.total[DISTANCE] = at_home.sum()
    best = np.array([-arrays.terms["weight"][0] * routes.total[DISTANCE] - routes.total[CLOSING]])
    return Search(
        arrays,
        near,
        routes,
        new_change(arrays),
        routes.target.copy(),
        routes.length.copy(),
        best,
        most,
        pool,
        new_placing(arrays),
    )


def set_routes(search: Search, actions: Integers) -> None:
    """Replace the current plan.

    Parameters
    ----------
    search
        The search.
    actions
        (S', M) joint actions of a legal plan.
    """
    home = search.arrays.areas["level"].shape[1]
    for i in range(actions.shape[1]):
        targets = actions[:, i]
        set_route(search, i, np.ascontiguousarray(targets[targets != home]))
    keep_best(search)


def actions_of(search: Search) -> Integers:
    """Return the incumbent as joint actions, (S, M)."""
    steps = search.best_target.shape[1]
    home = search.arrays.areas["level"].shape[1]
    used = np.arange(steps)[None, :] < search.best_length[:, None]
    return np.where(used, search.best_target, home).T.copy()


@compiled
def set_route(search: Search, i: int, targets: Integers) -> bool:
    """Give UAV `i` a route, whatever it unloads; False where rule 2 does not allow it."""
    arrays, routes, change = search.arrays, search.routes, search.change
    change.uav[1] = NONE
    for s in range(len(targets)):
        change.target[0, s] = targets[s]
    propose(routes, change, 0, i, 0, len(targets))
    if not feasible(arrays, change):
        return False
    _apply_whole(arrays, routes, change)
    return True


@compiled
def _apply_whole(arrays: ProblemArrays, routes: Routes, change: Change) -> None:
    """Make a feasible proposal the current plan, whatever it earns."""
    extra, closing = extra_distance(arrays, routes, change), extra_closing(arrays, routes, change)
    apply(arrays, routes, change, extra, closing)


@compiled
def keep_best(search: Search) -> bool:
    """Make the current plan the incumbent if it is legal and better."""
    return _keep(search, search.best[0] + ROUNDING * _turnover(search))


@compiled
def _turnover(search: Search) -> float:
    """Sum of what the current plan earns and costs: its reward has a share of it as rounding error."""
    total = search.routes.total
    return total[SATISFACTION] + search.arrays.terms[0].weight * total[DISTANCE] + total[CLOSING]


@compiled
def _keep(search: Search, most: float) -> bool:
    """Make the current plan the incumbent if it is legal and earns more than that."""
    routes, reward = search.routes, worth(search, 0.0)
    if routes.total[USELESS] > 0.5 or reward <= most:
        return False
    search.best[0] = reward
    for i in range(routes.length.shape[0]):
        search.best_length[i] = routes.length[i]
        for s in range(routes.length[i]):
            search.best_target[i, s] = routes.target[i, s]
    return True


@compiled
def worth(search: Search, useless: float) -> float:
    """Reward of the current plan, less a price for each of its useless visits."""
    total = search.routes.total
    cost = search.arrays.terms[0].weight * total[DISTANCE] + total[CLOSING]
    return float(total[SATISFACTION] - cost - useless * total[USELESS])


@compiled
def drop_useless(search: Search) -> None:
    """Take the visits that unload nothing out of the current plan, which makes it legal, and keep it if best.

    What follows in the route moves a step ahead and may find another order at its targets, so other visits
    can become useless; each pass leaves fewer visits, so it ends.
    """
    arrays, routes, change = search.arrays, search.routes, search.change
    m = routes.length.shape[0]
    while routes.total[USELESS] > 0.5:
        for i in range(m):
            s = 0
            while s < routes.length[i]:
                if not routes.useless[s * m + i]:
                    s += 1
                    continue
                # Mostly the way without it is not longer, so it is feasible; alone between two reloads it
                # takes one of them along. Otherwise the route ends here.
                gone = 1
                while not _is_feasible_without(arrays, routes, change, i, s, gone):
                    gone = 2 if gone == 1 and _is_before_reload(search, i, s) else routes.length[i] - s
                _apply_whole(arrays, routes, change)
    keep_best(search)


@compiled
def _is_before_reload(search: Search, i: int, s: int) -> bool:
    return s + 1 < search.routes.length[i] and is_reload(search.routes, search.near, i, s + 1)


@compiled
def _is_feasible_without(
    arrays: ProblemArrays, routes: Routes, change: Change, i: int, s: int, gone: int
) -> bool:
    """Propose the route of UAV `i` without some stops from `s` on, and say whether rule 2 allows it."""
    change.uav[1] = NONE
    for q in range(s, routes.length[i] - gone):
        change.target[0, q] = routes.target[i, q + gone]
    propose(routes, change, 0, i, s, routes.length[i] - gone)
    return feasible(arrays, change)


def drop_idle_reloads(search: Search) -> None:
    """Take the reloads out of the incumbent without which it earns no less, and go on from there."""
    if search.arrays.n_bases:
        set_routes(search, actions_of(search))
        _drop_idle_reloads(search)
        _keep(search, search.best[0] - ROUNDING * _turnover(search))


@compiled
def _drop_idle_reloads(search: Search) -> None:
    """Take reloads out of the current plan without which it earns no less, the last ones of a route first."""
    arrays, routes, change = search.arrays, search.routes, search.change
    if arrays.stock.shape[1] == 0:
        return
    weight = arrays.terms[0].weight
    for i in range(routes.length.shape[0]):
        for s in range(routes.length[i] - 1, -1, -1):
            if not is_reload(routes, search.near, i, s):
                continue
            if not _is_feasible_without(arrays, routes, change, i, s, 1):
                continue
            _apply_whole(arrays, routes, change)
            cost, was = weight * routes.total[DISTANCE] + routes.total[CLOSING], change.total
            less = (
                was[SATISFACTION] - weight * was[DISTANCE] - was[CLOSING] - routes.total[SATISFACTION] + cost
            )
            if routes.total[USELESS] > was[USELESS] or less > ROUNDING * (was[SATISFACTION] + cost):
                undo(arrays, routes, change)


@compiled
def draw_change(search: Search, rng: np.random.Generator, large: float) -> bool:
    """Propose a random change that rule 2 allows, of a large move with a probability; False where none is."""
    arrays, routes, near, change = search.arrays, search.routes, search.near, search.change
    if large > 0.0 and rng.random() < large:
        return rebuild(arrays, routes, near, change, search.placing, rng) and _is_own(near, change)
    return draw_move(arrays, routes, near, change, rng) and _is_own(near, change) and feasible(arrays, change)


@compiled
def _is_own(near: Neighbourhood, change: Change) -> bool:
    """Whether the routes that a change proposes may be changed."""
    i, i2 = change.uav[0], change.uav[1]
    return (i == NONE or near.own[i]) and (i2 == NONE or near.own[i2])


@compiled_nogil
def anneal(
    search: Search, rng: np.random.Generator, moves: int, hot: float, cold: float, prices: Prices,
    collecting: bool = False, large: float = 0.0,
) -> int:  # fmt: skip
    """Try moves while the temperature falls geometrically from `hot` to `cold`; return how many were kept.

    Parameters
    ----------
    search
        Changed: its current plan, and its incumbent where a better one is found.
    rng
        The only source of randomness.
    moves
        How many to try.
    hot, cold
        Temperatures, in reward.
    prices
        What else costs reward during the search.
    collecting
        Whether the routes that a kept change makes go to the search's pool.
    large
        Probability of a large move.
    """
    arrays, routes, change, pool = search.arrays, search.routes, search.change, search.pool
    weight = arrays.terms[0].weight
    sum_up(arrays, routes)
    kept = 0
    temperature = hot
    cooling = math.exp(math.log(cold / hot) / max(moves, 1))
    for _ in range(moves):
        temperature *= cooling
        if not draw_change(search, rng, large):
            continue
        extra, closing = extra_distance(arrays, routes, change), extra_closing(arrays, routes, change)
        price = (weight + prices.thrift) * extra + prices.haste * extra_time(routes, change) + closing
        # What the change has to bring to be kept; most bring less, and of many that is known beforehand.
        least = temperature * math.log(1.0 - rng.random())
        if search.most - routes.total[SATISFACTION] + prices.useless * routes.total[USELESS] - price < least:
            continue
        apply(arrays, routes, change, extra, closing)
        gain = (
            routes.total[SATISFACTION]
            - change.total[SATISFACTION]
            - prices.useless * (routes.total[USELESS] - change.total[USELESS])
            - price
        )
        if gain >= least:
            kept += 1
            if gain > 0.0:
                keep_best(search)
            if collecting:
                for side in range(2):
                    i = change.uav[side]
                    if i != NONE:
                        collect(arrays, pool, i, routes.target[i], routes.length[i], routes.flown[i])
        else:
            undo(arrays, routes, change)
    return kept
