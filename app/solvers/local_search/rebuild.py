"""A large move: stretches of one or two routes are taken out, and visits put in where they fit best.

Ruin and recreate by strings of visits that lie near each other (Christiaens and Vanden Berghe, "Slack
induction by string removals for vehicle routing problems", Transportation Science 2020), where not all has to
be visited: what is put in is chosen by what it is likely to earn for its detour, at a price of distance that
is drawn for each move. Whether the change is kept is decided as for all moves, by what it really earns.
"""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import NONE, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.visit import is_base, loaded_of
from app.solvers.local_search.change import Change, propose
from app.solvers.local_search.neighbourhood import Neighbourhood, draw, target_after
from app.solvers.local_search.placing import (
    Placing,
    find_places,
    lay_out,
    put_in,
    work_out_needs,
    work_out_spare,
)
from app.solvers.local_search.routes import DISTANCE, SATISFACTION, Routes

_LONGEST = 8
"""Visits at most that are taken out of one route."""

_NONE_OUT, _ALL_OUT = 0.15, 0.1
"""Probabilities that nothing of a route is taken out, and that all is, if that is not much."""

_NEAR, _NEAR_SHARE = 10, 0.7
"""Targets near the place of the move that are looked at besides those that were taken out."""

_DEARER = 0.7
"""Probability that a detour costs more than its distance."""


@compiled
def rebuild(
    arrays: ProblemArrays,
    routes: Routes,
    near: Neighbourhood,
    change: Change,
    work: Placing,
    rng: np.random.Generator,
) -> bool:
    """Propose one or two rebuilt routes, which rule 2 allows; False where nothing came of it."""
    m = routes.length.shape[0]
    change.uav[0], change.uav[1] = NONE, NONE
    i = near.active[draw(rng, len(near.active))]
    s = draw(rng, routes.length[i] + 1)
    seed = target_after(routes, near, rng, i, s)
    slot = routes.first[seed]
    if slot != NONE:
        while routes.following[slot] != NONE and rng.random() < 0.5:
            slot = routes.following[slot]
        i2, s2 = slot % m, slot // m
    else:
        i2 = near.active[draw(rng, len(near.active))]
        s2 = draw(rng, routes.length[i2] + 1)
    count = _take_out(arrays, routes, change, work, rng, 0, i, s, 0)
    sides = 1
    if count >= 0 and i2 != i:
        sides = 2
        count = _take_out(arrays, routes, change, work, rng, 1, i2, s2, count)
    if count < 0:
        return False
    count = _add_near(near, work, rng, seed, count)
    _recreate(arrays, routes, near, change, work, rng, sides, count)
    for side in range(sides):
        if not lay_out(arrays, change, work, side):
            return False
    for side in range(sides):
        if _is_same(routes, change, side):
            change.uav[side] = NONE
    return change.uav[0] != NONE or change.uav[1] != NONE


@compiled
def _take_out(
    arrays: ProblemArrays, routes: Routes, change: Change, work: Placing, rng: np.random.Generator,
    side: int, i: int, s: int, count: int,
) -> int:  # fmt: skip
    """Propose a route without a stretch around a stop; return how many candidates, or -1 if that fails."""
    length, m = routes.length[i], routes.length.shape[0]
    out = _draw_length(rng, length)
    begin = max(0, min(s - draw(rng, out + 1), length - out))
    to = 0
    for q in range(length):
        j, slot = routes.target[i, q], q * m + i
        if begin <= q < begin + out and not is_base(arrays, j):
            count = _note(work, j, count)
        elif q < begin or not (
            is_base(arrays, j) and to > 0 and is_base(arrays, change.target[side, to - 1])
        ):
            change.target[side, to] = j
            for k in range(work.unloaded.shape[2]):
                load, need = routes.load[slot, k], routes.need[slot, k]
                work.unloaded[side, to, k] = (
                    loaded_of(load, arrays.full[0, i, k], need) if is_base(arrays, j) else min(load, need)
                )
            to += 1
    propose(routes, change, side, i, begin, to)
    for q in range(begin):
        change.flown[side, q], change.clock[side, q], change.aloft[side, q] = (
            routes.flown[i, q], routes.clock[i, q], routes.aloft[i, q],
        )  # fmt: skip
    work.dirty[side] = begin
    return count if lay_out(arrays, change, work, side) else -1


@compiled
def _draw_length(rng: np.random.Generator, length: int) -> int:
    """Draw how many stops of a route are taken out: few more often than many, now and then none or all."""
    most = min(length, _LONGEST)
    kind = rng.random()
    if most == 0 or kind < _NONE_OUT:
        return 0
    if kind < _NONE_OUT + _ALL_OUT:
        return length if length <= 2 * _LONGEST else most
    u = rng.random()
    return 1 + int(u * u * most)


@compiled
def _note(work: Placing, j: int, count: int) -> int:
    """Add a target to the candidates, unless it is there; return how many they are."""
    if count == len(work.target):
        return count
    for c in range(count):
        if work.target[c] == j:
            return count
    work.target[count] = j
    return count + 1


@compiled
def _add_near(near: Neighbourhood, work: Placing, rng: np.random.Generator, seed: int, count: int) -> int:
    """Add targets near the place of the move to the candidates."""
    count = _note(work, seed, count)
    for q in range(min(_NEAR, near.near_target.shape[1])):
        if rng.random() < _NEAR_SHARE:
            count = _note(work, near.near_target[seed, q], count)
    return count


@compiled
def _recreate(
    arrays: ProblemArrays, routes: Routes, near: Neighbourhood, change: Change, work: Placing,
    rng: np.random.Generator, sides: int, count: int,
) -> None:  # fmt: skip
    """Put candidates in, one after the other, where and as long as that seems to pay."""
    price = arrays.terms[0].weight
    if rng.random() < _DEARER and routes.total[DISTANCE] > 0.0:
        # Range and time that a detour takes are worth something: an eighth to twice what plans earn with it.
        price += routes.total[SATISFACTION] / routes.total[DISTANCE] * 2.0 ** (4.0 * rng.random() - 3.0)
    # Where one visit does not pay for the way there, several may: now and then the way is free.
    departing = 0.0 if rng.random() < 0.5 else 1.0
    for side in range(sides):
        work_out_spare(arrays, change, work, side)
    for c in range(count):
        work.weight[c] = 0.7 + 0.6 * rng.random()
    work_out_needs(arrays, routes, change, work, count)
    find_places(arrays, near, change, work, sides, count, price, departing, NONE, 0, 0)
    while True:
        best, chosen = 0.0, NONE
        for c in range(count):
            if work.weight[c] > 0.0 and work.value[c] > best:
                best, chosen = work.value[c], c
        if chosen == NONE:
            break
        side, s, more = work.side[chosen], work.place[chosen], 1 if work.base[chosen] == NONE else 2
        if put_in(arrays, change, work, chosen):
            work_out_spare(arrays, change, work, side)
            find_places(arrays, near, change, work, sides, count, price, departing, side, s, more)


@compiled
def _is_same(routes: Routes, change: Change, side: int) -> bool:
    """Whether a proposed route is the present one."""
    i = change.uav[side]
    if routes.length[i] != change.length[side]:
        return False
    for s in range(change.begin[side], change.length[side]):
        if routes.target[i, s] != change.target[side, s]:
            return False
    return True
