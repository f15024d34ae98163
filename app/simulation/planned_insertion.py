"""What one more visit does to a flown plan whose unloading is planned: the best amounts are worked out anew.

Where nothing becomes illegal by it, what an additional visit adds to the satisfaction does not depend on its
place in the route; and whatever becomes illegal only takes from that. So it is worked out once for a UAV and
a target, and only for the targets that are connected with them by visits: the others keep their amounts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import ROUNDING
from app.simulation import simulator, visit, worth
from app.simulation.arrays import NONE, Flags, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled, inlined
from app.simulation.deliveries import Unloading, new_unloading, serve
from app.simulation.flown_plan import FlownPlan
from app.simulation.insertion import (
    CHANGED,
    GAIN,
    HELPS,
    MADE,
    MARK,
    TURNOVER,
    WORK,
    Trial,
    begin,
    charge,
    exchange,
    gain,
)
from app.simulation.visit_lists import Visits, move_slot, visits_of

ONLY_LOOK = -2
"""In place of a place: what the visit adds is worked out, and no more."""

UAV, TARGET, UNLOADS, ADDS = range(4)
"""Places in a row of ``PlannedTrial.known``."""

ALL_KEPT, SOME_KEPT = range(2)
"""Rows of ``change``, ``idle`` and ``known``."""


class PlannedTrial(NamedTuple):
    """Scratch space for working out what an additional visit adds.

    Attributes
    ----------
    visits
        The plan's; changed during a trial, and put back.
    unloading
        Amounts.
    worth
        (N,) what the plan earns at each target.
    kept, left_out
        (L+1,) visits of a UAV that stay legal; visits that are not flown.
    change
        (2, 2) what the visit adds to the reward and what it turns over, apart from the way of its own UAV:
        where all visits are kept, and where some have become illegal.
    idle
        (2, L+1) visits of the UAV that unload nothing then.
    known
        (2, 5) UAV and target that this is known of, whether the visit unloads anything, whether it adds to
        the satisfaction, whether the target gets more.
    """

    visits: Visits
    unloading: Unloading
    worth: Floats
    kept: Flags
    left_out: Flags
    change: Floats
    idle: Flags
    known: Integers


def new_planned_trial(arrays: ProblemArrays, plan: FlownPlan, actions: Integers) -> PlannedTrial:
    """Make the scratch space for trials of a plan, and work out what it earns at each target."""
    steps = plan.leg.shape[1]
    room = arrays._replace(max_steps=np.array([steps]))
    visits, unloading = visits_of(room, actions), new_unloading(room)
    unloading.served[:] = unloading.order
    serve(arrays, visits, unloading, len(unloading.served))
    return PlannedTrial(
        visits,
        unloading,
        unloading.value.copy(),
        np.zeros(steps, np.bool_),
        np.zeros(steps, np.bool_),
        np.zeros((2, 2)),
        np.zeros((2, steps), np.bool_),
        np.full((2, 4), NONE, np.int64),
    )


@compiled
def gain_of_planned_visit(
    arrays: ProblemArrays,
    plan: FlownPlan,
    trial: Trial,
    planned: PlannedTrial,
    i: int,
    place: int,
    j: int,
    exact: bool,
) -> float:
    """As :func:`app.simulation.insertion.gain_of_visit`, where unloading is planned.

    Parameters
    ----------
    arrays, plan, i, place, j
        As there; `place` may also be ONLY_LOOK, to fill row ALL_KEPT of `planned`.
    trial, planned
        Scratch space. ``trial.tally[MADE]`` says whether the visit was legal and unloads something.
    exact
        Otherwise a visit that cannot gain may have any change that is not above 0, and every UAV has the load
        that it has in the plan.
    """
    tally, total, known = trial.tally, trial.total, planned.known
    begin(trial, i, place, j)
    whole = True
    if place != ONLY_LOOK:
        whole = _keep_legal(arrays, plan, trial, planned)
        if place >= 0 and tally[MADE] == 0:
            return 0.0
    row = SOME_KEPT if exact or not whole else ALL_KEPT
    for wanted in range(2):
        if wanted == ALL_KEPT and (exact or (known[ALL_KEPT, UAV] == i and known[ALL_KEPT, TARGET] == j)):
            continue
        if wanted == SOME_KEPT and row == ALL_KEPT:
            continue
        if wanted == SOME_KEPT and not exact:
            _leave_out(plan, planned, i, ALL_KEPT)
            _charge_way(arrays, plan.visits, plan.leg, plan.back, planned.left_out, total, i, place, j)
            most: float = total[GAIN] + planned.change[ALL_KEPT, GAIN]
            if most <= 0.0:
                return most
        _amounts_anew(arrays, plan, trial, planned, wanted)
    if place == ONLY_LOOK:
        return 0.0
    if known[row, UNLOADS] == 0:
        tally[MADE] = 0
        return 0.0
    _leave_out(plan, planned, i, row)
    total[GAIN], total[TURNOVER] = planned.change[row, GAIN], planned.change[row, TURNOVER]
    _charge_way(arrays, plan.visits, plan.leg, plan.back, planned.left_out, total, i, place, j)
    return gain(total)


@inlined
def _keep_legal(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, planned: PlannedTrial) -> bool:
    """Fly the UAV's route with the additional visit, and note what stays legal; say whether all does."""
    i, place, j = trial.inserted[0], trial.inserted[1], trial.inserted[2]
    episodes, length = trial.episodes, plan.visits.length[i]
    episodes.at[0, i] = visit.START
    episodes.flown[0, i], episodes.clock[0, i] = arrays.uavs[0, i].dis, visit.ready(arrays, 0, i)
    episodes.aloft[0, i], episodes.visits[0, i] = visit.airborne(arrays, 0, i), 0
    steps, whole = 0, True
    # Number s, then the additional visit where it comes before it.
    for q in range(2 * length + 1):
        s = q // 2
        additional = q % 2 == 0
        if additional and s != place:
            continue
        x = j if additional else plan.visits.target[i, s]
        trial.tally[WORK] += 1
        legal = steps < arrays.max_steps[0] and (
            simulator.reach_verdict(arrays, episodes, 0, i, x) == visit.ALLOWED
        )
        if legal:
            simulator.fly_to(arrays, episodes, 0, i, x)
            steps += 1
        if additional:
            trial.tally[MADE] = 1 if legal else 0
            if not legal:
                break
        else:
            planned.kept[s] = legal
            whole = whole and legal
    return whole


@inlined
def _leave_out(plan: FlownPlan, planned: PlannedTrial, i: int, row: int) -> None:
    """Fill ``left_out`` for the UAV of the additional visit."""
    for s in range(plan.visits.length[i]):
        planned.left_out[s] = not planned.kept[s] or planned.idle[row, s]


@inlined
def _amounts_anew(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, planned: PlannedTrial, row: int
) -> None:
    """Work out the best amounts with the additional visit, and fill a row of what is known from them."""
    visits, unloading, total = planned.visits, planned.unloading, trial.total
    i, place, j = trial.inserted[0], trial.inserted[1], trial.inserted[2]
    m, length = plan.back.shape[0], plan.visits.length[i]
    # A visit that is given up becomes another one to the additional target, which changes nothing there.
    for s in range(length):
        if row == SOME_KEPT and not planned.kept[s]:
            move_slot(visits, s * m + i, visits.target[i, s], j)
            visits.target[i, s] = j
    if place != NONE:
        visits.target[i, length] = j
        move_slot(visits, length * m + i, NONE, j)
        visits.length[i] += 1
    count = _connected(
        visits,
        plan.visits.target,
        unloading,
        trial.uav_mark,
        trial.target_mark,
        trial.changed,
        trial.tally,
        i,
        j,
    )
    serve(arrays, visits, unloading, count)
    trial.tally[WORK] += unloading.number[2] + count
    unloading.number[2] = 0
    total[GAIN], total[TURNOVER] = 0.0, 0.0
    for q in range(count):
        x = unloading.served[q]
        before, after = planned.worth[x], unloading.value[x]
        if abs(after - before) > ROUNDING * max(before, after):
            charge(total, after - before)
    planned.known[row, UAV], planned.known[row, TARGET] = i if row == ALL_KEPT else NONE, j
    planned.known[row, ADDS] = 1 if gain(total) > 0.0 else 0
    for c in range(trial.tally[CHANGED]):
        h, idle = trial.changed[c], False
        for s in range(plan.visits.length[h]):
            planned.left_out[s] = _unloads_nothing(
                arrays.load, arrays.need, visits.target, unloading.amount, h, s
            )
            idle = idle or planned.left_out[s]
            if h == i:
                planned.idle[row, s] = planned.left_out[s]
        if idle and h != i:
            _charge_way(arrays, plan.visits, plan.leg, plan.back, planned.left_out, total, h, NONE, j)
    planned.change[row, GAIN], planned.change[row, TURNOVER] = total[GAIN], total[TURNOVER]
    total[GAIN], total[TURNOVER] = 0.0, 0.0
    useful = place == NONE or _can_unload(arrays.load, arrays.need, visits, unloading.amount, i, j)
    planned.known[row, UNLOADS] = 1 if useful else 0
    lacks, lacked = arrays.areas[0, j].need_total, 0.0
    slot = visits.first[j]
    while slot != NONE:
        for k in range(plan.need.shape[2]):
            lacks -= unloading.amount[slot, k]
        slot = visits.following[slot]
    for k in range(plan.need.shape[2]):
        lacked += plan.remaining[j, k]
    trial.tally[HELPS] = 1 if lacks < lacked * (1.0 - ROUNDING) else 0
    if place != NONE:
        visits.length[i] -= 1
        move_slot(visits, length * m + i, j, NONE)
    for s in range(length):
        if row == SOME_KEPT and not planned.kept[s]:
            visits.target[i, s] = plan.visits.target[i, s]
            move_slot(visits, s * m + i, j, visits.target[i, s])


@compiled
def _unloads_nothing(load: Floats, need: Floats, target: Integers, amount: Floats, i: int, s: int) -> bool:
    """Whether what a visit unloads is nothing, or only rounding."""
    for k in range(amount.shape[1]):
        if amount[s * target.shape[0] + i, k] > ROUNDING * min(load[0, i, k], need[0, target[i, s], k]):
            return False
    return True


@compiled
def _can_unload(load: Floats, need: Floats, visits: Visits, amount: Floats, i: int, j: int) -> bool:
    """Whether every visit of UAV `i` to target `j` can unload something.

    It unloads something in all of them together, which they can share; or it has something left over, that it
    can bring in place of another UAV.
    """
    m = visits.length.shape[0]
    for k in range(amount.shape[1]):
        if not visit.can_unload(load[0, i, k], need[0, j, k]):
            continue
        left = load[0, i, k]
        for s in range(visits.length[i]):
            left -= amount[s * m + i, k]
            if visits.target[i, s] == j and not _unloads_nothing(load, need, visits.target, amount, i, s):
                return True
        if left > ROUNDING * load[0, i, k]:
            return True
    return False


@compiled
def _charge_way(
    arrays: ProblemArrays,
    visits: Visits,
    leg: Floats,
    back: Floats,
    left_out: Flags,
    total: Floats,
    h: int,
    place: int,
    j: int,
) -> None:
    """Charge the legs of a route that differ from the plan's: `j` is added, ``left_out`` are not flown."""
    length = visits.length[h]
    at = before = visit.START
    for s in range(length + 1):
        if s == place:
            charge(total, -worth.cost_of(arrays, 0, visit.leg(arrays, 0, h, at, j)))
            at = j
        if s == length:
            break
        x = visits.target[h, s]
        if left_out[s]:
            charge(total, worth.cost_of(arrays, 0, leg[h, s]))
        else:
            if at != before:
                now = visit.leg(arrays, 0, h, at, x)
                exchange(total, -worth.cost_of(arrays, 0, leg[h, s]), -worth.cost_of(arrays, 0, now))
            at = x
        before = x
    if arrays.terms[0].charge_return and at != before:
        now = visit.way_home(arrays, 0, h, at)
        exchange(total, -worth.cost_of(arrays, 0, back[h]), -worth.cost_of(arrays, 0, now))


@compiled
def _connected(
    visits: Visits,
    routes: Integers,
    unloading: Unloading,
    uav_mark: Integers,
    target_mark: Integers,
    changed: Integers,
    tally: Integers,
    i: int,
    j: int,
) -> int:
    """List the targets that visits connect with the additional one, by their rank, and their UAVs."""
    served, order, rank = unloading.served, unloading.order, unloading.rank
    tally[MARK] += 1
    mark = tally[MARK]
    m = visits.length.shape[0]
    served[0], target_mark[j] = j, mark
    changed[0], uav_mark[i] = i, mark
    uavs, found, seen, head = 1, 1, 0, 0
    while True:
        # First the routes of all UAVs that are known, then the UAVs of all targets that are known.
        while seen < uavs:
            h = changed[seen]
            for s in range(visits.length[h]):
                # What the plan has in a visit that is given up is concerned, too; the last one is additional.
                x = visits.target[h, s] if h != i or s == visits.length[h] - 1 else routes[h, s]
                if target_mark[x] != mark:
                    target_mark[x] = mark
                    served[found] = x
                    found += 1
            seen += 1
        if head == found:
            break
        slot = visits.first[served[head]]
        while slot != NONE:
            if uav_mark[slot % m] != mark:
                uav_mark[slot % m] = mark
                changed[uavs] = slot % m
                uavs += 1
            slot = visits.following[slot]
        head += 1
    tally[CHANGED] = uavs
    if found * found > order.shape[0]:
        q = 0
        for position in range(order.shape[0]):
            if target_mark[order[position]] == mark:
                served[q] = order[position]
                q += 1
        return found
    for q in range(1, found):
        x, position = served[q], q
        while position > 0 and rank[served[position - 1]] > rank[x]:
            served[position] = served[position - 1]
            position -= 1
        served[position] = x
    return found
