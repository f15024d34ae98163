"""Routes that a search came across, kept so that they can be combined anew.

Kept are whole routes only: those on which a UAV carries enough for all that its targets need. Where the UAVs
of a plan share no target, each whole route earns the same whatever the others do, so any choice of them can
be added up (:mod:`app.solvers.column_generation.packing`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import TOLERANCE
from app.simulation.arrays import NONE, Flags, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.stacks import alike
from app.solvers.local_search.routes import charged_distance

CAPACITY = 8192
"""Routes that a pool holds at most; a full one takes no more."""

_OFTEN_WHOLE = 0.9
"""Share of pairs of UAV and target where all needs can be met, from which routes are kept at all.

Below it most plans share targets between UAVs. Generated families have 0.02 to 0.83.
"""

_NAMES_SEED = 20220816
"""Of the numbers that make up the names of sets of targets."""


class Pool(NamedTuple):
    """Routes by set of targets and kind of UAV; of equals the shortest.

    Attributes
    ----------
    kind
        (M,) the first UAV that is in every respect like this one.
    name
        (M + N,) random numbers; the sum of those of a kind and of targets names a set.
    slot
        (2·capacity,) a hash table of routes; NONE where free.
    route_name, uav, length
        (capacity,) name, UAV and number of visits of each route.
    target
        (capacity, S) its targets in order.
    distance
        (capacity,) its distance as far as it costs reward.
    size
        (1,) how many routes there are.
    """

    kind: Integers
    name: Integers
    slot: Integers
    route_name: Integers
    uav: Integers
    length: Integers
    target: Integers
    distance: Floats
    size: Integers


def often_whole(arrays: ProblemArrays) -> bool:
    """Whether most UAVs carry enough for most targets, so that combining routes is worth its time.

    Routes with reloads are not combined.
    """
    if arrays.n_bases:
        return False
    active, wanted = ~arrays.ret[0], arrays.areas["need_total"][0] > 0
    load, need = arrays.load[0][active], arrays.need[0][wanted]
    if not (len(load) and len(need)):
        return False
    able = np.ones((len(load), len(need)), np.bool_)
    for k in range(need.shape[1]):
        able &= load[:, k, None] >= need[None, :, k]
    return float(able.mean()) >= _OFTEN_WHOLE


def always_whole(arrays: ProblemArrays) -> bool:
    """Whether every route is whole: each UAV that flies carries enough for all that it can visit.

    Routes with reloads are none.
    """
    return not arrays.n_bases and bool(
        (arrays.load[0][~arrays.ret[0]] >= largest_needs(arrays)[None, :]).all()
    )


def largest_needs(arrays: ProblemArrays) -> Floats:
    """(K,) the most that a UAV could unload of each material on a route of as many visits as there may be."""
    return np.sort(arrays.need[0], axis=0)[::-1][: int(arrays.max_steps[0])].sum(axis=0)


def new_pool(arrays: ProblemArrays, capacity: int = CAPACITY) -> Pool:
    """Make an empty pool for the first problem of a stack."""
    m, n, _ = arrays.shape
    names = np.random.default_rng(_NAMES_SEED).integers(1, 2**62, m + n)
    return Pool(
        kind=alike(arrays),
        name=names,
        slot=np.full(2 * capacity, NONE, np.int64),
        route_name=np.empty(capacity, np.int64),
        uav=np.empty(capacity, np.int64),
        length=np.empty(capacity, np.int64),
        target=np.empty((capacity, int(arrays.max_steps[0])), np.int64),
        distance=np.empty(capacity),
        size=np.zeros(1, np.int64),
    )


@compiled
def collect(arrays: ProblemArrays, pool: Pool, i: int, targets: Integers, length: int, flown: Floats) -> None:
    """Put a route of UAV `i` into a pool if it is whole."""
    if length == 0 or pool.size[0] == pool.uav.shape[0]:
        return
    for k in range(arrays.load.shape[2]):
        needed = 0.0
        for s in range(length):
            needed += arrays.need[0, targets[s], k]
        if needed > arrays.load[0, i, k] * (1.0 + TOLERANCE):
            return
    for s in range(1, length):
        for earlier in range(s):
            if targets[earlier] == targets[s]:
                return
    distance = charged_distance(arrays, i, targets, length, flown)
    _put(pool, i, targets, length, distance)


@compiled
def pour(pool: Pool, into: Pool) -> None:
    """Move all routes of a pool into another one, as far as it has room."""
    for q in range(pool.size[0]):
        if into.size[0] < into.uav.shape[0]:
            _put(into, pool.uav[q], pool.target[q], pool.length[q], pool.distance[q])
    pool.size[0] = 0
    pool.slot[:] = NONE


@compiled
def thin(pool: Pool, kept: Flags) -> None:
    """Drop the routes that are not among those `kept`, (size,)."""
    size = pool.size[0]
    pool.size[0] = 0
    pool.slot[:] = NONE
    for q in range(size):
        if kept[q]:
            _put(pool, pool.uav[q], pool.target[q], pool.length[q], pool.distance[q])


@compiled
def _put(pool: Pool, i: int, targets: Integers, length: int, distance: float) -> None:
    """Keep a route; there is room for it."""
    name = pool.name[pool.kind[i]]
    for s in range(length):
        name += pool.name[pool.kind.shape[0] + targets[s]]
    place = name % pool.slot.shape[0]
    while pool.slot[place] != NONE and pool.route_name[pool.slot[place]] != name:
        place = (place + 1) % pool.slot.shape[0]
    q = pool.slot[place]
    if q == NONE:
        q = pool.size[0]
        pool.size[0] = q + 1
        pool.slot[place] = q
    elif pool.distance[q] <= distance:
        return
    pool.route_name[q], pool.uav[q], pool.length[q], pool.distance[q] = name, i, length, distance
    for s in range(length):
        pool.target[q, s] = targets[s]
