"""What one more visit does to a flown plan: exact, and without flying what it does not touch.

In every step each UAV takes the next visit of its route that is legal, so what comes out is the reward of a
legal plan, whatever the additional visit does to those after it. Only UAVs that carry, or are, something
else than in the plan are flown again, on the one simulator, and with them those whose areas they serve
differently.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import ROUNDING
from app.simulation import simulator, visit, worth
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled, inlined
from app.simulation.episodes import Episodes
from app.simulation.flown_plan import FlownPlan
from app.simulation.heap import pop, push

MARK, QUEUED, CHANGED, WORK, MADE, HELPS = range(6)
"""Places in ``Trial.tally``."""

GAIN, TURNOVER = range(2)
"""Places in ``Trial.total``."""

_ROUNDING_OF_VALUES = 1e-6
"""Share of two values that differ which counts as turned over: their difference has the rounding of both."""


class Trial(NamedTuple):
    """One additional visit, and scratch space for flying it.

    Attributes
    ----------
    episodes
        One episode; of it are valid the UAVs and targets that carry the current mark.
    uav_mark, target_mark
        (M,) and (L,) the number of the trial that last changed them; L are targets and bases.
    cursor
        (M,) the next visit of a changed UAV in its route.
    changed
        (M,) changed UAVs, ``tally[CHANGED]`` of them.
    queue, queue_mark
        (slots,) a heap of slots that differ from the plan, ``tally[QUEUED]`` of them, and the number of the
        trial that queued each.
    inserted
        (3,) UAV, place in its route, and target of the additional visit.
    tally
        (6,) number of the trial, lengths of the lists, visits flown in all trials, whether the additional
        visit was legal, and whether its target gets more.
    total
        (2,) change of the reward, and the sum of the absolute values that it is made of.
    """

    episodes: Episodes
    uav_mark: Integers
    target_mark: Integers
    cursor: Integers
    changed: Integers
    queue: Integers
    queue_mark: Integers
    inserted: Integers
    tally: Integers
    total: Floats


def new_trial(arrays: ProblemArrays, plan: FlownPlan) -> Trial:
    """Make the scratch space for trials of a plan."""
    m = arrays.shape[0]
    slots = plan.leg.size
    return Trial(
        simulator.new_episodes(arrays, 1),
        np.zeros(m, np.int64),
        np.zeros(arrays.between.shape[2], np.int64),
        np.zeros(m, np.int64),
        np.zeros(m, np.int64),
        np.zeros(slots, np.int64),
        np.zeros(slots, np.int64),
        np.zeros(3, np.int64),
        np.zeros(6, np.int64),
        np.zeros(2),
    )


@compiled
def gain_of_visit(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, i: int, place: int, j: int, reloaded: bool
) -> float:
    """Change of the reward with target `j` as visit `place` of UAV `i`, where unloading is greedy.

    Parameters
    ----------
    arrays
        The problem, or one in which range, deadlines or steps allow more.
    plan
        The plan in the problem as it is.
    trial
        Scratch space. ``tally[MADE]`` says whether the visit was legal, ``tally[HELPS]`` whether the target
        gets more.
    i, place, j
        The visit; where `place` is negative there is none, only another load.
    reloaded
        Whether UAV `i` has another load in `arrays` than in the plan.

    Returns
    -------
    float
        The change; 0 where it is only rounding.
    """
    m, episodes, tally, total = plan.back.shape[0], trial.episodes, trial.tally, trial.total
    visits, end = plan.visits, arrays.max_steps[0]
    begin(trial, i, place, j)
    mark = tally[MARK]
    first = 0 if reloaded else place
    take_up(arrays, plan, trial, i, first)
    if reloaded:
        for k in range(plan.load.shape[2]):
            episodes.load[0, i, k] = arrays.load[0, i, k]
    change_uav(trial, i, first)
    _push(trial.queue, trial.queue_mark, tally, first * m + i)
    while tally[QUEUED] > 0:
        slot = _pop(trial.queue, tally)
        tally[WORK] += 1
        s, h, settled = slot // m, slot % m, False
        if trial.uav_mark[h] != mark:
            # As it was until now, but the need of the target that it visits has changed.
            x = visits.target[h, s]
            take_up(arrays, plan, trial, h, s)
            if simulator.verdict(arrays, episodes, 0, h, x) == visit.ALLOWED:
                exchange(total, plan.value[h, s], simulator.act(arrays, episodes, 0, h, x))
                same = True
                for k in range(plan.load.shape[2]):
                    same = same and episodes.load[0, h, k] == plan.load[h, s + 1, k]
                if same:
                    continue
                settled = True
            change_uav(trial, h, s + 1 if settled else s)
        length = visits.length[h] + (1 if h == i and place >= 0 else 0)
        if not settled:
            if s < visits.length[h]:
                # What the plan has here is not done, or not as it was.
                x = visits.target[h, s]
                need_at(arrays, plan, trial, x, slot)
                _open(arrays, visits.first, visits.following, trial, x, slot)
            while s < end and trial.cursor[h] < length and not settled:
                q = _place_in_plan(trial, h, trial.cursor[h])
                trial.cursor[h] += 1
                x = j if q == NONE else visits.target[h, q]
                before = 0.0 if q == NONE else plan.value[h, q]
                need_at(arrays, plan, trial, x, slot)
                if simulator.verdict(arrays, episodes, 0, h, x) == visit.ALLOWED:
                    exchange(total, before, simulator.act(arrays, episodes, 0, h, x))
                    _open(arrays, visits.first, visits.following, trial, x, slot)
                    if q == NONE:
                        tally[MADE] = 1
                    settled = True
                else:
                    charge(total, -before)
        if (s + 1 < end and trial.cursor[h] < length) or s + 1 < visits.length[h]:
            _push(trial.queue, trial.queue_mark, tally, slot + m)
    for c in range(tally[CHANGED]):
        h = trial.changed[c]
        length = visits.length[h] + (1 if h == i and place >= 0 else 0)
        for cursor in range(trial.cursor[h], length):
            q = _place_in_plan(trial, h, cursor)
            if q != NONE:
                charge(total, -plan.value[h, q])
        if arrays.terms[0].charge_return:
            back = simulator.leg_home(arrays, episodes, 0, h)
            exchange(total, -worth.cost_of(arrays, 0, plan.back[h]), -worth.cost_of(arrays, 0, back))
    if worth.has_closing_cost(arrays, 0):
        exchange(
            total, -closing_cost_of(arrays, plan, trial, False), -closing_cost_of(arrays, plan, trial, True)
        )
    if trial.target_mark[j] == mark:
        lacked, lacks = 0.0, 0.0
        for k in range(plan.load.shape[2]):
            lacked += plan.remaining[j, k]
            lacks += episodes.need[0, j, k]
        tally[HELPS] = 1 if lacks < lacked * (1.0 - ROUNDING) else 0
    return gain(total)


@compiled
def gain_of_undisturbed_visit(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, i: int, place: int, j: int
) -> float:
    """As :func:`gain_of_visit` for a visit that changes nothing but the way of its UAV.

    The UAV and the target are as they are in the plan at that place.
    """
    total = trial.total
    trial.tally[MADE] = 1
    charge(total, simulator.act(arrays, trial.episodes, 0, i, j))
    if place < plan.visits.length[i]:
        leg = visit.leg(arrays, 0, i, j, plan.visits.target[i, place])
        exchange(total, -worth.cost_of(arrays, 0, plan.leg[i, place]), -worth.cost_of(arrays, 0, leg))
    elif arrays.terms[0].charge_return:
        back = simulator.leg_home(arrays, trial.episodes, 0, i)
        exchange(total, -worth.cost_of(arrays, 0, plan.back[i]), -worth.cost_of(arrays, 0, back))
    return gain(total)


@inlined
def is_undisturbed(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, i: int, place: int, j: int) -> bool:
    """Whether a visit after which all others are legal changes nothing but the way of its UAV.

    The UAV and the target are as they are in the plan at that place, and the plan does not visit it any
    more. The UAV has enough for its later visits, and nobody comes in between where they are a step later.
    """
    m, length = plan.back.shape[0], plan.visits.length[i]
    undisturbed = arrays.stock.shape[1] == 0 and not worth.has_closing_cost(arrays, 0)
    undisturbed = undisturbed and (place == length or not worth.decays(arrays, 0))
    if undisturbed and place < length:
        for k in range(plan.load.shape[2]):
            taken = min(plan.load[i, place, k], trial.episodes.need[0, j, k])
            undisturbed = undisturbed and taken <= plan.load[i, length, k]
        for s in range(place, length):
            following = plan.visits.following[s * m + i]
            undisturbed = undisturbed and (following == NONE or following > (s + 1) * m + i)
    return undisturbed


@compiled
def closing_cost_of(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, changed: bool) -> float:
    """What makespan and changes cost in the plan, or with what the trial has changed in it."""
    episodes, makespan, changes = trial.episodes, 0.0, 0.0
    for h in range(plan.back.shape[0]):
        length = plan.visits.length[h]
        if changed and trial.uav_mark[h] == trial.tally[MARK]:
            if episodes.visits[0, h] > 0:
                landing = episodes.clock[0, h] + visit.time_home(arrays, 0, h, episodes.at[0, h])
                makespan = max(makespan, landing)
            for w in range(arrays.before.shape[2]):
                if arrays.before[0, h, w] != NONE and not episodes.kept[0, h, w]:
                    changes += 1.0
            continue
        if length > 0:
            at = plan.visits.target[h, length - 1]
            makespan = max(makespan, plan.clock[h, length] + visit.time_home(arrays, 0, h, at))
        for w in range(arrays.before.shape[2]):
            if arrays.before[0, h, w] != NONE and not _visits_before(arrays, plan, h, length, w):
                changes += 1.0
    return worth.closing_cost(arrays, 0, makespan, changes)


@inlined
def _visits_before(arrays: ProblemArrays, plan: FlownPlan, h: int, place: int, w: int) -> bool:
    """Whether a UAV makes a visit of ``start_plan`` among the first `place` visits of its route."""
    found = False
    for s in range(place):
        found = found or plan.visits.target[h, s] == arrays.before[0, h, w]
    return found


@inlined
def begin(trial: Trial, i: int, place: int, j: int) -> None:
    """Begin another trial: nothing is changed yet."""
    trial.tally[MARK] += 1
    trial.tally[QUEUED], trial.tally[CHANGED] = 0, 0
    trial.tally[MADE], trial.tally[HELPS] = 0, 0
    trial.inserted[0], trial.inserted[1], trial.inserted[2] = i, place, j
    trial.total[GAIN], trial.total[TURNOVER] = 0.0, 0.0


@compiled
def charge(total: Floats, change: float) -> None:
    """Add a change of the reward."""
    total[GAIN] += change
    total[TURNOVER] += abs(change)


@compiled
def exchange(total: Floats, before: float, after: float) -> None:
    """Put one value in the place of another."""
    if after != before:
        total[GAIN] += after - before
        total[TURNOVER] += abs(after - before) + _ROUNDING_OF_VALUES * (abs(before) + abs(after))


@compiled
def gain(total: Floats) -> float:
    """Change of the reward in all; 0 where it is only the rounding of what is turned over."""
    change: float = total[GAIN]
    return 0.0 if abs(change) <= ROUNDING * total[TURNOVER] else change


@inlined
def move_to(plan: FlownPlan, trial: Trial, i: int, place: int) -> None:
    """Put UAV `i` where it is in the plan before its visit `place`."""
    trial.episodes.at[0, i] = visit.START if place == 0 else plan.visits.target[i, place - 1]
    trial.episodes.flown[0, i] = plan.flown[i, place]
    trial.episodes.clock[0, i] = plan.clock[i, place]
    trial.episodes.aloft[0, i] = plan.aloft[i, place]
    trial.episodes.visits[0, i] = place
    trial.episodes.ret[0, i] = False


@inlined
def take_up(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, i: int, place: int) -> None:
    """Put UAV `i` where it is in the plan before its visit `place`, with what it has then."""
    move_to(plan, trial, i, place)
    for w in range(trial.episodes.kept.shape[2]):
        trial.episodes.kept[0, i, w] = _visits_before(arrays, plan, i, place, w)
    for k in range(plan.load.shape[2]):
        trial.episodes.load[0, i, k] = plan.load[i, place, k]


@inlined
def need_at(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, j: int, slot: int) -> bool:
    """Give a stop what it needs, or has, in the plan just before a slot, unless the trial has changed that.

    Returns
    -------
    bool
        Whether it is unchanged, and has no visits in the plan from the slot on.
    """
    alone = False
    if trial.target_mark[j] != trial.tally[MARK]:
        m = plan.back.shape[0]
        later = plan.visits.first[j]
        while later != NONE and later < slot:
            later = plan.visits.following[later]
        alone = bool(later == NONE)
        d = j - arrays.need.shape[1] - 1
        for k in range(plan.need.shape[2]):
            if d >= 0:
                there = plan.stock[d, k] if alone else plan.need[later % m, later // m, k]
                trial.episodes.stock[0, d, k] = there
            elif alone:
                trial.episodes.need[0, j, k] = plan.remaining[j, k]
            else:
                trial.episodes.need[0, j, k] = plan.need[later % m, later // m, k]
    return alone


@inlined
def _place_in_plan(trial: Trial, h: int, cursor: int) -> int:
    """Which visit of the plan a visit of a UAV's route is; NONE for the additional one."""
    place = trial.inserted[1]
    q = cursor
    if h == trial.inserted[0] and place >= 0 and cursor >= place:
        q = NONE if cursor == place else cursor - 1
    return q


@inlined
def change_uav(trial: Trial, h: int, cursor: int) -> None:
    """Let a UAV go its own way from now on."""
    trial.uav_mark[h] = trial.tally[MARK]
    trial.cursor[h] = cursor
    trial.changed[trial.tally[CHANGED]] = h
    trial.tally[CHANGED] += 1


@inlined
def _open(
    arrays: ProblemArrays, first: Integers, following: Integers, trial: Trial, j: int, slot: int
) -> None:
    """Let a target, or base, have its own need from now on: the plan's later stops there are flown again."""
    if trial.target_mark[j] != trial.tally[MARK] and not visit.is_unlimited(arrays, j):
        trial.target_mark[j] = trial.tally[MARK]
        later = first[j]
        while later != NONE:
            if later > slot:
                _push(trial.queue, trial.queue_mark, trial.tally, later)
            later = following[later]


@compiled
def _push(queue: Integers, queue_mark: Integers, tally: Integers, slot: int) -> None:
    """Queue a slot, once."""
    if queue_mark[slot] != tally[MARK]:
        queue_mark[slot] = tally[MARK]
        push(queue, tally[QUEUED], slot)
        tally[QUEUED] += 1


@compiled
def _pop(queue: Integers, tally: Integers) -> int:
    """Take the earliest slot out of the queue."""
    slot = pop(queue, tally[QUEUED])
    tally[QUEUED] -= 1
    return slot
