"""Every set of targets that one UAV can visit, with the cheapest order of each.

On a route of a given set with a given last target the service times before it are the same in every order,
so the shortest way there is also the earliest arrival: one number a state makes the dynamic program exact,
with range and deadlines (the argument of Held and Karp, extended; see README.md). In wind, with given times,
and where UAVs wait, the least length, the least air length and the earliest arrival may be of other orders:
then there are three numbers, and some sets more than are legal.
"""

from __future__ import annotations

from math import comb
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app.domain.problem import TOLERANCE
from app.simulation.arrays import Floats, Integers, ProblemArrays
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
    binomial = np.array([[comb(a, b) for b in range(longest + 2)] for a in range(n + 1)], np.int64)
    given = (binomial, legs_of_uav(arrays, i, targets))
    found: list[tuple[Members, Floats]] = []
    before = (np.zeros(1), np.zeros(1), np.zeros(1))
    for s in range(1, longest + 1):
        if stop():
            return None
        members, distance, *least = _enumerate(s, *before, *given)
        before = (least[0], least[1], least[2])
        found.append((members, distance))
        if not len(distance):
            break  # A legal route begins with one that has a visit less, so no larger set has any.
    members = np.concatenate([np.pad(of, ((0, 0), (0, longest - of.shape[1]))) for of, _ in found])
    size = np.repeat(np.arange(1, len(found) + 1), [len(of) for of, _ in found])
    distance = np.concatenate([ways for _, ways in found])
    used = np.arange(longest)[None, :] < size[:, None]
    mask = (used * (np.int64(1) << targets)[members]).sum(axis=1)
    return TargetSets(targets.astype(np.int16)[members], size, mask, instance.price * distance)


class LegsOfUAV(NamedTuple):
    """What one UAV needs to fly to n targets, and has, with slack; no way over other places is less.

    Attributes
    ----------
    start, between, home
        (n,), (n, n), (n,) lengths; those home where they are charged, else 0.
    start_time, between_time
        (n,), (n, n) times of the same legs.
    start_air, between_air
        (n,), (n, n) their air lengths.
    reach
        (n,) air length that may be flown on arrival.
    ready
        Its clock at the start.
    earliest, latest, service, land_by
        (n,) when a visit begins soonest, the latest arrival, its service time, and when it must have ended.
    simple
        Whether air lengths are lengths, times follow from them, and nobody waits: then the shortest order is
        the first to arrive.
    speed
        Of the UAV.
    """

    start: Floats
    between: Floats
    home: Floats
    start_time: Floats
    between_time: Floats
    start_air: Floats
    between_air: Floats
    reach: Floats
    ready: float
    earliest: Floats
    latest: Floats
    service: Floats
    land_by: Floats
    simple: bool
    speed: float


def legs_of_uav(arrays: ProblemArrays, i: int, targets: Integers) -> LegsOfUAV:
    """Write down what UAV `i` needs to fly to some targets, and what it has."""
    speed, of = float(arrays.uavs["speed"][0, i]), arrays.uavs["leg_class"][0, i]
    ranges, deadlines = limits(arrays, SLACK)
    timed, in_wind = arrays.terms["timed"][0], arrays.terms["in_wind"][0]
    every = np.ix_(targets, targets)
    start, between = arrays.start_target[0, i, targets], arrays.between[0, of][every]
    start_time = arrays.start_time[0, i, targets] if timed else start / speed
    between_time = arrays.between_time[0, of][every] if timed else between / speed
    if not arrays.terms["metric"][0]:
        start, between = _least_over_others(start, between)
        start_time, between_time = _least_over_others(start_time, between_time)
    home, must_return = arrays.home[0, i, targets], bool(arrays.terms["return_to_base"][0])
    home_time = (
        (arrays.home_time[0, i, targets] if timed else home / speed) if must_return else np.zeros(len(home))
    )
    until = float(arrays.uavs["until"][0, i])
    return LegsOfUAV(
        start=np.ascontiguousarray(start),
        between=np.ascontiguousarray(between),
        home=home if arrays.terms["charge_return"][0] else np.zeros(len(home)),
        start_time=np.ascontiguousarray(start_time),
        between_time=np.ascontiguousarray(between_time),
        start_air=np.ascontiguousarray(start_time * speed if in_wind else start),
        between_air=np.ascontiguousarray(between_time * speed if in_wind else between),
        reach=ranges[i] - arrays.uavs["dis"][0, i] - arrays.kept_range[0, i, targets],
        ready=float(arrays.uavs["ready"][0, i]),
        earliest=arrays.areas["earliest"][0, targets],
        latest=deadlines[targets],
        service=arrays.areas["service"][0, targets],
        land_by=until + abs(until) * SLACK - home_time,
        simple=not timed and until == np.inf and not arrays.areas["earliest"][0, targets].any(),
        speed=speed,
    )


def _least_over_others(start: Floats, between: Floats) -> tuple[Floats, Floats]:
    """Return the least that legs from a start and among targets could be over any other of these targets."""
    least = between.copy()
    np.fill_diagonal(least, 0.0)
    for over in range(len(least)):
        np.minimum(least, least[:, over, None] + least[None, over], out=least)
    return np.minimum(start, (start[:, None] + least).min(axis=0)), least


@njit(cache=True, error_model="numpy")
def _enumerate(
    s: int, before: Floats, before_air: Floats, before_end: Floats, binomial: Integers, legs: LegsOfUAV
) -> tuple[Members, Floats, Floats, Floats, Floats]:
    """Go through the sets of size `s` in colexicographic order; return those with a legal route.

    The second is the length of the shortest one; in the third, ``way[rank · s + p]`` is the length of the
    shortest way over the set of that rank which ends at its member p. The others are the least air length and
    the soonest end likewise, where they do not follow from it: each by itself, so that limits on them leave
    out no legal route. `before` and so on are the same of the size below.
    """
    n = len(legs.start)
    count = binomial[n, s]
    members = np.zeros((count, s), np.int16)
    distance = np.zeros(count)
    found = 0
    chosen = np.zeros(s + 1, np.int64)
    way = np.full(count * s, np.inf)
    others = 0 if legs.simple else count * s
    way_air, way_end = np.full(others, np.inf), np.full(others, np.inf)
    for t in range(s):
        chosen[t] = t
    for rank in range(count):
        best = np.inf
        served = 0.0
        for t in range(s):
            served += legs.service[chosen[t]]
        for p in range(s):
            j = chosen[p]
            air, arrival = np.inf, np.inf
            if s == 1:
                d, air, arrival = legs.start[j], legs.start_air[j], legs.ready + legs.start_time[j]
            else:
                rest = 0
                for t in range(p):
                    rest += binomial[chosen[t], t + 1]
                for t in range(p + 1, s):
                    rest += binomial[chosen[t], t]
                d = np.inf
                for q in range(s - 1):
                    from_ = chosen[q] if q < p else chosen[q + 1]
                    d = min(d, before[rest * (s - 1) + q] + legs.between[from_, j])
                    if not legs.simple:
                        air = min(air, before_air[rest * (s - 1) + q] + legs.between_air[from_, j])
                        arrival = min(arrival, before_end[rest * (s - 1) + q] + legs.between_time[from_, j])
            if legs.simple:
                air = d
            if d == np.inf or air > legs.reach[j]:
                continue
            if legs.latest[j] < np.inf or not legs.simple:
                if legs.simple:
                    arrival = legs.ready + d / legs.speed + (served - legs.service[j])
                if arrival > legs.latest[j] + 1e-12 * (arrival + served):
                    continue
                if not legs.simple:
                    end = max(arrival, legs.earliest[j]) + legs.service[j]
                    if end > legs.land_by[j] + 1e-12 * end:
                        continue
                    way_air[rank * s + p], way_end[rank * s + p] = air, end
            way[rank * s + p] = d
            best = min(best, d + legs.home[j])
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
    return members[:found].copy(), distance[:found].copy(), way, way_air, way_end
