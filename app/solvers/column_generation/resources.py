"""What may run out on a UAV's route: range, time to the deadlines and loads, with a tolerance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import TOLERANCE
from app.simulation.arrays import Floats, ProblemArrays
from app.simulation.visit import limits
from app.solvers.column_generation.packing import worth

_AS_MUCH = 1e-12
"""Relative difference that does not count when labels are compared: rounding."""


class VehicleResources(NamedTuple):
    """What a UAV has, in R resources that may run out.

    Attributes
    ----------
    first
        (N, R) used after a first visit.
    rate
        (R,) used by a unit of distance.
    amount
        (N, R) used by a visit.
    most
        (N, R) what may have been used after a visit.
    farthest
        (R,) what may have been used before a visit, at whichever target.
    start, finish
        (N,) what it costs to begin, and to end, with a target.
    weight
        What a unit of distance costs.
    visits
        How many visits there may be.
    nothing
        A difference in worth that is only rounding.
    """

    first: Floats
    rate: Floats
    amount: Floats
    most: Floats
    farthest: Floats
    start: Floats
    finish: Floats
    weight: float
    visits: int
    nothing: float


def resources_of(
    arrays: ProblemArrays, i: int, needed: Floats, tolerance: float = TOLERANCE
) -> VehicleResources:
    """Write down what UAV `i` has, leaving out what cannot run out; limits may be exceeded by a tolerance.

    `needed` are the :func:`~app.solvers.column_generation.pool.largest_needs`.
    """
    speed, visits = float(arrays.speed[0, i]), min(int(arrays.max_steps[0]), arrays.level.shape[1])
    start, home, service = arrays.start_target[0, i], arrays.home[0, i], arrays.service[0]
    ranges, latest = limits(arrays, tolerance)
    reach = np.broadcast_to(ranges[i], start.shape) - arrays.dis[0, i]
    if arrays.return_to_base[0]:
        reach = reach - home
    rows = []
    # Time is flown at this speed at least, so a UAV that is never late flies no farther than that.
    if reach.min(initial=np.inf) < speed * latest.max(initial=0.0):
        rows.append((start, 1.0, np.zeros_like(start), reach))
    if np.isfinite(latest).any():
        rows.append((start / speed + service, 1.0 / speed, service, latest + service))
    for need, load, most in zip(arrays.need[0].T, arrays.load[0, i], needed, strict=True):
        if most > load:
            rows.append((need, 0.0, need, np.broadcast_to(load * (1.0 + tolerance), need.shape)))
    weight, nothing = float(arrays.weight[0]), _AS_MUCH * float(worth(arrays).max(initial=0.0))
    charged = weight if arrays.charge_return[0] else 0.0
    columns = [np.column_stack([row[at] for row in rows] or [np.empty((len(start), 0))]) for at in (0, 2, 3)]
    first, amount, most = (np.ascontiguousarray(column, np.float64) for column in columns)
    rate = np.array([row[1] for row in rows], np.float64)
    farthest = (most - amount).max(axis=0, initial=-np.inf)
    return VehicleResources(
        first, rate, amount, most, farthest, weight * start, charged * home, weight, visits, nothing
    )
