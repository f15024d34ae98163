"""What the sets of one UAV are worth at given prices of the needs: a fractional knapsack a material."""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import Floats, Integers
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.solvers.bound.target_sets import Members


@compiled
def unload(
    members: Members, size: int, k: int, gain: Floats, need: Floats, load: float, order: Integers
) -> int:
    """Fill `order` with the members that gain at material `k`, best first; return their number.

    Parameters
    ----------
    members, size
        The set.
    k
        The material.
    gain
        (N, K) what meeting the whole need earns above its price.
    need, load
        (N, K) amounts needed, and the amount carried of `k`.
    order
        Scratch space, overwritten.
    """
    count = 0
    if load <= 0.0:
        return count
    for t in range(size):
        j = members[t]
        if gain[j, k] <= 0.0:
            continue
        at = count
        # Ordered by gain an amount; cross-multiplied, because needs may be tiny.
        while at > 0 and gain[j, k] * need[order[at - 1], k] > gain[order[at - 1], k] * need[j, k]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = j
        count += 1
    return count


@njit(cache=True, error_model="numpy")
def price_sets(
    members: Members,
    size: Integers,
    cost: Floats,
    pool: Integers,
    gain: Floats,
    need: Floats,
    load: Floats,
) -> Floats:
    """Return what each set of a pool is worth, after its cost.

    Parameters
    ----------
    members, size, cost
        As :class:`~app.solvers.bound.target_sets.TargetSets` has them.
    pool
        (P,) which of them.
    gain, need
        (N, K) what meeting a whole need earns above its price, and the need.
    load
        (K,) amounts carried.
    """
    value = np.empty(len(pool))
    order = np.empty(members.shape[1], np.int64)
    for at in range(len(pool)):
        r = pool[at]
        total = -cost[r]
        for k in range(len(load)):
            left = load[k]
            count = unload(members[r], size[r], k, gain, need, left, order)
            for t in range(count):
                j = order[t]
                if need[j, k] <= left:
                    left -= need[j, k]
                    total += gain[j, k]
                else:
                    total += gain[j, k] * (left / need[j, k])
                    break
        value[at] = total
    return value


@njit(cache=True, error_model="numpy")
def deliveries(members: Members, size: int, gain: Floats, need: Floats, load: Floats) -> Floats:
    """Return the shares of the needs, (N, K), that the best unloading over one set meets."""
    share = np.zeros(need.shape)
    order = np.empty(len(members), np.int64)
    for k in range(len(load)):
        left = load[k]
        count = unload(members, size, k, gain, need, left, order)
        for t in range(count):
            j = order[t]
            if need[j, k] <= left:
                left -= need[j, k]
                share[j, k] = 1.0
            else:
                share[j, k] = left / need[j, k]
                break
    return share
