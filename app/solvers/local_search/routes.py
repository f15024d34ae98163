"""The current plan of a search, with everything that makes a change cheap to evaluate.

A UAV never waits: its s-th visit happens in step s. So a plan is a route a UAV, and visit number s of UAV i
has its place ``slot = s * M + i`` in the order in which visits are taken; slots are sorted by it.
What a visit unloads depends on two visits only: the one before it in its UAV's route (what is still carried)
and the one before it at its target (what is still needed). The latter are kept as linked lists.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import Flags, Floats, Integers, ProblemArrays
from app.simulation.simulator import compiled
from app.simulation.visit import (
    START,
    arrival_after,
    departure_after,
    farthest,
    flown_with_return,
    is_late,
    leg,
    way_home,
)

NONE = -1
"""End of a linked list."""

SATISFACTION, DISTANCE, USELESS = 0, 1, 2
"""Columns of ``Routes.total``."""


class Routes(NamedTuple):
    """The current plan, its evaluation visit by visit, and scratch space; S is the problem's step limit.

    Attributes
    ----------
    target, length
        (M, S) targets in order and (M,) visits of each route.
    flown, clock
        (M, S+1) distance flown and time passed in the plan before each visit, and at the end.
    load, need
        (S*M, K) by slot: what the UAV carries and what the target needs just before the visit.
    earned
        (S*M,) satisfaction of the visit.
    useless
        (S*M,) visits that unload nothing; a plan with one is not legal.
    first, following, preceding
        (N,), (S*M,), (S*M,): the visits of each target in order, as a doubly linked list of slots.
    total
        (3,) satisfaction, distance and number of useless visits.
    """

    target: Integers
    length: Integers
    flown: Floats
    clock: Floats
    load: Floats
    need: Floats
    earned: Floats
    useless: Flags
    first: Integers
    following: Integers
    preceding: Integers
    total: Floats


def empty_routes(arrays: ProblemArrays) -> Routes:
    """Make the plan in which nobody flies, for the first problem of a stack."""
    m, n, k = arrays.shape
    steps = int(arrays.max_steps[0])
    slots = steps * m
    return Routes(
        target=np.zeros((m, steps), np.int64),
        length=np.zeros(m, np.int64),
        flown=np.zeros((m, steps + 1)),
        clock=np.zeros((m, steps + 1)),
        load=np.zeros((slots, k)),
        need=np.zeros((slots, k)),
        earned=np.zeros(slots),
        useless=np.zeros(slots, np.bool_),
        first=np.full(n, NONE, np.int64),
        following=np.full(slots, NONE, np.int64),
        preceding=np.full(slots, NONE, np.int64),
        total=np.zeros(3),
    )


@compiled
def link(routes: Routes, slot: int, target: int) -> None:
    """Put a visit in its place in the list of its target."""
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
def unlink(routes: Routes, slot: int, target: int) -> int:
    """Take a visit out of the list of its target and return the one that followed it there."""
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
    arrays: ProblemArrays, i: int, targets: Integers, length: int, begin: int, flown: Floats, clock: Floats
) -> bool:
    """Work out distances and times of a route from visit `begin` on; False where range or deadline forbid it.

    Parameters
    ----------
    arrays
        A stack of one problem.
    i
        The UAV.
    targets, length
        (S,) its targets in order, and how many they are.
    begin
        First visit that is new; ``flown[:begin + 1]`` and ``clock[:begin + 1]`` are right already.
    flown, clock
        (S+1,) overwritten from ``begin + 1`` on.
    """
    most = farthest(arrays.voyage[0, i]) - arrays.dis[0, i]
    for s in range(begin, length):
        j = targets[s]
        way = leg(arrays, 0, i, START if s == 0 else targets[s - 1], j)
        flown[s + 1] = flown[s] + way
        if flown_with_return(arrays, 0, i, j, flown[s + 1]) > most:
            return False
        arrival = arrival_after(arrays, 0, i, clock[s], way)
        if is_late(arrival, arrays.deadline[0, j]):
            return False
        clock[s + 1] = departure_after(arrays, 0, j, arrival)
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


@compiled
def charged_distance(arrays: ProblemArrays, i: int, targets: Integers, length: int, flown: Floats) -> float:
    """Distance of a route as far as it costs reward."""
    distance = flown[length]
    if arrays.charge_return[0] and not arrays.ret[0, i]:
        distance += way_home(arrays, 0, i, START if length == 0 else targets[length - 1])
    return distance
