"""The current plan of a search, with everything that makes a change cheap to evaluate.

A UAV never waits: its s-th stop, a visit or a reload, happens in step s. So a plan is a route a UAV, and stop
number s of UAV i has its place ``slot = s * M + i`` in the order in which they are taken; slots are sorted by
it. What a stop unloads or loads depends on two stops only: the one before it in its UAV's route (what is
still carried) and the one before it at its target or base (what is still needed, or in stock). The latter are
kept as linked lists; bases with as much as is asked for have none.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import NONE, Flags, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.visit import (
    START,
    air_length,
    aloft_after,
    departure_after,
    exceeds_endurance,
    farthest,
    flown_with_return,
    is_base,
    is_committed_elsewhere,
    is_late,
    is_unlimited,
    is_watched,
    lands_late,
    leg,
    leg_time,
    time_home,
    way_home,
)
from app.simulation.worth import closing_cost, has_closing_cost

SATISFACTION, DISTANCE, USELESS, CLOSING = 0, 1, 2, 3
"""Columns of ``Routes.total``."""


class Routes(NamedTuple):
    """The current plan, its evaluation visit by visit, and scratch space; S is the problem's step limit.

    Attributes
    ----------
    target, length
        (M, S) targets and bases in order, numbered as actions are, and (M,) stops of each route.
    flown, clock, aloft
        (M, S+1) air length flown in this flight, without ``dis`` of the first one, the time, and the time in
        the air before each stop, and at the end; the last one of UAVs for which it counts. After a reload the
        air length is ``-dis``, so that one range holds for all flights.
    load, need
        (S*M, K) by slot: what the UAV carries, and what the target needs or the base has, just before.
    earned
        (S*M,) satisfaction of the stop.
    useless
        (S*M,) visits that unload nothing; a plan with one is not legal.
    first, following, preceding
        (L,), (S*M,), (S*M,): the stops at each target and base in order, as a doubly linked list of slots.
    landing, changes
        (M,) when a UAV has landed, 0 if it has no visit, and how many of its visits of ``start_plan`` are
        missing; where they cost reward.
    total
        (4,) satisfaction, distance, number of useless visits, and what makespan and changes cost.
    """

    target: Integers
    length: Integers
    flown: Floats
    clock: Floats
    aloft: Floats
    load: Floats
    need: Floats
    earned: Floats
    useless: Flags
    first: Integers
    following: Integers
    preceding: Integers
    landing: Floats
    changes: Floats
    total: Floats


def copy_routes(routes: Routes, into: Routes) -> None:
    """Make one plan's routes another's, of the same problem."""
    for ours, theirs in zip(routes, into, strict=True):
        np.copyto(theirs, ours)


def empty_routes(arrays: ProblemArrays) -> Routes:
    """Make the plan in which nobody flies, for the first problem of a stack."""
    m, _, k = arrays.shape
    steps = int(arrays.max_steps[0])
    slots = steps * m
    routes = Routes(
        target=np.zeros((m, steps), np.int64),
        length=np.zeros(m, np.int64),
        flown=np.zeros((m, steps + 1)),
        clock=np.repeat(arrays.uavs["ready"][0][:, None], steps + 1, axis=1),
        aloft=np.repeat(arrays.uavs["airborne"][0][:, None], steps + 1, axis=1),
        load=np.zeros((slots, k)),
        need=np.zeros((slots, k)),
        earned=np.zeros(slots),
        useless=np.zeros(slots, np.bool_),
        first=np.full(arrays.between.shape[2], NONE, np.int64),
        following=np.full(slots, NONE, np.int64),
        preceding=np.full(slots, NONE, np.int64),
        landing=np.zeros(m),
        changes=np.zeros(m),
        total=np.zeros(4),
    )
    if arrays.terms["makespan"][0] or arrays.terms["change"][0]:
        note_ends(arrays, routes)
    return routes


@compiled
def link(arrays: ProblemArrays, routes: Routes, slot: int, target: int) -> None:
    """Put a stop in its place in the list of its target or base."""
    if is_unlimited(arrays, target):
        routes.preceding[slot], routes.following[slot] = NONE, NONE
        return
    before, after = NONE, routes.first[target]
    while after != NONE and after < slot:
        before, after = after, routes.following[after]
    routes.preceding[slot], routes.following[slot] = before, after
    if before == NONE:
        routes.first[target] = slot
    else:
        routes.following[before] = slot
    if after != NONE:
        routes.preceding[after] = slot


@compiled
def unlink(arrays: ProblemArrays, routes: Routes, slot: int, target: int) -> int:
    """Take a stop out of the list of its target or base and return the one that followed it there."""
    if is_unlimited(arrays, target):
        return NONE
    before, after = routes.preceding[slot], routes.following[slot]
    if before == NONE:
        routes.first[target] = after
    else:
        routes.following[before] = after
    if after != NONE:
        routes.preceding[after] = before
    return after


@compiled
def lay(
    arrays: ProblemArrays,
    i: int,
    targets: Integers,
    length: int,
    begin: int,
    flown: Floats,
    clock: Floats,
    aloft: Floats,
) -> bool:
    """Work out distances and times of a route from stop `begin` on; False where rule 2 forbids it.

    Whether its visits unload anything is not looked at.

    Parameters
    ----------
    arrays
        A stack of one problem.
    i
        The UAV.
    targets, length
        (S,) its targets in order, and how many they are.
    begin
        First visit that is new; ``flown[:begin + 1]`` and so on are right already.
    flown, clock, aloft
        (S+1,) overwritten from ``begin + 1`` on.
    """
    most = farthest(arrays.uavs[0, i].voyage) - arrays.uavs[0, i].dis
    watched = is_watched(arrays, 0, i)
    for s in range(begin, length):
        j = targets[s]
        at = START if s == 0 else targets[s - 1]
        way = leg(arrays, 0, i, at, j)
        time = leg_time(arrays, 0, i, at, j, way)
        flown[s + 1] = flown[s] + air_length(arrays, 0, i, way, time)
        if flown_with_return(arrays, 0, i, j, flown[s + 1]) > most:
            return False
        arrival = clock[s] + time
        if is_base(arrays, j):
            if is_base(arrays, at) or is_committed_elsewhere(arrays, 0, i, s, j):
                return False
            clock[s + 1] = departure_after(arrays, 0, j, arrival)
            if watched and (
                exceeds_endurance(
                    arrays,
                    0,
                    i,
                    j,
                    aloft_after(arrays, 0, i, at, aloft[s], clock[s], arrival, clock[s + 1], j),
                )
                or lands_late(arrays, 0, i, j, clock[s + 1])
            ):
                return False
            flown[s + 1], aloft[s + 1] = -arrays.uavs[0, i].dis, 0.0
            continue
        if is_late(arrival, arrays.areas[0, j].deadline) or is_committed_elsewhere(arrays, 0, i, s, j):
            return False
        clock[s + 1] = departure_after(arrays, 0, j, arrival)
        if watched:
            aloft[s + 1] = aloft_after(arrays, 0, i, at, aloft[s], clock[s], arrival, clock[s + 1], j)
            if exceeds_endurance(arrays, 0, i, j, aloft[s + 1]) or lands_late(arrays, 0, i, j, clock[s + 1]):
                return False
    return True


@compiled
def sum_up(arrays: ProblemArrays, routes: Routes) -> None:
    """Add the totals up anew: each change leaves a rounding error in them."""
    m = routes.length.shape[0]
    satisfaction, distance = 0.0, 0.0
    for i in range(m):
        for s in range(routes.length[i]):
            satisfaction += routes.earned[s * m + i]
        distance += charged_distance(arrays, i, routes.target[i], routes.length[i], routes.flown[i])
    routes.total[SATISFACTION], routes.total[DISTANCE] = satisfaction, distance
    if has_closing_cost(arrays, 0):
        note_ends(arrays, routes)


@compiled
def charged_distance(arrays: ProblemArrays, i: int, targets: Integers, length: int, flown: Floats) -> float:
    """Distance of a route as far as it costs reward."""
    if not arrays.terms[0].in_wind and arrays.stock.shape[1] == 0:
        distance = flown[length]
    else:
        distance = 0.0
        for s in range(length):
            distance += leg(arrays, 0, i, START if s == 0 else targets[s - 1], targets[s])
    if arrays.terms[0].charge_return and not arrays.ret[0, i]:
        distance += way_home(arrays, 0, i, START if length == 0 else targets[length - 1])
    return distance


@compiled
def landing_of(arrays: ProblemArrays, i: int, targets: Integers, length: int, clock: Floats) -> float:
    """When a UAV has landed after its route; 0 if it has no visit."""
    return 0.0 if length == 0 else clock[length] + time_home(arrays, 0, i, targets[length - 1])


@compiled
def changes_in(arrays: ProblemArrays, i: int, targets: Integers, length: int) -> float:
    """How many of a UAV's visits of ``start_plan`` are missing on a route."""
    missing = 0.0
    for w in range(arrays.before.shape[2]):
        there = arrays.before[0, i, w] == NONE
        for s in range(length):
            there = there or targets[s] == arrays.before[0, i, w]
        if not there:
            missing += 1.0
    return missing


@compiled
def note_ends(arrays: ProblemArrays, routes: Routes) -> None:
    """Write down what the ends of all routes cost."""
    makespan, changes = 0.0, 0.0
    for i in range(routes.length.shape[0]):
        routes.landing[i] = landing_of(arrays, i, routes.target[i], routes.length[i], routes.clock[i])
        routes.changes[i] = changes_in(arrays, i, routes.target[i], routes.length[i])
        makespan = max(makespan, routes.landing[i])
        changes += routes.changes[i]
    routes.total[CLOSING] = closing_cost(arrays, 0, makespan, changes)
