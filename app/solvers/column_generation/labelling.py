"""Routes that are worth most at given prices of the targets: the pricing problem of column generation.

A labelling algorithm. A label is a partial route: its last target, what it is worth, and what it has used of
each resource that may run out (`resources.py`). A label is dominated by one at the same
target that is worth as much, has used no more of anything, and may go wherever it may. "May go": visited
targets are remembered only while the route stays near them, so that labels differ in little (the ng-route
relaxation of Baldacci, Mingozzi and Roberti, Operations Research 59(5), 2011). A route may come back to a
target it has forgotten, and seem to be worth more than it is; where that matters, more is remembered
(:func:`remember`; Roberti and Mingozzi, Transportation Science 48(3), 2014).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app.simulation.arrays import NONE, Flags, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled, compiled_nogil
from app.simulation.visit import airborne, ready
from app.solvers.column_generation.pool import Pool, collect
from app.solvers.column_generation.resources import VehicleResources
from app.solvers.local_search.routes import lay
from app.solvers.protocol import StopCriterion

_MEMORY = 8
"""Targets whose visits are remembered at a target at first, itself among them."""

_PIECE = 100_000
"""Distances that are put in order between two looks at the stop criterion: some milliseconds."""

_AS_MUCH = 1e-12
"""Relative difference that does not count when labels are compared: rounding."""

_MOST_MEMORY = 62
"""Bits for them."""


class NgNeighbourhoods(NamedTuple):
    """What routes of all UAVs share.

    Attributes
    ----------
    near, known
        (N, G) and (N,) the targets whose visits are remembered at a target, itself first, and how many.
    order
        (N, N) all targets, nearest first.
    place
        (N, N) the place of a target among those of another; NONE where it is forgotten there.
    """

    near: Integers
    known: Integers
    order: Integers
    place: npt.NDArray[np.int8]


class Labels(NamedTuple):
    """Room for L labels, in the order in which they were found.

    Attributes
    ----------
    last, visits, parent
        (L,) last target, number of visits, and the label that it extends; NONE for a first visit.
    memory
        (L,) which of the targets near the last one were visited, as bits.
    value
        (L,) prices of the visits less the cost of the distance.
    used
        (L, R) resources.
    alive
        (L,) whether it is not dominated.
    first, following
        (N,) and (L,): the labels at each target that are not dominated, as linked lists.
    size, extended
        (1,) how many there are, and how many of them were extended.
    """

    last: Integers
    visits: Integers
    parent: Integers
    memory: Integers
    value: Floats
    used: Floats
    alive: Flags
    first: Integers
    following: Integers
    size: Integers
    extended: Integers


def neighbourhoods_of(arrays: ProblemArrays, stop: StopCriterion) -> NgNeighbourhoods | None:
    """Find the neighbourhoods of the first problem of a stack; None if it was stopped."""
    n = arrays.areas["level"].shape[1]
    leg = arrays.between[0].min(axis=0)
    size = min(_MEMORY, n)
    near = np.zeros((n, min(_MOST_MEMORY, n)), np.int64)
    order = np.empty((n, n), np.int64)
    piece = max(1, _PIECE // n)
    for top in range(0, n, piece):
        if stop():
            return None
        rows = np.arange(top, min(top + piece, n))
        apart = leg[rows]
        apart[np.arange(len(rows)), rows] = -np.inf
        order[rows] = np.argsort(apart, axis=1, kind="stable")
    near[:, :size] = order[:, :size]
    place = np.full((n, n), NONE, np.int8)
    place[near[:, :size], np.arange(n)[:, None]] = np.arange(size)[None, :]
    return NgNeighbourhoods(near, np.full(n, size), order, place)


def new_labels(targets: int, resources: int, room: int) -> Labels:
    """Make room for labels."""
    return Labels(
        last=np.empty(room, np.int64),
        visits=np.empty(room, np.int64),
        parent=np.empty(room, np.int64),
        memory=np.empty(room, np.int64),
        value=np.empty(room),
        used=np.empty((room, resources)),
        alive=np.empty(room, np.bool_),
        first=np.empty(targets, np.int64),
        following=np.empty(room, np.int64),
        size=np.zeros(1, np.int64),
        extended=np.zeros(1, np.int64),
    )


@compiled_nogil
def begin(
    ng: NgNeighbourhoods, resources: VehicleResources, price: Floats, labels: Labels, exact: bool
) -> None:
    """Begin anew, with the first visits; see :func:`extend`."""
    labels.size[0], labels.extended[0] = 0, 0
    for j in range(price.shape[0]):
        labels.first[j] = NONE
    for j in range(price.shape[0]):
        if price[j] > 0.0:
            _visit(ng, resources, price, labels, NONE, j, exact)


@compiled_nogil
def extend(
    ng: NgNeighbourhoods,
    resources: VehicleResources,
    price: Floats,
    labels: Labels,
    exact: bool,
    count: int,
) -> bool:
    """Extend the next `count` labels in every way; whether there are more, and room for them.

    Parameters
    ----------
    ng, resources
        The problem, and what the UAV has.
    price
        (N,) what a visit is worth; none is made that is worth nothing.
    labels
        Changed.
    exact
        Whether what may still be visited counts when labels are compared. Otherwise there are far fewer, and
        the best route may be missed.
    count
        Those that are dominated count, too.
    """
    last = min(labels.extended[0] + count, labels.size[0])
    while labels.extended[0] < last:
        q = labels.extended[0]
        if labels.alive[q] and labels.visits[q] < resources.visits:
            i = labels.last[q]
            for nth in range(price.shape[0]):
                j = ng.order[i, nth]
                if resources.ordered and _too_far(resources, labels, q, resources.leg[i, j]):
                    break
                seen = ng.place[j, i]
                if price[j] <= 0.0 or (seen != NONE and labels.memory[q] >> seen & 1):
                    continue
                if not _visit(ng, resources, price, labels, q, j, exact):
                    return False
        labels.extended[0] = q + 1
    return labels.extended[0] < labels.size[0]


@compiled
def _too_far(resources: VehicleResources, labels: Labels, q: int, leg: float) -> bool:
    """Whether a leg uses up so much that there is no target it may lead to."""
    for r in range(resources.rate.shape[0]):
        if labels.used[q, r] + leg * resources.rate[r] > resources.farthest[r]:
            return True
    return False


@compiled
def _visit(
    ng: NgNeighbourhoods,
    resources: VehicleResources,
    price: Floats,
    labels: Labels,
    parent: int,
    j: int,
    exact: bool,
) -> bool:
    """Extend a label by a visit, if that is possible and not dominated; False where there is no room."""
    q = labels.size[0]
    if q == labels.last.shape[0]:
        return False
    count = resources.rate.shape[0]
    if parent == NONE:
        for r in range(count):
            labels.used[q, r] = resources.first[j, r]
            if labels.used[q, r] > resources.most[j, r]:
                return True
        labels.value[q] = price[j] - resources.start[j]
        labels.memory[q] = 1
        labels.visits[q] = 1
    else:
        i = labels.last[parent]
        leg, time = resources.leg[i, j], resources.time[i, j]
        for r in range(count):
            used = labels.used[parent, r] + leg * resources.rate[r] + resources.amount[j, r]
            if resources.pace[r] != 0.0:
                used += time * resources.pace[r]
            labels.used[q, r] = max(used, resources.least[j, r])
            if labels.used[q, r] > resources.most[j, r]:
                return True
        labels.value[q] = labels.value[parent] + price[j] - resources.weight * leg
        memory = 1
        for bit in range(ng.known[i]):
            if labels.memory[parent] >> bit & 1:
                kept = ng.place[ng.near[i, bit], j]
                if kept != NONE:
                    memory |= 1 << kept
        labels.memory[q] = memory
        labels.visits[q] = labels.visits[parent] + 1
    if _dominated(resources, labels, q, j, exact):
        return True
    labels.last[q], labels.parent[q], labels.alive[q] = j, parent, True
    labels.following[q], labels.first[j] = labels.first[j], q
    labels.size[0] = q + 1
    return True


@compiled
def _dominated(resources: VehicleResources, labels: Labels, q: int, j: int, exact: bool) -> bool:
    """Whether a label at target `j` that is not listed yet is dominated; delists those that it dominates."""
    before, other = NONE, labels.first[j]
    # Labels come in the order of their visits, so an earlier one has no more of them.
    free = resources.visits == labels.first.shape[0]
    while other != NONE:
        after = labels.following[other]
        better = labels.value[other] >= labels.value[q] - resources.nothing
        worse = labels.value[other] <= labels.value[q] and (free or labels.visits[other] == labels.visits[q])
        if exact:
            better = better and labels.memory[other] & ~labels.memory[q] == 0
            worse = worse and labels.memory[q] & ~labels.memory[other] == 0
        for r in range(resources.rate.shape[0]):
            better = better and labels.used[other, r] <= labels.used[q, r] * (1.0 + _AS_MUCH)
            worse = worse and labels.used[other, r] >= labels.used[q, r]
        if better:
            return True
        if worse:
            labels.alive[other] = False
            if before == NONE:
                labels.first[j] = after
            else:
                labels.following[before] = after
        else:
            before = other
        other = after
    return False


def values(resources: VehicleResources, labels: Labels) -> Floats:
    """Return what the labels are worth as whole routes, (size,)."""
    size = int(labels.size[0])
    return labels.value[:size] - resources.finish[labels.last[:size]]


@compiled_nogil
def remember(ng: NgNeighbourhoods, labels: Labels, chosen: Integers) -> int:
    """Let visits be remembered that some labels forgot and made twice; return how many more there are.

    Between the two visits every target remembers the first one, as far as there are bits.
    """
    more = 0
    for at in range(chosen.shape[0]):
        later = chosen[at]
        while later != NONE:
            earlier = labels.parent[later]
            while earlier != NONE and labels.last[earlier] != labels.last[later]:
                earlier = labels.parent[earlier]
            if earlier != NONE:
                between, j = labels.parent[later], labels.last[later]
                while between != earlier:
                    i = labels.last[between]
                    if ng.place[j, i] == NONE and ng.known[i] < ng.near.shape[1]:
                        ng.near[i, ng.known[i]], ng.place[j, i] = (
                            j,
                            ng.known[i],
                        )
                        ng.known[i] += 1
                        more += 1
                    between = labels.parent[between]
            later = labels.parent[later]
    return more


@compiled_nogil
def collect_labels(
    arrays: ProblemArrays,
    pool: Pool,
    i: int,
    labels: Labels,
    chosen: Integers,
    targets: Integers,
    flown: Floats,
    clock: Floats,
    aloft: Floats,
) -> None:
    """Put the routes of some labels into a pool, each target once.

    Parameters
    ----------
    arrays
        A stack of one problem.
    pool
        Changed.
    i
        The UAV that the labels are of.
    labels, chosen
        Labels, and (C,) which of them.
    targets, flown, clock, aloft
        (S,) and three times (S+1,) scratch space.
    """
    for at in range(chosen.shape[0]):
        q = chosen[at]
        length = labels.visits[q]
        for s in range(length - 1, -1, -1):
            targets[s] = labels.last[q]
            q = labels.parent[q]
        kept = 0
        for s in range(length):
            again = False
            for earlier in range(kept):
                again = again or targets[earlier] == targets[s]
            if not again:
                targets[kept] = targets[s]
                kept += 1
        flown[0], clock[0], aloft[0] = 0.0, ready(arrays, 0, i), airborne(arrays, 0, i)
        if lay(arrays, i, targets, kept, 0, flown, clock, aloft):
            collect(arrays, pool, i, targets, kept, flown)
