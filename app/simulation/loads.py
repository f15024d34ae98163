"""How much each visit unloads where what reloads take is planned with it: section 9 of the rules.

A flight that begins at a base takes what its visits will unload, so that its capacity, in weight, is what it
supplies, whatever the material. A unit of weight is worth most where a target's worth by weight is highest,
so demands are served in that order, by all materials together. With unlimited stocks and nothing aboard at
first that is one transportation problem, and exact as in :mod:`app.simulation.deliveries`. Where stocks are
limited or something is aboard, it is a good plan and not always the best one, which
:mod:`app.simulation.amounts_program` finds.
"""

from __future__ import annotations

import numpy as np

from app.domain.problem import ROUNDING
from app.simulation.arrays import NONE, ProblemArrays
from app.simulation.decorators import compiled, inlined
from app.simulation.deliveries import Unloading, serve
from app.simulation.visit import is_base
from app.simulation.visit_lists import Visits, first_visit

_NO_BASE = -1
"""Base of a flight that begins with what is aboard."""


@compiled
def serve_at_best(arrays: ProblemArrays, visits: Visits, unloading: Unloading, count: int) -> float:
    """As :func:`app.simulation.deliveries.serve`, for refilled and for planned loads.

    Where stocks are limited, ``served[:count]`` has to be all targets.
    """
    if not arrays.terms[0].plans_loading:
        return serve(arrays, visits, unloading, count)
    _begin(arrays, visits, unloading, count)
    total = _list_demands(unloading, arrays.need.shape[2], count)
    bonus = arrays.terms[0].bonus
    for q in range(total):
        demand = unloading.demands[q]
        j, k = demand // 2 // arrays.need.shape[2], demand // 2 % arrays.need.shape[2]
        need, factor = arrays.need[0, j, k], 1.0
        rest = min(need, arrays.beyond[0, j, k]) if bonus > 0.0 else need
        if demand % 2 == 0:
            rest, factor = need - rest, 1.0 + bonus
        if rest > 0.0:
            unloading.value[j] += factor * unloading.worth[j] * _fill(arrays, visits, unloading, j, k, rest)
    earned = 0.0
    for q in range(count):
        earned += unloading.value[unloading.served[q]]
    return earned


@compiled
def _begin(arrays: ProblemArrays, visits: Visits, unloading: Unloading, count: int) -> None:
    """Take all amounts back."""
    unloading.number[1] += 1
    materials = unloading.amount.shape[1]
    for d in range(unloading.stock.shape[0]):
        for k in range(materials):
            unloading.stock[d, k] = arrays.stock[0, d, k]
    for q in range(count):
        unloading.value[unloading.served[q]] = 0.0
        slot = visits.first[unloading.served[q]]
        while slot != NONE:
            f = visits.flight[slot]
            i = f % visits.length.shape[0]
            at_base = _base_of(arrays, visits, f) != _NO_BASE
            unloading.room[f] = arrays.uavs[0, i].capacity if at_base else 0.0
            for k in range(materials):
                unloading.left[f, k] = 0.0 if at_base else arrays.load[0, i, k]
                unloading.amount[slot, k] = 0.0
            unloading.number[2] += 1
            slot = visits.following[slot]


@compiled
def _list_demands(unloading: Unloading, materials: int, count: int) -> int:
    """List the demands of the targets to be served, those worth most by weight first; say how many."""
    place, demands = unloading.place, unloading.demands
    each = 2 * materials
    found = count * each
    if found * found > 8 * unloading.dense.shape[0]:
        unloading.number[0] += 1
        for q in range(count):
            unloading.seen_target[unloading.served[q]] = unloading.number[0]
        found = 0
        for q in range(unloading.dense.shape[0]):
            demand = unloading.dense[q]
            if unloading.seen_target[demand // each] == unloading.number[0]:
                demands[found] = demand
                found += 1
        return found
    for q in range(found):
        demand = unloading.served[q // each] * each + q % each
        at = q
        while at > 0 and place[demands[at - 1]] > place[demand]:
            demands[at] = demands[at - 1]
            at -= 1
        demands[at] = demand
    return found


@inlined
def _base_of(arrays: ProblemArrays, visits: Visits, f: int) -> int:
    """Base that a flight begins at, or _NO_BASE."""
    m = visits.length.shape[0]
    i, s = f % m, f // m
    base = _NO_BASE
    if s < visits.length[i] and is_base(arrays, visits.target[i, s]):
        base = visits.target[i, s] - arrays.need.shape[1] - 1
    return base


@compiled
def _most(arrays: ProblemArrays, visits: Visits, unloading: Unloading, f: int, k: int) -> float:
    """How much of a material a flight can bring beside what it brings already."""
    d = _base_of(arrays, visits, f)
    most: float = unloading.left[f, k]
    if d != _NO_BASE:
        most = unloading.stock[d, k]
        if arrays.weights[0, k] > 0.0:
            most = min(most, unloading.room[f] / arrays.weights[0, k])
    return most


@compiled
def _take(
    arrays: ProblemArrays, visits: Visits, unloading: Unloading, slot: int, k: int, amount: float
) -> None:
    """Let a visit unload so much more, or less, of a material."""
    f = visits.flight[slot]
    d = _base_of(arrays, visits, f)
    unloading.amount[slot, k] += amount
    if d == _NO_BASE:
        unloading.left[f, k] -= amount
    else:
        unloading.room[f] -= amount * arrays.weights[0, k]
        unloading.stock[d, k] -= amount


@compiled
def _fill(arrays: ProblemArrays, visits: Visits, unloading: Unloading, j: int, k: int, need: float) -> float:
    """Bring target `j` as much of material `k`, up to `need`, as those before it leave; return how much."""
    missing = need
    slot = visits.first[j]
    while slot != NONE and missing > 0.0:
        brought = min(_most(arrays, visits, unloading, visits.flight[slot], k), missing)
        if brought > 0.0:
            _take(arrays, visits, unloading, slot, k, brought)
            missing -= brought
        slot = visits.following[slot]
    while arrays.weights[0, k] > 0.0 and missing > ROUNDING * need:
        found = _search(arrays, visits, unloading, j, k)
        if found == NONE:
            break
        moved = _shift(arrays, visits, unloading, found, k, missing)
        missing -= moved
        if moved <= ROUNDING * need:
            break
    return need - missing


@compiled
def _search(arrays: ProblemArrays, visits: Visits, unloading: Unloading, j: int, k: int) -> int:
    """Find the nearest flight with room left that can make room at target `j`; NONE where none can.

    As in :mod:`app.simulation.deliveries`, but what is taken over may be of any material.
    """
    m, home, materials = visits.length.shape[0], arrays.need.shape[1], arrays.need.shape[2]
    unloading.number[0] += 1
    search, serving = unloading.number[0], unloading.number[1]
    tail, head, at, gives, of = 0, 0, j, NONE, k
    while True:
        if unloading.seen_target[at] != search:
            unloading.seen_target[at] = search
            slot = visits.first[at]
            while slot != NONE:
                unloading.number[2] += 1
                f: int = visits.flight[slot]
                if (
                    unloading.seen_flight[f] != search
                    and unloading.dead[f] != serving
                    and _may_take_over(arrays, visits, unloading, f, gives, of)
                ):
                    unloading.seen_flight[f] = search
                    unloading.came_from[f], unloading.taken_from[f], unloading.material[f] = slot, gives, of
                    room = unloading.room[f]
                    if room == np.inf or room > ROUNDING * arrays.uavs[0, f % m].capacity:
                        return f
                    unloading.queue[tail] = f
                    tail += 1
                slot = visits.following[slot]
        # The next target to look at: one where a flight of the queue unloads something.
        gives = NONE
        while head < tail and gives == NONE:
            f = unloading.queue[head]
            i, s = f % m, first_visit(visits, f, home)
            while gives == NONE and s < visits.length[i] and visits.target[i, s] < home:
                unloading.number[2] += 1
                j2 = visits.target[i, s]
                if unloading.seen_target[j2] != search:
                    for k2 in range(materials):
                        least = ROUNDING * arrays.need[0, j2, k2]
                        if arrays.weights[0, k2] > 0.0 and unloading.amount[s * m + i, k2] > least:
                            at, gives, of = j2, s * m + i, k2
                            break
                s += 1
            if gives == NONE:
                head += 1
        if gives == NONE:
            for q in range(tail):
                unloading.dead[unloading.queue[q]] = serving
            return NONE


@inlined
def _may_take_over(
    arrays: ProblemArrays, visits: Visits, unloading: Unloading, f: int, gives: int, k: int
) -> bool:
    """Whether a flight can bring a material in place of another one, or at all: its base has to have it."""
    d = _base_of(arrays, visits, f)
    may = False
    if d != _NO_BASE:
        may = unloading.stock[d, k] > ROUNDING * arrays.stock[0, d, k] or arrays.stock[0, d, k] == np.inf
        if gives != NONE:
            same = d == _base_of(arrays, visits, visits.flight[gives])
            may = same or arrays.stock[0, d, k] == np.inf
    return may


@compiled
def _shift(
    arrays: ProblemArrays, visits: Visits, unloading: Unloading, found: int, k: int, missing: float
) -> float:
    """Move along the path that ends at flight `found` as much weight as it allows; return how much of `k`."""
    weights = arrays.weights
    moved: float = min(missing * weights[0, k], unloading.room[found])
    f = found
    while unloading.taken_from[f] != NONE:
        of = unloading.material[f]
        moved = min(moved, unloading.amount[unloading.taken_from[f], of] * weights[0, of])
        f = visits.flight[unloading.taken_from[f]]
    moved = min(moved, unloading.stock[_base_of(arrays, visits, f), k] * weights[0, k])
    f = found
    while True:
        of = unloading.material[f]
        _take(arrays, visits, unloading, unloading.came_from[f], of, moved / weights[0, of])
        gives = unloading.taken_from[f]
        if gives == NONE:
            return float(moved / weights[0, k])
        _take(arrays, visits, unloading, gives, of, -moved / weights[0, of])
        f = visits.flight[gives]
