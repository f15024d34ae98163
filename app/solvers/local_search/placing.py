"""Where targets are put into one or two proposed routes, by what they are likely to earn for their detour."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled, inlined
from app.simulation.legs import UNREACHABLE
from app.simulation.visit import START, farthest, flown_with_return, is_base, is_unlimited, left_of, leg
from app.simulation.worth import earned_by
from app.solvers.local_search.change import Change
from app.solvers.local_search.neighbourhood import Neighbourhood
from app.solvers.local_search.routes import Routes, lay

_CANDIDATES = 40
"""Targets at most that are looked at to be put in."""


class Placing(NamedTuple):
    """The candidates of a large move, and where each is put in best; scratch space.

    Attributes
    ----------
    target, weight
        (C,) targets that may be put in, and a random factor of what each is likely to earn; 0 once it is in,
        or cannot be.
    need
        (C, K) what the visits that stay leave it.
    value, side, place, base
        (C,) where each is put in best: what that is likely to bring, in which route, at which place, and the
        base at which the UAV reloads before it, or NONE.
    longer, had
        (C,) and (C, K) by how much the flight becomes longer, and the amounts that the UAV has left in it.
    slack
        (2, S+1) air length that is left of the flight in which each place of the two routes is.
    unloaded
        (2, S, K) what each stop is likely to unload; what it loads, for a reload.
    spare
        (2, S+1, K) amounts that the UAV is likely to have left at the end of that flight.
    dirty
        (2,) first stop whose times are not worked out.
    """

    target: Integers
    weight: Floats
    need: Floats
    value: Floats
    side: Integers
    place: Integers
    base: Integers
    longer: Floats
    had: Floats
    slack: Floats
    unloaded: Floats
    spare: Floats
    dirty: Integers


def new_placing(arrays: ProblemArrays) -> Placing:
    """Make the scratch space for the first problem of a stack."""
    steps, materials = int(arrays.max_steps[0]), arrays.shape[2]
    return Placing(
        target=np.zeros(_CANDIDATES, np.int64),
        weight=np.zeros(_CANDIDATES),
        need=np.zeros((_CANDIDATES, materials)),
        value=np.zeros(_CANDIDATES),
        side=np.zeros(_CANDIDATES, np.int64),
        place=np.zeros(_CANDIDATES, np.int64),
        base=np.zeros(_CANDIDATES, np.int64),
        longer=np.zeros(_CANDIDATES),
        had=np.zeros((_CANDIDATES, materials)),
        slack=np.zeros((2, steps + 1)),
        unloaded=np.zeros((2, steps, materials)),
        spare=np.zeros((2, steps + 1, materials)),
        dirty=np.zeros(2, np.int64),
    )


@compiled
def work_out_needs(arrays: ProblemArrays, routes: Routes, change: Change, work: Placing, count: int) -> None:
    """Work out what the visits that stay leave each candidate."""
    m = routes.length.shape[0]
    for c in range(count):
        j = work.target[c]
        for k in range(work.need.shape[1]):
            work.need[c, k] = arrays.need[0, j, k]
        slot = routes.first[j]
        while slot != NONE:
            if not _is_taken_out(change.uav, change.length, change.target, slot % m, j):
                for k in range(work.need.shape[1]):
                    unloaded = min(routes.load[slot, k], routes.need[slot, k])
                    work.need[c, k] = left_of(work.need[c, k], unloaded, arrays.requested[0, j, k])
            slot = routes.following[slot]


@compiled
def _is_taken_out(uav: Integers, length: Integers, target: Integers, i: int, j: int) -> bool:
    """Whether the proposed routes leave out a UAV's visit of a target."""
    out = False
    for side in range(2):
        if uav[side] == i:
            out = True
            for s in range(length[side]):
                out = out and target[side, s] != j
    return out


@compiled
def work_out_spare(arrays: ProblemArrays, change: Change, work: Placing, side: int) -> None:
    """Work out the air length and the amounts that each flight of a route has left."""
    i, length = change.uav[side], change.length[side]
    for k in range(work.spare.shape[2]):
        load = arrays.load[0, i, k]
        for s in range(length):
            j = change.target[side, s]
            work.spare[side, s, k] = load
            if is_base(arrays, j):
                full = arrays.full[0, i, k]
                load = full if is_unlimited(arrays, j) else min(full, load + work.unloaded[side, s, k])
            else:
                load = max(0.0, load - work.unloaded[side, s, k])
        work.spare[side, length, k] = load
        for s in range(length - 1, -1, -1):
            if not is_base(arrays, change.target[side, s]):
                work.spare[side, s, k] = work.spare[side, s + 1, k]
    most = farthest(arrays.uavs[0, i].voyage) - arrays.uavs[0, i].dis
    left = np.inf
    for s in range(length, -1, -1):
        at = START if s == 0 else change.target[side, s - 1]
        if arrays.terms[0].in_wind:
            left = np.inf
        elif s == length:
            if s > 0:
                left = most - flown_with_return(arrays, 0, i, at, change.flown[side, length])
        elif is_base(arrays, change.target[side, s]):
            j = change.target[side, s]
            left = most - flown_with_return(arrays, 0, i, j, change.flown[side, s] + leg(arrays, 0, i, at, j))
        work.slack[side, s] = left


@compiled
def find_places(
    arrays: ProblemArrays, near: Neighbourhood, change: Change, work: Placing, sides: int, count: int,
    price: float, departing: float, changed: int, begin: int, more: int,
) -> None:  # fmt: skip
    """Find where each candidate is put in best, within range.

    Parameters
    ----------
    arrays, near, change, work
        As everywhere.
    sides, count
        Routes, and candidates.
    price, departing
        What a unit of distance costs, and which share of the way to the first visit of a route counts.
    changed, begin, more
        The route into which that many stops were put at a place since the last time; NONE at first.
    """
    steps, materials = change.target.shape[1], work.need.shape[1]
    for c in range(count):
        if work.weight[c] == 0.0:
            continue
        j = work.target[c]
        keeps = changed != NONE
        if keeps and work.value[c] > 0.0 and work.side[c] == changed:
            if work.place[c] == begin or work.base[c] != NONE or change.length[changed] == steps:
                keeps = False
            else:
                if work.place[c] > begin:
                    work.place[c] += more
                s = work.place[c]
                keeps = work.longer[c] <= work.slack[changed, s]
                for k in range(materials):
                    keeps = keeps and work.spare[changed, s, k] >= min(work.need[c, k], work.had[c, k])
        if not keeps:
            work.value[c] = 0.0
        for side in range(sides):
            i, length = change.uav[side], change.length[side]
            if (keeps and side != changed) or arrays.kept_range[0, i, j] >= UNREACHABLE or length == steps:
                continue
            first, last = (begin, begin + more) if keeps else (0, length)
            flights = near.near_base.shape[1] > 0 and length + 1 < steps
            gain = 0.0
            for s in range(first, last + 1):
                at = START if s == 0 else change.target[side, s - 1]
                if s == first or is_base(arrays, at):
                    gain = _gain_in(arrays, work, c, side, s)
                    if gain == 0.0 and not flights and near.near_base.shape[1] == 0:
                        break
                ends = s == length or is_base(arrays, change.target[side, s])
                if at != j and gain > 0.0 and (ends or change.target[side, s] != j):
                    detour = leg(arrays, 0, i, at, j)
                    longer = detour
                    if s < length:
                        after = change.target[side, s]
                        longer += leg(arrays, 0, i, j, after) - leg(arrays, 0, i, at, after)
                        detour = longer
                    elif s > 0:
                        longer += arrays.kept_range[0, i, j] - arrays.kept_range[0, i, at]
                        if arrays.terms[0].charge_return:
                            detour = longer
                    else:
                        detour *= departing
                    value = gain - price * detour
                    if value > work.value[c] and longer <= work.slack[side, s]:
                        work.value[c], work.longer[c] = value, longer
                        work.side[c], work.place[c], work.base[c] = side, s, NONE
                        for k in range(materials):
                            work.had[c, k] = work.spare[side, s, k]
                if ends and flights and not is_base(arrays, at):
                    base = near.near_base[j, 0]
                    gain_after = _gain_after(arrays, work, c, side, s, i, base)
                    detour = leg(arrays, 0, i, at, base) + leg(arrays, 0, i, base, j)
                    if s < length:
                        after = change.target[side, s]
                        detour += leg(arrays, 0, i, j, after) - leg(arrays, 0, i, at, after)
                    value = gain_after - price * detour
                    if value > work.value[c]:
                        work.value[c] = value
                        work.side[c], work.place[c], work.base[c] = side, s, base


@inlined
def _gain_in(arrays: ProblemArrays, work: Placing, c: int, side: int, s: int) -> float:
    """What a visit of a candidate is likely to earn in the flight in which a place is."""
    unloaded = 0.0
    for k in range(work.need.shape[1]):
        unloaded += min(work.need[c, k], work.spare[side, s, k])
    return work.weight[c] * earned_by(arrays, 0, work.target[c], unloaded) if unloaded > 0.0 else 0.0


@inlined
def _gain_after(arrays: ProblemArrays, work: Placing, c: int, side: int, s: int, i: int, base: int) -> float:
    """What a visit of a candidate is likely to earn after a reload at the end of the flight of a place."""
    unloaded = 0.0
    if arrays.kept_range[0, i, base] < UNREACHABLE:
        for k in range(work.need.shape[1]):
            full = arrays.full[0, i, k]
            if not is_unlimited(arrays, base):
                full = min(full, work.spare[side, s, k] + arrays.stock[0, base - arrays.need.shape[1] - 1, k])
            unloaded += min(work.need[c, k], full)
    return work.weight[c] * earned_by(arrays, 0, work.target[c], unloaded) if unloaded > 0.0 else 0.0


@compiled
def put_in(arrays: ProblemArrays, change: Change, work: Placing, c: int) -> bool:
    """Put a candidate into a proposed route where rule 2 allows it; it is none any more."""
    side, s, j, base = work.side[c], work.place[c], work.target[c], work.base[c]
    length = change.length[side]
    work.weight[c] = 0.0
    more = 1 if base == NONE else 2
    for q in range(length - 1, s - 1, -1):
        change.target[side, q + more] = change.target[side, q]
        for k in range(work.need.shape[1]):
            work.unloaded[side, q + more, k] = work.unloaded[side, q, k]
    if base != NONE:
        change.target[side, s] = base
        for k in range(work.need.shape[1]):
            work.unloaded[side, s, k] = arrays.full[0, change.uav[side], k]
            if not is_unlimited(arrays, base):
                left = arrays.stock[0, base - arrays.need.shape[1] - 1, k]
                work.unloaded[side, s, k] = min(work.unloaded[side, s, k], left)
    change.target[side, s + more - 1] = j
    for k in range(work.need.shape[1]):
        spare = work.spare[side, s, k] if base == NONE else arrays.full[0, change.uav[side], k]
        work.unloaded[side, s + more - 1, k] = min(work.need[c, k], spare)
    change.length[side] = length + more
    change.begin[side] = min(change.begin[side], s)
    work.dirty[side] = min(work.dirty[side], s)
    if lay_out(arrays, change, work, side):
        return True
    for q in range(s, length):
        change.target[side, q] = change.target[side, q + more]
        for k in range(work.need.shape[1]):
            work.unloaded[side, q, k] = work.unloaded[side, q + more, k]
    change.length[side] = length
    work.dirty[side] = s
    return False


@compiled
def lay_out(arrays: ProblemArrays, change: Change, work: Placing, side: int) -> bool:
    """Work out the times of a proposed route, as far as they are not; False where rule 2 forbids it."""
    length = change.length[side]
    if work.dirty[side] > length:
        return True
    if not lay(
        arrays, change.uav[side], change.target[side], length, work.dirty[side],
        change.flown[side], change.clock[side], change.aloft[side],
    ):  # fmt: skip
        return False
    work.dirty[side] = length + 1
    return True
