"""A bound for problems of any size: every visit pays at least the shortest leg that ends at its target.

Needs and loads both have prices here, so that a UAV's best visits are simply those that gain most, at most S
of them; the prices fall along subgradients. Weaker than the bound over target sets, but a round costs no
more than looking at every pair of UAV and target once.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from app.simulation.arrays import Floats
from app.simulation.simulator import TOLERANCE
from app.solvers.bound.instance import Instance, safely
from app.solvers.protocol import StopCriterion

_ROUNDS = 3000
_PATIENCE = 15
"""Rounds without a lower bound after which steps become shorter."""

_SHORTEST_STEP = 1e-4


def visit_bound(instance: Instance, lower: float, stop: StopCriterion) -> float:
    """Bound the reward of any plan, in the instance's scale.

    Parameters
    ----------
    instance
        The problem.
    lower
        Reward of a plan that is known, in the instance's scale; steps are sized by it.
    stop
        Asked every round; without any round the bound is what meeting every need would earn.
    """
    legs = _shortest_legs(instance)
    most = int(instance.arrays.max_steps[0])
    needs = np.zeros(instance.need.shape)
    loads = np.zeros(instance.load.shape)
    magnitude = float(instance.worth.sum()) + float(np.abs(instance.idle).sum())
    ceiling, best = safely(float(instance.worth.sum()), magnitude), np.inf
    best_needs, best_loads = needs.copy(), loads.copy()
    step, since = 1.0, 0
    for _ in range(_ROUNDS):
        if stop() or min(best, ceiling) <= lower or step < _SHORTEST_STEP:
            break
        met, used = np.zeros(needs.shape), np.zeros(loads.shape)
        total = _evaluate(
            legs, instance.worth, instance.need, instance.load, instance.idle, needs, loads, most, met, used
        )
        total += float(needs.sum()) + float((loads * instance.load).sum())
        bound = safely(total, magnitude + float(needs.sum()) + 2 * float((loads * instance.load).sum()))
        if bound < best - 1e-6 * abs(bound):
            since = 0
        else:
            since += 1
        if bound < best:
            best, best_needs, best_loads = bound, needs.copy(), loads.copy()
        if since > _PATIENCE:
            step, since = step / 2, 0
            needs, loads = best_needs.copy(), best_loads.copy()
            continue
        # Loads are scaled to shares, so that both directions are of the same unit.
        spare = np.where(instance.load > 0, 1.0 - used / np.where(instance.load > 0, instance.load, 1.0), 0.0)
        slope_needs = np.where(instance.need > 0, 1.0 - met, 0.0)
        norm = float((slope_needs**2).sum() + (spare**2).sum())
        if norm <= 1e-18:
            break
        length = step * max(total - max(lower, 0.0), 1e-3 * abs(total)) / norm
        needs = np.maximum(0.0, needs - length * slope_needs)
        loads = np.maximum(0.0, loads - length * spare / np.where(instance.load > 0, instance.load, 1.0))
    return min(best, ceiling)


def _shortest_legs(instance: Instance) -> Floats:
    """Return the least a visit costs, (M, N); infinite where it is not possible at all."""
    arrays = instance.arrays
    n = arrays.level.shape[1]
    apart = arrays.between[0] + np.where(np.eye(n, dtype=bool), np.inf, 0.0)
    start, home = arrays.start_target[0], arrays.home[0]
    legs = np.minimum(start, apart.min(axis=0, initial=np.inf)[None, :])
    reach = arrays.dis[0][:, None] + start + (home if arrays.return_to_base[0] else 0.0)
    possible = instance.useful & (reach <= arrays.voyage[0][:, None] * (1.0 + 2.0 * TOLERANCE))
    latest = arrays.deadline[0] + 2.0 * TOLERANCE * np.abs(arrays.deadline[0])
    possible &= start / arrays.speed[0][:, None] * (1.0 - 1e-12) <= latest[None, :]
    return np.where(possible, instance.price * legs, np.inf)


@njit(cache=True, error_model="numpy")
def _evaluate(
    legs: Floats,
    worth: Floats,
    need: Floats,
    load: Floats,
    idle: Floats,
    needs: Floats,
    loads: Floats,
    most: int,
    met: Floats,
    used: Floats,
) -> float:
    """Return what all UAVs earn at the prices; fill in the shares of needs met and the amounts unloaded."""
    m, n = legs.shape
    materials = need.shape[1]
    gain = np.empty(n)
    total = 0.0
    for i in range(m):
        count = 0
        for j in range(n):
            gain[j] = 0.0
            if legs[i, j] == np.inf:
                continue
            earned = -legs[i, j]
            for k in range(materials):
                net = worth[j, k] - needs[j, k] - loads[i, k] * need[j, k]
                if net > 0.0 and load[i, k] > 0.0:
                    earned += net * min(1.0, load[i, k] / need[j, k])
            if earned > 0.0:
                gain[j] = earned
                count += 1
        chosen = np.argsort(-gain)[: min(most, count)] if count > 0 else np.empty(0, np.int64)
        best = 0.0
        for j in chosen:
            best += gain[j]
        if best <= idle[i]:
            total += idle[i]
            continue
        total += best
        for j in chosen:
            for k in range(materials):
                net = worth[j, k] - needs[j, k] - loads[i, k] * need[j, k]
                if net > 0.0 and load[i, k] > 0.0:
                    share = min(1.0, load[i, k] / need[j, k])
                    met[j, k] += share
                    used[i, k] += share * need[j, k]
    return total
