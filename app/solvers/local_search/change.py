"""Evaluating a change of one or two routes: what follows from it, visit by visit, and undoing it.

A change proposes new routes for at most two UAVs. It is applied at once, and the visits whose load or need
may have changed are worked off in the order in which they happen, each once; a visit whose load and need come
out as before stops the spreading. Old values go to a journal, so a change that is not kept can be undone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import NONE, Flags, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.heap import pop, push
from app.simulation.visit import is_base, left_of, loaded_of, most_carried
from app.simulation.worth import (
    bonus_of,
    closing_cost,
    decays,
    discount,
    earned_by,
    has_bonus,
    has_closing_cost,
)
from app.solvers.local_search.routes import (
    CLOSING,
    DISTANCE,
    SATISFACTION,
    USELESS,
    Routes,
    changes_in,
    charged_distance,
    landing_of,
    lay,
    link,
    unlink,
)


class Change(NamedTuple):
    """A proposal for at most two routes, and what it takes to undo it.

    Attributes
    ----------
    uav
        (2,) the UAVs; NONE for no second one.
    begin
        (2,) first visit of each that may differ.
    target, length
        (2, S) and (2,) their new routes; after :func:`apply`, the routes before it.
    flown, clock, aloft
        (2, S+1) likewise.
    journal, journal_length
        (S*M,) slots whose evaluation changed, and (1,) how many.
    load, need, earned, useless
        (S*M, …) their values before, by place in the journal.
    landing, changes
        (2,) when the routes end, and what they leave out of ``start_plan``, where that costs reward.
    total
        (4,) the totals before.
    queue, queue_length
        (S*M,) a binary heap of slots to work off, and (1,) its length.
    queued
        (S*M,) number of the change in which a slot was last queued.
    number
        (1,) number of this change.
    """

    uav: Integers
    begin: Integers
    target: Integers
    length: Integers
    flown: Floats
    clock: Floats
    aloft: Floats
    journal: Integers
    journal_length: Integers
    load: Floats
    need: Floats
    earned: Floats
    useless: Flags
    landing: Floats
    changes: Floats
    total: Floats
    queue: Integers
    queue_length: Integers
    queued: Integers
    number: Integers


def new_change(arrays: ProblemArrays) -> Change:
    """Make the scratch space for the first problem of a stack."""
    m, _, k = arrays.shape
    steps = int(arrays.max_steps[0])
    slots = steps * m
    return Change(
        uav=np.full(2, NONE, np.int64),
        begin=np.zeros(2, np.int64),
        target=np.zeros((2, steps), np.int64),
        length=np.zeros(2, np.int64),
        flown=np.zeros((2, steps + 1)),
        clock=np.zeros((2, steps + 1)),
        aloft=np.zeros((2, steps + 1)),
        journal=np.zeros(slots, np.int64),
        journal_length=np.zeros(1, np.int64),
        load=np.zeros((slots, k)),
        need=np.zeros((slots, k)),
        earned=np.zeros(slots),
        useless=np.zeros(slots, np.bool_),
        landing=np.zeros(2),
        changes=np.zeros(2),
        total=np.zeros(4),
        queue=np.zeros(slots, np.int64),
        queue_length=np.zeros(1, np.int64),
        queued=np.zeros(slots, np.int64),
        number=np.zeros(1, np.int64),
    )


@compiled
def propose(routes: Routes, change: Change, side: int, i: int, begin: int, length: int) -> None:
    """Say that the route of UAV `i` will have `length` visits and may differ from visit `begin` on.

    The caller has written the targets from `begin` on into ``change.target[side]``.
    """
    change.uav[side], change.begin[side], change.length[side] = i, begin, length
    for s in range(begin):
        change.target[side, s] = routes.target[i, s]
    change.flown[side, begin] = routes.flown[i, begin]
    change.clock[side, begin] = routes.clock[i, begin]
    change.aloft[side, begin] = routes.aloft[i, begin]


@compiled
def feasible(arrays: ProblemArrays, change: Change) -> bool:
    """Whether rule 2 allows the proposed routes, whatever they unload; works out their times."""
    for side in range(2):
        i = change.uav[side]
        if i != NONE and not lay(
            arrays, i, change.target[side], change.length[side], change.begin[side],
            change.flown[side], change.clock[side], change.aloft[side],
        ):  # fmt: skip
            return False
    return True


@compiled
def extra_distance(arrays: ProblemArrays, routes: Routes, change: Change) -> float:
    """Distance of the proposed routes over that of the present ones, as far as it costs reward."""
    extra = 0.0
    for side in range(2):
        i = change.uav[side]
        if i != NONE:
            extra += charged_distance(arrays, i, change.target[side], change.length[side], change.flown[side])
            extra -= charged_distance(arrays, i, routes.target[i], routes.length[i], routes.flown[i])
    return extra


@compiled
def extra_closing(arrays: ProblemArrays, routes: Routes, change: Change) -> float:
    """What makespan and changes of the proposed routes cost over those of the present ones."""
    if not has_closing_cost(arrays, 0):
        return 0.0
    makespan, changes = 0.0, 0.0
    for i in range(routes.length.shape[0]):
        landing, missing = routes.landing[i], routes.changes[i]
        for side in range(2):
            if change.uav[side] == i:
                landing = landing_of(arrays, i, change.target[side], change.length[side], change.clock[side])
                missing = changes_in(arrays, i, change.target[side], change.length[side])
                change.landing[side], change.changes[side] = landing, missing
        makespan = max(makespan, landing)
        changes += missing
    return closing_cost(arrays, 0, makespan, changes) - routes.total[CLOSING]


@compiled
def extra_time(routes: Routes, change: Change) -> float:
    """Time of the proposed routes over that of the present ones."""
    extra = 0.0
    for side in range(2):
        i = change.uav[side]
        if i != NONE:
            extra += change.clock[side, change.length[side]] - routes.clock[i, routes.length[i]]
    return extra


@compiled
def apply(arrays: ProblemArrays, routes: Routes, change: Change, extra: float, closing: float) -> None:
    """Make the proposal the current plan; `extra` is its :func:`extra_distance`, `closing` as they say.

    The totals before stay readable in ``change.total`` until the next change.
    """
    m = routes.length.shape[0]
    change.number[0] += 1
    change.journal_length[0] = 0
    change.queue_length[0] = 0
    for c in range(routes.total.shape[0]):
        change.total[c] = routes.total[c]
    routes.total[DISTANCE] += extra
    routes.total[CLOSING] += closing
    _take_out(arrays, routes, change)
    _exchange(routes, change)
    for side in range(2):
        i = change.uav[side]
        if i != NONE:
            for s in range(change.begin[side], routes.length[i]):
                slot = s * m + i
                link(arrays, routes, slot, routes.target[i, s])
                _record(routes, change, slot)
                # What was here before is gone: an impossible load makes sure that the visit is worked out.
                routes.load[slot, 0] = -1.0
                routes.earned[slot] = 0.0
                routes.useless[slot] = False
                _enqueue(change, slot)
    while change.queue_length[0] > 0:
        _work_out(arrays, routes, change, _pop(change))


@compiled
def undo(arrays: ProblemArrays, routes: Routes, change: Change) -> None:
    """Take the last applied change back."""
    m = routes.length.shape[0]
    for side in range(2):
        i = change.uav[side]
        if i != NONE:
            for s in range(change.begin[side], routes.length[i]):
                unlink(arrays, routes, s * m + i, routes.target[i, s])
    _exchange(routes, change)
    for side in range(2):
        i = change.uav[side]
        if i != NONE:
            for s in range(change.begin[side], routes.length[i]):
                link(arrays, routes, s * m + i, routes.target[i, s])
    for q in range(change.journal_length[0] - 1, -1, -1):
        slot = change.journal[q]
        for k in range(routes.load.shape[1]):
            routes.load[slot, k] = change.load[q, k]
            routes.need[slot, k] = change.need[q, k]
        routes.earned[slot] = change.earned[q]
        routes.useless[slot] = change.useless[q]
    for c in range(routes.total.shape[0]):
        routes.total[c] = change.total[c]


@compiled
def _take_out(arrays: ProblemArrays, routes: Routes, change: Change) -> None:
    """Remove the visits that may differ, last first, and queue what followed each at its target."""
    m, steps = routes.target.shape
    for s in range(steps - 1, -1, -1):
        # Of two visits in one step the one of the higher index is later.
        for turn in range(2):
            side = turn if change.uav[0] > change.uav[1] else 1 - turn
            i = change.uav[side]
            if i != NONE and change.begin[side] <= s < routes.length[i]:
                slot = s * m + i
                follower = unlink(arrays, routes, slot, routes.target[i, s])
                if follower != NONE:
                    _enqueue(change, follower)
                routes.total[SATISFACTION] -= routes.earned[slot]
                if routes.useless[slot]:
                    routes.total[USELESS] -= 1.0


@compiled
def _exchange(routes: Routes, change: Change) -> None:
    """Swap the present routes with those of the change, from the first visit that may differ on."""
    for side in range(2):
        i = change.uav[side]
        if i == NONE:
            continue
        begin = change.begin[side]
        longest = max(routes.length[i], change.length[side])
        routes.length[i], change.length[side] = change.length[side], routes.length[i]
        for s in range(begin, longest):
            routes.target[i, s], change.target[side, s] = change.target[side, s], routes.target[i, s]
            flown, clock = routes.flown[i, s + 1], routes.clock[i, s + 1]
            routes.flown[i, s + 1], routes.clock[i, s + 1] = (
                change.flown[side, s + 1],
                change.clock[side, s + 1],
            )
            change.flown[side, s + 1], change.clock[side, s + 1] = flown, clock
            routes.aloft[i, s + 1], change.aloft[side, s + 1] = (
                change.aloft[side, s + 1],
                routes.aloft[i, s + 1],
            )
        routes.landing[i], change.landing[side] = change.landing[side], routes.landing[i]
        routes.changes[i], change.changes[side] = change.changes[side], routes.changes[i]


@compiled
def _work_out(arrays: ProblemArrays, routes: Routes, change: Change, slot: int) -> None:
    """Work out what a stop unloads or loads; queue those that depend on it if anything is new."""
    m, materials = routes.length.shape[0], routes.load.shape[1]
    i, s = slot % m, slot // m
    j = routes.target[i, s]
    before = routes.preceding[slot]
    same = True
    for k in range(materials):
        load, need = _load(arrays, routes, i, slot, k), _need(arrays, routes, j, before, k)
        if load != routes.load[slot, k] or need != routes.need[slot, k]:
            same = False
            break
    if same:
        return
    if routes.load[slot, 0] >= 0.0:
        _record(routes, change, slot)
        routes.total[SATISFACTION] -= routes.earned[slot]
        if routes.useless[slot]:
            routes.total[USELESS] -= 1.0
    base = is_base(arrays, j)
    earned, useless = 0.0, not base
    for k in range(materials):
        load, need = _load(arrays, routes, i, slot, k), _need(arrays, routes, j, before, k)
        routes.load[slot, k], routes.need[slot, k] = load, need
        unloaded = 0.0 if base else min(load, need)
        if unloaded > 0.0:
            useless = False
            earned += earned_by(arrays, 0, j, unloaded)
            if has_bonus(arrays, 0):
                earned += bonus_of(arrays, 0, j, k, need, unloaded)
    if decays(arrays, 0) and not base:
        earned *= discount(arrays, 0, routes.clock[i, s + 1] - arrays.areas[0, j].service)
    routes.earned[slot], routes.useless[slot] = earned, useless
    routes.total[SATISFACTION] += earned
    if useless:
        routes.total[USELESS] += 1.0
    if s + 1 < routes.length[i]:
        _enqueue(change, slot + m)
    if routes.following[slot] != NONE:
        _enqueue(change, routes.following[slot])


@compiled
def _load(arrays: ProblemArrays, routes: Routes, i: int, slot: int, k: int) -> float:
    """What UAV `i` carries before a stop: what the one before it left."""
    m = routes.length.shape[0]
    earlier = slot - m
    if earlier < 0:
        return arrays.load[0, i, k]
    load = routes.load[earlier, k]
    if is_base(arrays, routes.target[i, earlier // m]):
        return load + loaded_of(load, arrays.full[0, i, k], routes.need[earlier, k])
    return left_of(load, min(load, routes.need[earlier, k]), most_carried(arrays, 0, i, k))


@compiled
def _need(arrays: ProblemArrays, routes: Routes, j: int, before: int, k: int) -> float:
    """What target `j` needs, or base `j` has, before a stop: what the one before it there left."""
    if is_base(arrays, j):
        if before == NONE:
            return arrays.stock[0, j - arrays.need.shape[1] - 1, k]
        full = arrays.full[0, before % routes.length.shape[0], k]
        return routes.need[before, k] - loaded_of(routes.load[before, k], full, routes.need[before, k])
    if before == NONE:
        return arrays.need[0, j, k]
    unloaded = min(routes.load[before, k], routes.need[before, k])
    return left_of(routes.need[before, k], unloaded, arrays.requested[0, j, k])


@compiled
def _record(routes: Routes, change: Change, slot: int) -> None:
    q = change.journal_length[0]
    change.journal[q] = slot
    for k in range(routes.load.shape[1]):
        change.load[q, k] = routes.load[slot, k]
        change.need[q, k] = routes.need[slot, k]
    change.earned[q] = routes.earned[slot]
    change.useless[q] = routes.useless[slot]
    change.journal_length[0] = q + 1


@compiled
def _enqueue(change: Change, slot: int) -> None:
    """Put a slot on the heap, unless it is there."""
    if change.queued[slot] != change.number[0]:
        change.queued[slot] = change.number[0]
        push(change.queue, change.queue_length[0], slot)
        change.queue_length[0] += 1


@compiled
def _pop(change: Change) -> int:
    """Take the earliest slot off the heap."""
    slot = pop(change.queue, change.queue_length[0])
    change.queue_length[0] -= 1
    return slot
