"""How much each visit unloads, decided with the plan: section 3a of the rules (README.md in this folder).

For given routes the best amounts solve a linear program, which falls apart by material into transportation
problems: flights supply what they carry, targets demand what they need, visits connect them, and a unit is
worth what rule 5 says of the target that gets it. A flight is what a UAV does until it reloads. Which one
brings it does not matter, so the demands that can be met together form a polymatroid, on which the greedy
rule is exact: serve the targets in the order of their worth, each as far as is possible without taking from
those before it. "As far as possible" is found by augmenting paths: a flight that has nothing left takes over
from another at a target both visit, and so on. Where the first share of a need earns more, a target has two
demands.

Where stocks are limited, a reload counts as if nothing were left aboard before, in the order of the plan: the
simulator then finds as much aboard, or more. How much a reload takes is decided in
:mod:`app.simulation.loads` where that is planned.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import ROUNDING
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled, inlined
from app.simulation.visit import is_base, is_unlimited
from app.simulation.visit_lists import Visits, first_visit
from app.simulation.worth import worths


class Unloading(NamedTuple):
    """Amounts of a plan, and scratch space of their search; F flights are numbered by slots.

    Attributes
    ----------
    amount
        (S*M, K) what each visit unloads; valid for the visits of the last targets that were served.
    supply
        (F, K) what each flight begins with, where stocks are limited.
    left
        (F, K) what each flight still has; of all materials where loading is planned, otherwise of one, in the
        first column.
    room
        (F,) weight that each flight may still carry, where loading is planned.
    stock
        (D, K) what is left at the bases.
    worth, order, rank
        (N,) worth of a unit at each target, the targets in falling order of it, and their places there.
    dense, place
        (2*N*K,) demands in falling order of their worth by weight, and their places there, where loading is
        planned; number ``2 * (j * K + k) + h`` is for material k of target j, the first share where h is 0.
    demands
        (2*N*K,) those that are to be met.
    value
        (N,) what is earned at each target; valid for those that were served.
    served
        (N,) targets, those to be served first.
    seen_target, seen_flight
        (N,) and (F,) number of the search that has seen them.
    dead
        (F,) the serving in which a flight was found to reach nobody with anything left.
    queue, came_from
        (F,) flights of a search in the order of their finding; the slot at which each takes over, and
    taken_from, material
        (F,) the slot at which it gives up what the one before it takes over, NONE for the first, and of which
        material that is.
    number
        (3,) numbers of the last search and of the last serving, and visits looked at in all.
    """

    amount: Floats
    supply: Floats
    left: Floats
    room: Floats
    stock: Floats
    worth: Floats
    order: Integers
    rank: Integers
    dense: Integers
    place: Integers
    demands: Integers
    value: Floats
    served: Integers
    seen_target: Integers
    seen_flight: Integers
    dead: Integers
    queue: Integers
    came_from: Integers
    taken_from: Integers
    material: Integers
    number: Integers


def new_unloading(arrays: ProblemArrays) -> Unloading:
    """Make the scratch space for the first problem of a stack."""
    m, n, k = arrays.shape
    slots = int(arrays.max_steps[0]) * m
    flights = max(slots, m) if arrays.n_bases else m
    # Where a part of a need earns more, all parts do by the same factor.
    worth = worths(arrays) if arrays.terms["bonus"][0] == 0.0 else arrays.areas["unit"][0].copy()
    order = np.argsort(-worth, kind="stable")
    dense = _by_weight(arrays, worth)
    return Unloading(
        amount=np.zeros((slots, k)),
        supply=np.zeros((flights, k)),
        left=np.zeros((flights, k)),
        room=np.zeros(flights),
        stock=arrays.stock[0].copy(),
        worth=worth,
        order=order,
        rank=_places(order),
        dense=dense,
        place=_places(dense),
        demands=np.zeros(len(dense), np.int64),
        value=np.zeros(n),
        served=np.zeros(n, np.int64),
        seen_target=np.zeros(n, np.int64),
        seen_flight=np.zeros(flights, np.int64),
        dead=np.zeros(flights, np.int64),
        queue=np.zeros(flights, np.int64),
        came_from=np.zeros(flights, np.int64),
        taken_from=np.zeros(flights, np.int64),
        material=np.zeros(flights, np.int64),
        number=np.zeros(3, np.int64),
    )


def _by_weight(arrays: ProblemArrays, worth: Floats) -> Integers:
    """Return demands in falling order of their worth by weight; none where loading is not planned."""
    if not arrays.terms["plans_loading"][0]:
        return np.zeros(0, np.int64)
    weights = arrays.weights[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        by_weight = np.where(worth[:, None] > 0.0, worth[:, None] / weights, 0.0)
    parts = by_weight[:, :, None] * np.array([1.0 + float(arrays.terms["bonus"][0]), 1.0])
    return np.argsort(-parts.ravel(), kind="stable")


def _places(order: Integers) -> Integers:
    places = np.empty_like(order)
    places[order] = np.arange(len(order))
    return places


@inlined
def _supply(arrays: ProblemArrays, visits: Visits, unloading: Unloading, f: int, k: int) -> float:
    """Amount of a material that a flight begins with."""
    m = visits.length.shape[0]
    i, s = f % m, f // m
    supply: float = 0.0 if arrays.ret[0, i] else arrays.load[0, i, k]
    if arrays.stock.shape[1] > 0 and s < visits.length[i] and is_base(arrays, visits.target[i, s]):
        unlimited = is_unlimited(arrays, visits.target[i, s])
        supply = arrays.full[0, i, k] if unlimited else unloading.supply[f, k]
    return supply


@compiled
def any_limited(arrays: ProblemArrays) -> bool:
    """Whether a base has no more than some amount, so that what one flight takes another cannot."""
    limited = False
    for d in range(arrays.stock.shape[1]):
        limited = limited or arrays.stock[0, d, 0] < np.inf
    return limited


@compiled
def _load_in_turn(arrays: ProblemArrays, visits: Visits, unloading: Unloading) -> None:
    """Fill ``supply`` for the reloads, in the order of the plan, as if nothing were left aboard before."""
    m, home = visits.length.shape[0], arrays.need.shape[1]
    for d in range(unloading.stock.shape[0]):
        for k in range(unloading.stock.shape[1]):
            unloading.stock[d, k] = arrays.stock[0, d, k]
    for s in range(visits.target.shape[1]):
        for i in range(m):
            if s < visits.length[i] and visits.target[i, s] > home:
                d = visits.target[i, s] - home - 1
                for k in range(unloading.stock.shape[1]):
                    taken = min(arrays.full[0, i, k], unloading.stock[d, k])
                    unloading.supply[s * m + i, k] = taken
                    unloading.stock[d, k] -= taken


@compiled
def serve(arrays: ProblemArrays, visits: Visits, unloading: Unloading, count: int) -> float:
    """Fill ``amount`` with the best amounts for ``served[:count]``, and return what they earn.

    Loads are those that reloads refill; :func:`app.simulation.loads.serve_at_best` is for any loading.

    Parameters
    ----------
    arrays
        A stack of one problem.
    visits
        Every visit of a UAV that visits one of these targets must be to one of them, or a reload.
    unloading
        ``served[:count]`` are the targets in the order of their rank.
    count
        How many targets.
    """
    bonus = arrays.terms[0].bonus
    if any_limited(arrays):
        _load_in_turn(arrays, visits, unloading)
    for q in range(count):
        unloading.value[unloading.served[q]] = 0.0
    for k in range(unloading.amount.shape[1]):
        unloading.number[1] += 1
        for q in range(count):
            slot = visits.first[unloading.served[q]]
            while slot != NONE:
                f = visits.flight[slot]
                unloading.left[f, 0] = _supply(arrays, visits, unloading, f, k)
                unloading.amount[slot, k] = 0.0
                unloading.number[2] += 1
                slot = visits.following[slot]
        if bonus == 0.0:
            for q in range(count):
                j = unloading.served[q]
                need = arrays.need[0, j, k]
                unloading.value[j] += unloading.worth[j] * _fill(arrays, visits, unloading, j, k, need)
            continue
        # Two lists in the order of their worth, merged: first shares, and what is beyond.
        first, beyond = 0, 0
        while beyond < count:
            j = unloading.served[beyond]
            factor = 1.0
            if first < count:
                j1 = unloading.served[first]
                if unloading.worth[j1] * (1.0 + bonus) >= unloading.worth[j]:
                    j, factor = j1, 1.0 + bonus
            rest = min(arrays.need[0, j, k], arrays.beyond[0, j, k])
            need = rest if factor == 1.0 else arrays.need[0, j, k] - rest
            if factor == 1.0:
                beyond += 1
            else:
                first += 1
            filled = _fill(arrays, visits, unloading, j, k, need)
            unloading.value[j] += factor * unloading.worth[j] * filled
    earned: float = 0.0
    for q in range(count):
        earned += unloading.value[unloading.served[q]]
    return earned


@compiled
def _fill(arrays: ProblemArrays, visits: Visits, unloading: Unloading, j: int, k: int, need: float) -> float:
    """Bring target `j` as much of material `k`, up to `need`, as those before it leave; return how much."""
    missing = need
    slot = visits.first[j]
    while slot != NONE and missing > 0.0:
        f = visits.flight[slot]
        brought = min(unloading.left[f, 0], missing)
        if brought > 0.0:
            unloading.amount[slot, k] += brought
            unloading.left[f, 0] -= brought
            missing -= brought
        slot = visits.following[slot]
    while missing > ROUNDING * need:
        found = _search(arrays, visits, unloading, j, k)
        if found == NONE:
            break
        missing -= _shift(visits, unloading, found, k, missing)
    return need - missing


@compiled
def _search(arrays: ProblemArrays, visits: Visits, unloading: Unloading, j: int, k: int) -> int:
    """Find the nearest flight with something left that can free one at target `j`; NONE where none can.

    Where none can, none ever will for the targets to come: all that were seen are marked as dead.
    """
    m, home = visits.length.shape[0], arrays.need.shape[1]
    unloading.number[0] += 1
    search, serving = unloading.number[0], unloading.number[1]
    tail, head, at, gives = 0, 0, j, NONE
    while True:
        # Every flight that visits `at` could take over what `gives` unloads there, or serve `j` itself.
        if unloading.seen_target[at] != search:
            unloading.seen_target[at] = search
            slot = visits.first[at]
            while slot != NONE:
                unloading.number[2] += 1
                f: int = visits.flight[slot]
                if unloading.seen_flight[f] != search and unloading.dead[f] != serving:
                    unloading.seen_flight[f] = search
                    unloading.came_from[f], unloading.taken_from[f] = slot, gives
                    if unloading.left[f, 0] > ROUNDING * _supply(arrays, visits, unloading, f, k):
                        return f
                    unloading.queue[tail] = f
                    tail += 1
                slot = visits.following[slot]
        # The next target to look at: one where a flight of the queue unloads something.
        gives = NONE
        while head < tail and gives == NONE:
            f = unloading.queue[head]
            i, s = f % m, first_visit(visits, f, home)
            supply = _supply(arrays, visits, unloading, f, k)
            while s < visits.length[i] and visits.target[i, s] < home:
                unloading.number[2] += 1
                j2 = visits.target[i, s]
                least = ROUNDING * min(supply, arrays.need[0, j2, k])
                if unloading.amount[s * m + i, k] > least and unloading.seen_target[j2] != search:
                    at, gives = j2, s * m + i
                    break
                s += 1
            if gives == NONE:
                head += 1
        if gives == NONE:
            for q in range(tail):
                unloading.dead[unloading.queue[q]] = serving
            return NONE


@compiled
def _shift(visits: Visits, unloading: Unloading, found: int, k: int, missing: float) -> float:
    """Move along the path that ends at flight `found` as much as it allows; return how much."""
    moved: float = min(missing, unloading.left[found, 0])
    f = found
    while unloading.taken_from[f] != NONE:
        moved = min(moved, unloading.amount[unloading.taken_from[f], k])
        f = visits.flight[unloading.taken_from[f]]
    unloading.left[found, 0] -= moved
    f = found
    while True:
        unloading.amount[unloading.came_from[f], k] += moved
        gives = unloading.taken_from[f]
        if gives == NONE:
            return moved
        unloading.amount[gives, k] -= moved
        f = visits.flight[gives]
