"""How much each visit unloads, decided with the plan: section 3a of the rules (README.md in this folder).

For given routes the best amounts solve a linear program, which falls apart by material into transportation
problems: UAVs supply what they carry, targets demand what they need, visits connect them, and a unit is worth
``level / need_total`` of the target that gets it. Which UAV brings it does not matter, so the demands
that can be met together form a polymatroid, on which the greedy rule is exact: serve the targets in the order
of their worth, each as far as is possible without taking from those before it. "As far as possible" is found
by augmenting paths: a UAV that has nothing left takes over from another at a target both visit, and so on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import ROUNDING
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.worth import worths


class Visits(NamedTuple):
    """Which UAV stops at which target or base. Stop number s of UAV i is ``slot = s * M + i``.

    Attributes
    ----------
    target, length
        (M, S) targets and bases in order, numbered as actions are, and (M,) stops of each route.
    first, following
        (L,) and (S*M,): the stops at each target and base in order, as a linked list of slots.
    """

    target: Integers
    length: Integers
    first: Integers
    following: Integers


class Unloading(NamedTuple):
    """Amounts of a plan, and scratch space of their search.

    Attributes
    ----------
    amount
        (S*M, K) what each visit unloads; valid for the visits of the last targets that were served.
    left
        (M,) what each UAV still has of one material.
    worth, order, rank
        (N,) worth of a unit at each target, the targets in falling order of it, and their places there.
    value
        (N,) what is earned at each target; valid for those that were served.
    served
        (N,) targets, those to be served first.
    seen_target, seen_uav
        (N,) and (M,) number of the search that has seen them.
    dead
        (M,) the serving in which a UAV was found to reach nobody with anything left.
    queue, came_from
        (M,) UAVs of a search in the order of their finding; the slot at which each takes over, and
    taken_from
        (M,) the slot at which it gives up what the one before it takes over, NONE for the first.
    number
        (3,) numbers of the last search and of the last serving, and visits looked at in all.
    """

    amount: Floats
    left: Floats
    worth: Floats
    order: Integers
    rank: Integers
    value: Floats
    served: Integers
    seen_target: Integers
    seen_uav: Integers
    dead: Integers
    queue: Integers
    came_from: Integers
    taken_from: Integers
    number: Integers


def new_unloading(arrays: ProblemArrays) -> Unloading:
    """Make the scratch space for the first problem of a stack."""
    m, n, k = arrays.shape
    worth = worths(arrays)
    order = np.argsort(-worth, kind="stable")
    rank = np.empty(n, np.int64)
    rank[order] = np.arange(n)
    return Unloading(
        amount=np.zeros((int(arrays.max_steps[0]) * m, k)),
        left=np.zeros(m),
        worth=worth,
        order=order,
        rank=rank,
        value=np.zeros(n),
        served=np.zeros(n, np.int64),
        seen_target=np.zeros(n, np.int64),
        seen_uav=np.zeros(m, np.int64),
        dead=np.zeros(m, np.int64),
        queue=np.zeros(m, np.int64),
        came_from=np.zeros(m, np.int64),
        taken_from=np.zeros(m, np.int64),
        number=np.zeros(3, np.int64),
    )


def visits_of(arrays: ProblemArrays, actions: Integers) -> Visits:
    """Turn (S', M) joint actions into visits."""
    m, n, _ = arrays.shape
    steps = int(arrays.max_steps[0])
    visits = Visits(
        np.zeros((m, steps), np.int64),
        np.zeros(m, np.int64),
        np.full(arrays.between.shape[2], NONE, np.int64),
        np.full(steps * m, NONE, np.int64),
    )
    _connect(actions, visits, n)
    return visits


def best_deliveries(arrays: ProblemArrays, actions: Integers) -> Floats:
    """Work out what the visits of a plan unload at best.

    Parameters
    ----------
    arrays
        A stack of one problem.
    actions
        (S', M) joint actions; ranges and deadlines do not matter here.

    Returns
    -------
    ndarray
        (S', M, K) amounts; 0 where there is no visit, and where one is of no use.
    """
    visits, unloading = visits_of(arrays, actions), new_unloading(arrays)
    unloading.served[:] = unloading.order
    serve(arrays, visits, unloading, len(unloading.served))
    steps, m = actions.shape
    delivered = np.zeros((steps, m, arrays.shape[2]))
    for s, i in np.argwhere(actions < arrays.shape[1]):
        possible = np.minimum(arrays.load[0, i], arrays.need[0, actions[s, i]])
        amount = unloading.amount[s * m + i]
        delivered[s, i] = np.where(amount > ROUNDING * possible, np.minimum(amount, possible), 0.0)
    return delivered


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
def serve(arrays: ProblemArrays, visits: Visits, unloading: Unloading, count: int) -> float:
    """Fill ``amount`` with the best amounts for ``served[:count]``, and return what they earn.

    Parameters
    ----------
    arrays
        A stack of one problem.
    visits
        Every visit of a UAV that visits one of these targets must be to one of them.
    unloading
        ``served[:count]`` are the targets in the order of their rank.
    count
        How many targets.
    """
    m = visits.length.shape[0]
    for q in range(count):
        unloading.value[unloading.served[q]] = 0.0
    for k in range(unloading.amount.shape[1]):
        unloading.number[1] += 1
        for q in range(count):
            slot = visits.first[unloading.served[q]]
            while slot != NONE:
                unloading.left[slot % m] = arrays.load[0, slot % m, k]
                if arrays.ret[0, slot % m]:
                    unloading.left[slot % m] = 0.0
                unloading.amount[slot, k] = 0.0
                unloading.number[2] += 1
                slot = visits.following[slot]
        for q in range(count):
            j = unloading.served[q]
            unloading.value[j] += unloading.worth[j] * _fill(arrays, visits, unloading, j, k)
    earned = 0.0
    for q in range(count):
        earned += unloading.value[unloading.served[q]]
    return earned


@compiled
def _fill(arrays: ProblemArrays, visits: Visits, unloading: Unloading, j: int, k: int) -> float:
    """Bring target `j` as much of material `k` as those before it leave; return how much."""
    m = visits.length.shape[0]
    need: float = arrays.need[0, j, k]
    missing = need
    slot = visits.first[j]
    while slot != NONE and missing > 0.0:
        brought = min(unloading.left[slot % m], missing)
        if brought > 0.0:
            unloading.amount[slot, k] += brought
            unloading.left[slot % m] -= brought
            missing -= brought
        slot = visits.following[slot]
    while missing > ROUNDING * need:
        found = _search(arrays, visits, unloading, j, k)
        if found == NONE:
            break
        missing -= _shift(visits, unloading, found, k, missing)
    return need - missing


@compiled
def _search(arrays: ProblemArrays, visits: Visits, unloading: Unloading, j: int, k: int) -> int:
    """Find the nearest UAV with something left that can free a UAV at target `j`; NONE where nobody can.

    Where nobody can, nobody ever will for the targets to come: all that were seen are marked as dead.
    """
    m = visits.length.shape[0]
    unloading.number[0] += 1
    search, serving = unloading.number[0], unloading.number[1]
    tail, head, at, gives = 0, 0, j, NONE
    while True:
        # Every UAV that visits `at` could take over what `gives` unloads there, or serve `j` itself.
        if unloading.seen_target[at] != search:
            unloading.seen_target[at] = search
            slot = visits.first[at]
            while slot != NONE:
                unloading.number[2] += 1
                i: int = slot % m
                if unloading.seen_uav[i] != search and unloading.dead[i] != serving:
                    unloading.seen_uav[i] = search
                    unloading.came_from[i], unloading.taken_from[i] = slot, gives
                    if unloading.left[i] > ROUNDING * arrays.load[0, i, k]:
                        return i
                    unloading.queue[tail] = i
                    tail += 1
                slot = visits.following[slot]
        # The next target to look at: one where a UAV of the queue unloads something.
        gives = NONE
        while head < tail and gives == NONE:
            i = unloading.queue[head]
            for s in range(visits.length[i]):
                unloading.number[2] += 1
                j2 = visits.target[i, s]
                least = ROUNDING * min(arrays.load[0, i, k], arrays.need[0, j2, k])
                if unloading.amount[s * m + i, k] > least and unloading.seen_target[j2] != search:
                    at, gives = j2, s * m + i
                    break
            if gives == NONE:
                head += 1
        if gives == NONE:
            for q in range(tail):
                unloading.dead[unloading.queue[q]] = serving
            return NONE


@compiled
def _shift(visits: Visits, unloading: Unloading, found: int, k: int, missing: float) -> float:
    """Move along the path that ends at UAV `found` as much as it allows; return how much."""
    m = visits.length.shape[0]
    moved: float = min(missing, unloading.left[found])
    i = found
    while unloading.taken_from[i] != NONE:
        moved = min(moved, unloading.amount[unloading.taken_from[i], k])
        i = unloading.taken_from[i] % m
    unloading.left[found] -= moved
    i = found
    while True:
        unloading.amount[unloading.came_from[i], k] += moved
        gives = unloading.taken_from[i]
        if gives == NONE:
            return moved
        unloading.amount[gives, k] -= moved
        i = gives % m
