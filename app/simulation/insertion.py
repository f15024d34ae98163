"""What one more visit does to a flown plan: exact, and without flying what it does not touch.

In every step each UAV takes the next visit of its route that is legal, so what comes out is the reward of a
legal plan, whatever the additional visit does to those after it. Only UAVs that carry, or are, something
else than in the plan are flown again, on the one simulator, and with them those whose areas they serve
differently.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation import simulator
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.flown_plan import CRUMB, FlownPlan
from app.simulation.unloading import NONE

MARK, QUEUED, CHANGED, WORK, MADE = range(5)
"""Places in ``Trial.tally``."""

GAIN, TURNOVER = range(2)
"""Places in ``Trial.total``."""

ROUNDING = 1e-9
"""Share of what an additional visit turns over below which its gain is the rounding of it."""


class Trial(NamedTuple):
    """One additional visit, and scratch space for flying it.

    Attributes
    ----------
    episodes
        One episode; of it are valid the UAVs and targets that carry the current mark.
    uav_mark, target_mark
        (M,) and (N,) the number of the trial that last changed them.
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
        (5,) number of the trial, lengths of the lists, visits flown in all trials, and whether the additional
        visit was legal.
    total
        (2,) change of the reward, and the sum of the absolute values that it is made of.
    """

    episodes: simulator.Episodes
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
    m, n, _ = arrays.shape
    slots = plan.leg.size
    return Trial(
        simulator.new_episodes(arrays, 1),
        np.zeros(m, np.int64),
        np.zeros(n, np.int64),
        np.zeros(m, np.int64),
        np.zeros(m, np.int64),
        np.zeros(slots, np.int64),
        np.zeros(slots, np.int64),
        np.zeros(3, np.int64),
        np.zeros(5, np.int64),
        np.zeros(2),
    )


@simulator.compiled
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
        Scratch space. ``tally[MADE]`` says whether the visit was legal.
    i, place, j
        The visit; where `place` is negative there is none, only another load.
    reloaded
        Whether UAV `i` has another load in `arrays` than in the plan.

    Returns
    -------
    float
        The change; 0 where it is only rounding.
    """
    m = plan.back.shape[0]
    begin(trial, i, place, j)
    first = 0 if reloaded else place
    take_up(plan, trial, i, first)
    if reloaded:
        for k in range(plan.load.shape[2]):
            trial.episodes.load[0, i, k] = arrays.load[0, i, k]
    _change(trial, i, first)
    _push(trial, first * m + i)
    while trial.tally[QUEUED] > 0:
        slot = _pop(trial)
        trial.tally[WORK] += 1
        h = slot % m
        if trial.uav_mark[h] != trial.tally[MARK]:
            _fly_unchanged(arrays, plan, trial, slot // m, h)
        else:
            _fly_changed(arrays, plan, trial, slot // m, h)
    if arrays.charge_return[0]:
        for c in range(trial.tally[CHANGED]):
            h = trial.changed[c]
            charge(trial, -arrays.weight[0] * simulator.leg_home(arrays, trial.episodes, 0, h))
            charge(trial, arrays.weight[0] * plan.back[h])
    return gain(trial)


@simulator.compiled
def begin(trial: Trial, i: int, place: int, j: int) -> None:
    """Begin another trial: nothing is changed yet."""
    trial.tally[MARK] += 1
    trial.tally[QUEUED], trial.tally[CHANGED], trial.tally[MADE] = 0, 0, 0
    trial.inserted[0], trial.inserted[1], trial.inserted[2] = i, place, j
    trial.total[GAIN], trial.total[TURNOVER] = 0.0, 0.0


@simulator.compiled
def charge(trial: Trial, change: float) -> None:
    """Add a change of the reward."""
    trial.total[GAIN] += change
    trial.total[TURNOVER] += abs(change)


@simulator.compiled
def gain(trial: Trial) -> float:
    """Change of the reward in all; 0 where it is only rounding."""
    if abs(trial.total[GAIN]) <= ROUNDING * trial.total[TURNOVER]:
        return 0.0
    change: float = trial.total[GAIN]
    return change


@simulator.compiled
def move_to(plan: FlownPlan, trial: Trial, i: int, place: int) -> None:
    """Put UAV `i` where it is in the plan before its visit `place`."""
    episodes = trial.episodes
    episodes.at[0, i] = simulator.START if place == 0 else plan.visits.target[i, place - 1]
    episodes.flown[0, i], episodes.clock[0, i] = plan.flown[i, place], plan.clock[i, place]
    episodes.ret[0, i] = False


@simulator.compiled
def take_up(plan: FlownPlan, trial: Trial, i: int, place: int) -> None:
    """Put UAV `i` where it is in the plan before its visit `place`, with what it has then."""
    move_to(plan, trial, i, place)
    for k in range(plan.load.shape[2]):
        trial.episodes.load[0, i, k] = plan.load[i, place, k]


@simulator.compiled
def need_at(plan: FlownPlan, trial: Trial, j: int, slot: int) -> bool:
    """Give target `j` the need that it has in the plan just before a slot, unless the trial has changed it.

    Returns
    -------
    bool
        Whether it is unchanged, and has no visits in the plan from the slot on.
    """
    if trial.target_mark[j] == trial.tally[MARK]:
        return False
    m = plan.back.shape[0]
    later = plan.visits.first[j]
    while later != NONE and later < slot:
        later = plan.visits.following[later]
    for k in range(plan.need.shape[2]):
        if later == NONE:
            trial.episodes.need[0, j, k] = plan.end_need[j, k]
        else:
            trial.episodes.need[0, j, k] = plan.need[later % m, later // m, k]
    return bool(later == NONE)


@simulator.compiled
def gain_of_undisturbed_visit(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, i: int, place: int, j: int
) -> float:
    """As :func:`gain_of_visit` for a visit that changes nothing but the way of its UAV.

    The UAV and the target are as they are in the plan at that place.
    """
    weight = arrays.weight[0]
    trial.tally[MADE] = 1
    charge(trial, simulator.act(arrays, trial.episodes, 0, i, j))
    if place < plan.visits.length[i]:
        charge(trial, weight * plan.leg[i, place])
        charge(trial, -weight * arrays.between[0, j, plan.visits.target[i, place]])
    elif arrays.charge_return[0]:
        charge(trial, weight * plan.back[i])
        charge(trial, -weight * simulator.leg_home(arrays, trial.episodes, 0, i))
    return gain(trial)


@simulator.compiled
def gets_more(plan: FlownPlan, trial: Trial, j: int) -> bool:
    """Whether target `j` lacks less after the trial than in the plan."""
    if trial.target_mark[j] != trial.tally[MARK]:
        return False
    before, after = 0.0, 0.0
    for k in range(plan.need.shape[2]):
        before += plan.end_need[j, k]
        after += trial.episodes.need[0, j, k]
    return after < before * (1.0 - CRUMB)


@simulator.compiled
def _fly_unchanged(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, s: int, h: int) -> None:
    """Fly a visit to a target whose need has changed, by a UAV that is as it was until now."""
    j = plan.visits.target[h, s]
    take_up(plan, trial, h, s)
    if simulator.verdict(arrays, trial.episodes, 0, h, j) != simulator.ALLOWED:
        _change(trial, h, s)
        _fly_changed(arrays, plan, trial, s, h)
        return
    value = simulator.act(arrays, trial.episodes, 0, h, j)
    if value != plan.value[h, s]:
        charge(trial, value)
        charge(trial, -plan.value[h, s])
    for k in range(plan.load.shape[2]):
        if trial.episodes.load[0, h, k] != plan.load[h, s + 1, k]:
            _change(trial, h, s + 1)
            _push_next(arrays, plan, trial, s, h)
            return


@simulator.compiled
def _fly_changed(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, s: int, h: int) -> None:
    """Take back what a changed UAV does in the plan in step `s`, and let it fly its next legal visit."""
    m, episodes = plan.back.shape[0], trial.episodes
    slot = s * m + h
    if s < plan.visits.length[h]:
        j = plan.visits.target[h, s]
        need_at(plan, trial, j, slot)
        _open(plan, trial, j, slot)
        charge(trial, -plan.value[h, s])
    while s < arrays.max_steps[0] and trial.cursor[h] < route_length(plan, trial, h):
        place = trial.cursor[h]
        j = route_target(plan, trial, h, place)
        trial.cursor[h] += 1
        need_at(plan, trial, j, slot)
        if simulator.verdict(arrays, episodes, 0, h, j) == simulator.ALLOWED:
            charge(trial, simulator.act(arrays, episodes, 0, h, j))
            _open(plan, trial, j, slot)
            if h == trial.inserted[0] and place == trial.inserted[1]:
                trial.tally[MADE] = 1
            break
    _push_next(arrays, plan, trial, s, h)


@simulator.compiled
def _push_next(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, s: int, h: int) -> None:
    """Queue the next step of a changed UAV, if it or the plan does anything in it."""
    m = plan.back.shape[0]
    flies = s + 1 < arrays.max_steps[0] and trial.cursor[h] < route_length(plan, trial, h)
    if flies or s + 1 < plan.visits.length[h]:
        _push(trial, (s + 1) * m + h)


@simulator.compiled
def route_length(plan: FlownPlan, trial: Trial, h: int) -> int:
    """How many visits a UAV's route has, with the additional one."""
    extra = 1 if h == trial.inserted[0] and trial.inserted[1] >= 0 else 0
    return int(plan.visits.length[h]) + extra


@simulator.compiled
def route_target(plan: FlownPlan, trial: Trial, h: int, place: int) -> int:
    """The target of a visit of a UAV's route with the additional one."""
    if h != trial.inserted[0] or trial.inserted[1] < 0 or place < trial.inserted[1]:
        return int(plan.visits.target[h, place])
    if place == trial.inserted[1]:
        return int(trial.inserted[2])
    return int(plan.visits.target[h, place - 1])


@simulator.compiled
def _change(trial: Trial, h: int, cursor: int) -> None:
    """Let a UAV go its own way from now on."""
    trial.uav_mark[h] = trial.tally[MARK]
    trial.cursor[h] = cursor
    trial.changed[trial.tally[CHANGED]] = h
    trial.tally[CHANGED] += 1


@simulator.compiled
def _open(plan: FlownPlan, trial: Trial, j: int, slot: int) -> None:
    """Let a target have its own need from now on: the plan's later visits to it are flown again."""
    if trial.target_mark[j] == trial.tally[MARK]:
        return
    trial.target_mark[j] = trial.tally[MARK]
    later = plan.visits.first[j]
    while later != NONE:
        if later > slot:
            _push(trial, later)
        later = plan.visits.following[later]


@simulator.compiled
def _push(trial: Trial, slot: int) -> None:
    """Queue a slot, once."""
    if trial.queue_mark[slot] == trial.tally[MARK]:
        return
    trial.queue_mark[slot] = trial.tally[MARK]
    hole = trial.tally[QUEUED]
    trial.tally[QUEUED] += 1
    while hole > 0 and trial.queue[(hole - 1) // 2] > slot:
        trial.queue[hole] = trial.queue[(hole - 1) // 2]
        hole = (hole - 1) // 2
    trial.queue[hole] = slot


@simulator.compiled
def _pop(trial: Trial) -> int:
    """Take the earliest slot out of the queue."""
    slot = int(trial.queue[0])
    trial.tally[QUEUED] -= 1
    size = trial.tally[QUEUED]
    last, hole = trial.queue[size], 0
    while True:
        child = 2 * hole + 1
        if child >= size:
            break
        if child + 1 < size and trial.queue[child + 1] < trial.queue[child]:
            child += 1
        if trial.queue[child] >= last:
            break
        trial.queue[hole] = trial.queue[child]
        hole = child
    trial.queue[hole] = last
    return slot
