"""Every set of targets that one UAV can visit, with the cheapest order of each.

On a route of a given set with a given last target the service times before it are the same in every order,
so the shortest way there is also the earliest arrival: one number a state makes the dynamic program exact,
with range and deadlines (the argument of Held and Karp, extended; see README.md).
"""

from __future__ import annotations

from math import comb
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app.domain.problem import TOLERANCE
from app.simulation.arrays import Floats, Integers
from app.simulation.compilation import njit
from app.simulation.visit import limits
from app.solvers.bound.instance import Instance
from app.solvers.protocol import StopCriterion
from app.solvers.stop import never

Members = npt.NDArray[np.int16]

MAX_TARGETS = 62
"""Targets whose sets fit the bits of an integer."""

SLACK = 2.0 * TOLERANCE
"""Wider than the simulator's own tolerance, so that rounding never loses a route that it allows."""


class TargetSets(NamedTuple):
    """The sets of one UAV, R of them, without the empty one.

    Attributes
    ----------
    members
        (R, L) targets in ascending order, as many as ``size`` says.
    size
        (R,) number of targets.
    mask
        (R,) the set as bits.
    cost
        (R,) what the shortest legal route over the set costs, the leg home where it is charged.
    """

    members: Members
    size: Integers
    mask: Integers
    cost: Floats


def count_sets(instance: Instance) -> int:
    """Count the sets of all UAVs before range and deadlines; what it takes to enumerate them."""
    steps = int(instance.arrays.max_steps[0])
    total = 0
    for n in instance.useful.sum(axis=1).tolist():
        total += sum(comb(n, size) for size in range(1, min(n, steps) + 1))
    return total


def sets_of(instance: Instance, i: int, stop: StopCriterion = never) -> TargetSets | None:
    """Enumerate the sets of UAV `i`; None if it was stopped, which is asked before each size of sets."""
    arrays = instance.arrays
    targets = np.flatnonzero(instance.useful[i])
    n, longest = len(targets), min(len(targets), int(arrays.max_steps[0]))
    if longest == 0:
        return TargetSets(
            np.empty((0, 1), np.int16), np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
        )
    ranges, deadlines = limits(arrays, SLACK)
    binomial = np.array([[comb(a, b) for b in range(longest + 2)] for a in range(n + 1)], np.int64)
    given = (
        binomial,
        np.ascontiguousarray(arrays.start_target[0, i, targets]),
        np.ascontiguousarray(arrays.between[0][np.ix_(targets, targets)]),
        np.ascontiguousarray(arrays.home[0, i, targets]),
        float(arrays.speed[0, i]),
        float(ranges[i] - arrays.dis[0, i]),
        deadlines[targets],
        np.ascontiguousarray(arrays.service[0, targets]),
        bool(arrays.return_to_base[0]),
        bool(arrays.charge_return[0]),
    )
    found: list[tuple[Members, Floats]] = []
    way = np.zeros(1)
    for s in range(1, longest + 1):
        if stop():
            return None
        members, distance, way = _enumerate(s, way, *given)
        found.append((members, distance))
        if not len(distance):
            break  # A legal route begins with one that has a visit less, so no larger set has any.
    members = np.concatenate([np.pad(of, ((0, 0), (0, longest - of.shape[1]))) for of, _ in found])
    size = np.repeat(np.arange(1, len(found) + 1), [len(of) for of, _ in found])
    distance = np.concatenate([ways for _, ways in found])
    used = np.arange(longest)[None, :] < size[:, None]
    mask = (used * (np.int64(1) << targets)[members]).sum(axis=1)
    return TargetSets(targets.astype(np.int16)[members], size, mask, instance.price * distance)


@njit(cache=True, error_model="numpy")
def _enumerate(
    s: int,
    before: Floats,
    binomial: Integers,
    start: Floats,
    between: Floats,
    home: Floats,
    speed: float,
    reach: float,
    latest: Floats,
    service: Floats,
    must_return: bool,
    charged: bool,
) -> tuple[Members, Floats, Floats]:
    """Go through the sets of size `s` in colexicographic order; return those with a legal route.

    The second is the length of the shortest one; in the third, ``way[rank · s + p]`` is the shortest legal
    way over the set of that rank which ends at its member p. `before` is the same of the size below.
    """
    n = len(start)
    count = binomial[n, s]
    members = np.zeros((count, s), np.int16)
    distance = np.zeros(count)
    found = 0
    chosen = np.zeros(s + 1, np.int64)
    way = np.full(count * s, np.inf)
    for t in range(s):
        chosen[t] = t
    for rank in range(count):
        best = np.inf
        served = 0.0
        for t in range(s):
            served += service[chosen[t]]
        for p in range(s):
            j = chosen[p]
            if s == 1:
                d = start[j]
            else:
                rest = 0
                for t in range(p):
                    rest += binomial[chosen[t], t + 1]
                for t in range(p + 1, s):
                    rest += binomial[chosen[t], t]
                d = np.inf
                for q in range(s - 1):
                    from_ = chosen[q] if q < p else chosen[q + 1]
                    d = min(d, before[rest * (s - 1) + q] + between[from_, j])
            if d == np.inf or d + (home[j] if must_return else 0.0) > reach:
                continue
            if latest[j] < np.inf:
                arrival = d / speed + (served - service[j])
                if arrival > latest[j] + 1e-12 * (arrival + served):
                    continue
            way[rank * s + p] = d
            best = min(best, d + (home[j] if charged else 0.0))
        if best < np.inf:
            distance[found] = best
            for t in range(s):
                members[found, t] = chosen[t]
            found += 1
        # The next set in colexicographic order.
        t = 0
        while t < s - 1 and chosen[t] + 1 == chosen[t + 1]:
            chosen[t] = t
            t += 1
        chosen[t] += 1
    return members[:found].copy(), distance[:found].copy(), way
