"""What one more visit does to a flown plan whose unloading is planned: the best amounts are worked out anew.

Where nothing becomes illegal by it, what an additional visit adds to the satisfaction does not depend on its
place in the route; and whatever becomes illegal only takes from that. So it is worked out once for a UAV and
a target, and only for the targets that are connected with them by visits: the others keep their amounts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import ROUNDING
from app.simulation import simulator
from app.simulation.arrays import Flags, Floats, Integers, ProblemArrays
from app.simulation.flown_plan import CRUMB, FlownPlan
from app.simulation.insertion import (
    CHANGED,
    GAIN,
    MADE,
    MARK,
    TURNOVER,
    WORK,
    Trial,
    begin,
    charge,
    gain,
)
from app.simulation.unloading import NONE, Unloading, Visits, new_unloading, serve, visits_of

UAV, TARGET, UNLOADS, ADDS, MORE = range(5)
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
        np.full((2, 5), NONE, np.int64),
    )


@simulator.compiled
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
        As there.
    trial, planned
        Scratch space. ``trial.tally[MADE]`` says whether the visit was legal and unloads something.
    exact
        Otherwise a visit that cannot gain may have any change that is not above 0, and every UAV has the
        load that it has in the plan. An exact gain is in row SOME_KEPT, whether some are kept or all.
    """
    begin(trial, i, place, j)
    whole = _keep_legal(arrays, plan, trial, planned)
    if place >= 0 and trial.tally[MADE] == 0:
        return 0.0
    row = SOME_KEPT if exact or not whole else ALL_KEPT
    if exact:
        _amounts_anew(arrays, plan, trial, planned, row)
    else:
        look_at_all_kept(arrays, plan, trial, planned, i, j)
        if not whole:
            _charge_own_way(arrays, plan, trial, planned, ALL_KEPT)
            most: float = trial.total[GAIN] + planned.change[ALL_KEPT, GAIN]
            if most <= 0.0:
                return most
            trial.total[GAIN], trial.total[TURNOVER] = 0.0, 0.0
            _amounts_anew(arrays, plan, trial, planned, row)
    if planned.known[row, UNLOADS] == 0:
        trial.tally[MADE] = 0
        return 0.0
    _charge_own_way(arrays, plan, trial, planned, row)
    trial.total[GAIN] += planned.change[row, GAIN]
    trial.total[TURNOVER] += planned.change[row, TURNOVER]
    return gain(trial)


@simulator.compiled
def look_at_all_kept(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, planned: PlannedTrial, i: int, j: int
) -> bool:
    """Work out what a visit adds where nothing becomes illegal by it, unless it is known already.

    Returns
    -------
    bool
        Whether it adds to the satisfaction.
    """
    known = planned.known
    if known[ALL_KEPT, UAV] != i or known[ALL_KEPT, TARGET] != j:
        trial.inserted[0], trial.inserted[2] = i, j
        place, trial.inserted[1] = trial.inserted[1], 0
        _amounts_anew(arrays, plan, trial, planned, ALL_KEPT)
        trial.inserted[1] = place
    return bool(known[ALL_KEPT, ADDS] == 1)


@simulator.compiled
def _keep_legal(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, planned: PlannedTrial) -> bool:
    """Fly the UAV's route with the additional visit, and note what stays legal; say whether all does."""
    whole = True
    i, place, j = trial.inserted[0], trial.inserted[1], trial.inserted[2]
    episodes, length = trial.episodes, plan.visits.length[i]
    episodes.at[0, i] = simulator.START
    episodes.flown[0, i], episodes.clock[0, i] = arrays.dis[0, i], 0.0
    steps = 0
    for s in range(length + 1):
        if s == place and steps < arrays.max_steps[0]:
            if simulator.reach_verdict(arrays, episodes, 0, i, j) != simulator.ALLOWED:
                return False
            simulator.fly_to(arrays, episodes, 0, i, j)
            trial.tally[MADE] = 1
            steps += 1
        if s == length:
            break
        following = plan.visits.target[i, s]
        trial.tally[WORK] += 1
        planned.kept[s] = (
            steps < arrays.max_steps[0]
            and simulator.reach_verdict(arrays, episodes, 0, i, following) == simulator.ALLOWED
        )
        if planned.kept[s]:
            simulator.fly_to(arrays, episodes, 0, i, following)
            steps += 1
        whole = whole and planned.kept[s]
    return whole


@simulator.compiled
def _amounts_anew(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, planned: PlannedTrial, row: int
) -> None:
    """Work out the best amounts with the additional visit, and fill a row of what is known from them."""
    visits, unloading = planned.visits, planned.unloading
    i, place, j = trial.inserted[0], trial.inserted[1], trial.inserted[2]
    m, length = plan.back.shape[0], plan.visits.length[i]
    # A visit that is given up becomes another one to the additional target, which changes nothing there.
    for s in range(length):
        if row == SOME_KEPT and not planned.kept[s]:
            _move(visits, s * m + i, visits.target[i, s], j)
            visits.target[i, s] = j
    if place >= 0:
        visits.target[i, length] = j
        _move(visits, length * m + i, NONE, j)
        visits.length[i] += 1
    count = _connected(plan, trial, planned)
    serve(arrays, visits, unloading, count)
    trial.tally[WORK] += unloading.number[2] + count
    unloading.number[2] = 0
    _fill_row(arrays, plan, trial, planned, row, count)
    if place >= 0:
        visits.length[i] -= 1
        _move(visits, length * m + i, j, NONE)
    for s in range(length):
        if row == SOME_KEPT and not planned.kept[s]:
            visits.target[i, s] = plan.visits.target[i, s]
            _move(visits, s * m + i, j, visits.target[i, s])


@simulator.compiled
def _fill_row(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, planned: PlannedTrial, row: int, count: int
) -> None:
    """Compare the new amounts of the connected targets with the plan's."""
    visits, unloading = planned.visits, planned.unloading
    i, place, j = trial.inserted[0], trial.inserted[1], trial.inserted[2]
    m = plan.back.shape[0]
    gained, turned = trial.total[GAIN], trial.total[TURNOVER]
    trial.total[GAIN], trial.total[TURNOVER] = 0.0, 0.0
    for q in range(count):
        x = unloading.served[q]
        change = unloading.value[x] - planned.worth[x]
        if abs(change) > ROUNDING * max(unloading.value[x], planned.worth[x]):
            charge(trial, change)
    planned.known[row, UAV], planned.known[row, TARGET] = i, j
    planned.known[row, ADDS] = 1 if gain(trial) > 0.0 else 0
    for c in range(trial.tally[CHANGED]):
        h, idle = trial.changed[c], False
        for s in range(plan.visits.length[h]):
            planned.left_out[s] = _unloads_nothing(arrays, planned, s * m + h)
            idle = idle or planned.left_out[s]
            if h == i:
                planned.idle[row, s] = planned.left_out[s]
        if idle and h != i:
            _charge_way(arrays, plan, trial, planned, h, NONE, j)
    planned.change[row, GAIN], planned.change[row, TURNOVER] = trial.total[GAIN], trial.total[TURNOVER]
    trial.total[GAIN], trial.total[TURNOVER] = gained, turned
    planned.known[row, UNLOADS] = 1 if place < 0 or _can_unload(arrays, planned, i, j) else 0
    got, before = 0.0, 0.0
    slot = visits.first[j]
    while slot != NONE:
        for k in range(plan.need.shape[2]):
            got += unloading.amount[slot, k]
        slot = visits.following[slot]
    for k in range(plan.need.shape[2]):
        before += plan.end_need[j, k]
    lacks = arrays.need_total[0, j] - got
    planned.known[row, MORE] = 1 if lacks < before * (1.0 - CRUMB) else 0


@simulator.compiled
def _can_unload(arrays: ProblemArrays, planned: PlannedTrial, i: int, j: int) -> bool:
    """Whether every visit of UAV `i` to target `j` can unload something.

    It unloads something in all of them together, which they can share; or it has something left over, that it
    can bring in place of another UAV.
    """
    visits, unloading, m = planned.visits, planned.unloading, planned.visits.length.shape[0]
    for k in range(unloading.amount.shape[1]):
        if arrays.load[0, i, k] <= 0.0 or arrays.need[0, j, k] <= 0.0:
            continue
        left = arrays.load[0, i, k]
        for s in range(visits.length[i]):
            left -= unloading.amount[s * m + i, k]
            if visits.target[i, s] == j and not _unloads_nothing(arrays, planned, s * m + i):
                return True
        if left > CRUMB * arrays.load[0, i, k]:
            return True
    return False


@simulator.compiled
def _unloads_nothing(arrays: ProblemArrays, planned: PlannedTrial, slot: int) -> bool:
    """Whether what a visit unloads is nothing, or only rounding."""
    m = planned.visits.length.shape[0]
    i = slot % m
    j = planned.visits.target[i, slot // m]
    for k in range(planned.unloading.amount.shape[1]):
        if planned.unloading.amount[slot, k] > ROUNDING * min(arrays.load[0, i, k], arrays.need[0, j, k]):
            return False
    return True


@simulator.compiled
def _charge_own_way(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, planned: PlannedTrial, row: int
) -> None:
    """Charge the way of the UAV of the additional visit past what it still visits."""
    i, place, j = trial.inserted[0], trial.inserted[1], trial.inserted[2]
    for s in range(plan.visits.length[i]):
        planned.left_out[s] = not planned.kept[s] or planned.idle[row, s]
    _charge_way(arrays, plan, trial, planned, i, place, j)


@simulator.compiled
def _charge_way(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, planned: PlannedTrial, h: int, place: int, j: int
) -> None:
    """Charge the legs of a route that differ from the plan's: `j` is added, ``left_out`` are not flown."""
    episodes = trial.episodes
    length, weight = plan.visits.length[h], arrays.weight[0]
    episodes.at[0, h] = simulator.START
    before = simulator.START
    for s in range(length + 1):
        if s == place:
            charge(trial, -weight * simulator.leg_to(arrays, episodes, 0, h, j))
            episodes.at[0, h] = j
        if s == length:
            break
        following = plan.visits.target[h, s]
        if planned.left_out[s]:
            charge(trial, weight * plan.leg[h, s])
        else:
            if episodes.at[0, h] != before:
                charge(trial, weight * plan.leg[h, s])
                charge(trial, -weight * simulator.leg_to(arrays, episodes, 0, h, following))
            episodes.at[0, h] = following
        before = following
    if arrays.charge_return[0] and episodes.at[0, h] != before:
        charge(trial, weight * plan.back[h])
        charge(trial, -weight * simulator.leg_home(arrays, episodes, 0, h))


@simulator.compiled
def _move(visits: Visits, slot: int, old: int, new: int) -> None:
    """Take a slot out of one target's list and put it in its order into another's; NONE is no target."""
    if old != NONE:
        if visits.first[old] == slot:
            visits.first[old] = visits.following[slot]
        else:
            at = visits.first[old]
            while visits.following[at] != slot:
                at = visits.following[at]
            visits.following[at] = visits.following[slot]
    if new != NONE:
        if visits.first[new] == NONE or visits.first[new] > slot:
            visits.following[slot] = visits.first[new]
            visits.first[new] = slot
        else:
            at = visits.first[new]
            while visits.following[at] != NONE and visits.following[at] < slot:
                at = visits.following[at]
            visits.following[slot] = visits.following[at]
            visits.following[at] = slot


@simulator.compiled
def _connected(plan: FlownPlan, trial: Trial, planned: PlannedTrial) -> int:
    """List the targets that visits connect with the additional one, by their rank, and their UAVs."""
    visits, unloading = planned.visits, planned.unloading
    trial.tally[MARK] += 1
    trial.tally[CHANGED] = 0
    m, found = plan.back.shape[0], 1
    unloading.served[0] = trial.inserted[2]
    trial.target_mark[trial.inserted[2]] = trial.tally[MARK]
    found = _add_route(plan.visits, trial, unloading, trial.inserted[0], found)
    head = 0
    while head < found:
        slot = visits.first[unloading.served[head]]
        while slot != NONE:
            if trial.uav_mark[slot % m] != trial.tally[MARK]:
                found = _add_route(visits, trial, unloading, slot % m, found)
            slot = visits.following[slot]
        head += 1
    if found * found > unloading.order.shape[0]:
        q = 0
        for place in range(unloading.order.shape[0]):
            if trial.target_mark[unloading.order[place]] == trial.tally[MARK]:
                unloading.served[q] = unloading.order[place]
                q += 1
        return found
    for q in range(1, found):
        x, place = unloading.served[q], q
        while place > 0 and unloading.rank[unloading.served[place - 1]] > unloading.rank[x]:
            unloading.served[place] = unloading.served[place - 1]
            place -= 1
        unloading.served[place] = x
    return found


@simulator.compiled
def _add_route(visits: Visits, trial: Trial, unloading: Unloading, h: int, found: int) -> int:
    """Add a UAV and the targets of its route to the lists; return how many targets are listed."""
    trial.uav_mark[h] = trial.tally[MARK]
    trial.changed[trial.tally[CHANGED]] = h
    trial.tally[CHANGED] += 1
    for s in range(visits.length[h]):
        x = visits.target[h, s]
        if trial.target_mark[x] != trial.tally[MARK]:
            trial.target_mark[x] = trial.tally[MARK]
            unloading.served[found] = x
            found += 1
    return found
