"""A bound for problems of any size: every visit pays at least the shortest leg that ends at its target.

Needs and loads both have prices here, so that a UAV's best visits are simply those that gain most, at most S
of them; the prices fall along subgradients. Weaker than the bound over target sets, but a round costs no
more than looking at every pair of UAV and target once.
"""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import Floats
from app.simulation.compilation import njit
from app.simulation.visit import first_visits
from app.solvers.bound.instance import Instance, ceiling, safely
from app.solvers.bound.target_sets import SLACK
from app.solvers.protocol import StopCriterion

_ROUNDS = 3000
_PATIENCE = 20
"""Rounds without a lower bound after which steps become shorter."""

_SHORTEST_STEP = 1e-3
_PIECE = 200_000
"""Pairs of UAV and target, times materials, between two looks at the stop criterion: some milliseconds."""


def visit_bound(instance: Instance, lower: float, stop: StopCriterion) -> float:
    """Bound the reward of any plan, in the instance's scale.

    Parameters
    ----------
    instance
        The problem.
    lower
        Reward of a plan that is known, in the instance's scale; steps are sized by it.
    stop
        Asked every few milliseconds; at first the bound is what meeting every need would earn.
    """
    most = ceiling(instance)
    if stop():
        return most
    load = instance.load
    legs = _shortest_legs(instance)
    if np.isinf(legs).all():
        return float(instance.idle.sum())
    needs, loads = np.zeros(instance.need.shape), np.zeros(load.shape)
    best, best_prices = np.inf, (needs, loads)
    step, since = 1.0, 0
    for _ in range(_ROUNDS):
        met, used = np.zeros(needs.shape), np.zeros(load.shape)
        total = _earnings(instance, legs, needs, loads, met, used, stop)
        if total is None:
            break
        paid = float(needs.sum()) + float((loads * load).sum())
        bound = safely(total + paid, abs(total) + 2.0 * paid + most)
        since = 0 if bound < best - 1e-6 * abs(bound) else since + 1
        if bound < best:
            best, best_prices = bound, (needs, loads)
        if min(best, most) <= lower or step < _SHORTEST_STEP:
            break
        if since > _PATIENCE:
            step, since = step / 2, 0
            needs, loads = best_prices
            continue
        # The loads' prices are moved as if they were of shares too, so that both directions are of one unit.
        # A price that is 0 and would fall does not count.
        whole = np.where(load > 0, load, 1.0)
        down_needs = np.where((instance.need > 0) & ((needs > 0) | (met > 1.0)), 1.0 - met, 0.0)
        down_loads = np.where((load > 0) & ((loads > 0) | (used > load)), 1.0 - used / whole, 0.0)
        norm = float((down_needs**2).sum() + (down_loads**2).sum())
        if norm <= 1e-18:
            break
        length = step * max(bound - lower, 1e-3 * abs(bound)) / norm
        needs = np.maximum(0.0, needs - length * down_needs)
        loads = np.maximum(0.0, loads - length * down_loads / whole)
    return min(best, most)


def _earnings(
    instance: Instance,
    legs: Floats,
    needs: Floats,
    loads: Floats,
    met: Floats,
    used: Floats,
    stop: StopCriterion,
) -> float | None:
    """Return what all UAVs earn at the prices, or None if there was no time to say."""
    m, n = legs.shape
    piece = max(1, _PIECE // (n * instance.need.shape[1]))
    longest = int(instance.arrays.max_steps[0])
    total = 0.0
    for first in range(0, m, piece):
        if stop():
            return None
        last = min(first + piece, m)
        total += _evaluate(
            first, last, longest, legs, instance.worth, instance.need, instance.load, instance.idle,
            needs, loads, met, used,
        )  # fmt: skip
    return total


def _shortest_legs(instance: Instance) -> Floats:
    """Return the least a visit costs, (M, N); infinite where it is not possible at all."""
    arrays = instance.arrays
    legs = _nearest_legs(arrays.start_target[0], arrays.between[0].min(axis=0), arrays.shape[1])
    possible = instance.useful & first_visits(arrays, SLACK)
    return np.where(possible, instance.price * legs, np.inf)


@njit(cache=True, error_model="numpy")
def _nearest_legs(start: Floats, between: Floats, n: int) -> Floats:
    """Return the shortest leg to each of n targets that a UAV can fly: from its place or another stop."""
    m = start.shape[0]
    nearest = np.full(n, np.inf)
    for j in range(between.shape[0]):
        for k in range(n):
            if k != j:
                nearest[k] = min(nearest[k], between[j, k])
    legs = np.empty((m, n))
    for i in range(m):
        for j in range(n):
            legs[i, j] = min(start[i, j], nearest[j])
    return legs


@njit(cache=True, error_model="numpy")
def _evaluate(
    first: int,
    last: int,
    most: int,
    legs: Floats,
    worth: Floats,
    need: Floats,
    load: Floats,
    idle: Floats,
    needs: Floats,
    loads: Floats,
    met: Floats,
    used: Floats,
) -> float:
    """Return what some UAVs earn at the prices; add to the shares of needs met and the amounts unloaded."""
    n, materials = need.shape
    gain, target = np.empty(n), np.empty(n, np.int64)
    total = 0.0
    for i in range(first, last):
        count = 0
        for j in range(n):
            if legs[i, j] == np.inf:
                continue
            earned = -legs[i, j]
            for k in range(materials):
                net = worth[j, k] - needs[j, k] - loads[i, k] * need[j, k]
                if net > 0.0 and load[i, k] > 0.0:
                    earned += net * min(1.0, load[i, k] / need[j, k])
            if earned > 0.0:
                gain[count], target[count] = earned, j
                count += 1
        order = np.argsort(-gain[:count])[:most]
        best = 0.0
        for at in order:
            best += gain[at]
        if best <= idle[i]:
            total += idle[i]
            continue
        total += best
        for at in order:
            j = target[at]
            for k in range(materials):
                if load[i, k] > 0.0 and worth[j, k] - needs[j, k] - loads[i, k] * need[j, k] > 0.0:
                    share = min(1.0, load[i, k] / need[j, k])
                    met[j, k] += share
                    used[i, k] += share * need[j, k]
    return total
