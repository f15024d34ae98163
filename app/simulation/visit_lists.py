"""The visits of a plan: by UAV, by target as linked lists, and by flight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import NONE, Integers, ProblemArrays
from app.simulation.decorators import compiled, inlined


class Visits(NamedTuple):
    """Which UAV stops at which target or base. Stop number s of UAV i is ``slot = s * M + i``.

    Attributes
    ----------
    target, length
        (M, S) targets and bases in order, numbered as actions are, and (M,) stops of each route.
    first, following
        (L,) and (S*M,): the stops at each target and base in order, as a linked list of slots.
    flight
        (S*M,) the flight that a visit is part of: the slot of the reload before it, or that of the UAV's
        first stop where there is none.
    """

    target: Integers
    length: Integers
    first: Integers
    following: Integers
    flight: Integers


def visits_of(arrays: ProblemArrays, actions: Integers) -> Visits:
    """Turn (S', M) joint actions into visits."""
    m, n, _ = arrays.shape
    steps = int(arrays.max_steps[0])
    visits = Visits(
        np.zeros((m, steps), np.int64),
        np.zeros(m, np.int64),
        np.full(arrays.between.shape[2], NONE, np.int64),
        np.full(steps * m, NONE, np.int64),
        np.tile(np.arange(m), steps),
    )
    _connect(actions, visits, n)
    for i in range(m if arrays.n_bases else 0):
        note_flights(visits, i, n)
    return visits


@compiled
def note_flights(visits: Visits, i: int, home: int) -> None:
    """Write down the flights that the visits of UAV `i` are part of; `home` is N."""
    m = visits.length.shape[0]
    flight = i
    for s in range(visits.length[i]):
        if visits.target[i, s] > home:
            flight = s * m + i
        visits.flight[s * m + i] = flight


@compiled
def _connect(actions: Integers, visits: Visits, home: int) -> None:
    """Write routes and, from the last stop to the first, the lists of targets and bases."""
    m = actions.shape[1]
    for s in range(actions.shape[0]):
        for i in range(m):
            if actions[s, i] != home:
                visits.target[i, visits.length[i]] = actions[s, i]
                visits.length[i] += 1
    for s in range(actions.shape[0] - 1, -1, -1):
        for i in range(m - 1, -1, -1):
            if s < visits.length[i]:
                j = visits.target[i, s]
                visits.following[s * m + i] = visits.first[j]
                visits.first[j] = s * m + i


@compiled
def move_slot(visits: Visits, slot: int, old: int, new: int) -> None:
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


@inlined
def first_visit(visits: Visits, f: int, home: int) -> int:
    """Place in its route of the first visit of a flight; `home` is N."""
    m = visits.length.shape[0]
    i, s = f % m, f // m
    begins = s < visits.length[i] and visits.target[i, s] > home
    first: int = s + 1 if begins else s
    return first
