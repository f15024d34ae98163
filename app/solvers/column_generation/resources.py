"""What may run out on a UAV's route: range, time, time in the air and loads, with a tolerance.

What a UAV is committed to, and that waiting is time in the air, does not count here: routes that this
forbids are found, and thrown away.
"""

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
    leg, time
        (N, N) lengths and times of legs between targets.
    ordered
        Whether legs that are longer use up more of everything.
    first
        (N, R) used after a first visit.
    rate, pace
        (R,) used by a unit of distance, and by a unit of time.
    amount
        (N, R) used by a visit.
    least, most
        (N, R) what has been used at least after a visit, and what may have been.
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

    leg: Floats
    time: Floats
    ordered: bool
    first: Floats
    rate: Floats
    pace: Floats
    amount: Floats
    least: Floats
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
    speed, visits = (
        float(arrays.uavs["speed"][0, i]),
        min(int(arrays.max_steps[0]), arrays.areas["level"].shape[1]),
    )
    start, home, service = arrays.start_target[0, i], arrays.home[0, i], arrays.areas["service"][0]
    between, timed = arrays.between[0, arrays.uavs["leg_class"][0, i]], arrays.terms["timed"][0]
    ready, land_by = float(arrays.uavs["ready"][0, i]), float(arrays.uavs["until"][0, i])
    endurance = float(arrays.uavs["endurance"][0, i])
    ranges, latest = limits(arrays, tolerance)
    reach = ranges[i] - arrays.uavs["dis"][0, i] - arrays.kept_range[0, i]
    start_time = arrays.start_time[0, i] if timed else start / speed
    home_time = np.zeros_like(home)
    if arrays.terms["return_to_base"][0]:
        home_time = arrays.home_time[0, i] if timed else home / speed
    by_length, by_time, nothing_used = (
        (1.0, 0.0),
        (0.0, 1.0) if timed else (1.0 / speed, 0.0),
        np.zeros_like(start),
    )
    rows = []
    # Time is flown at this speed at least, so a UAV that is never late flies no farther than that.
    if timed or reach.min(initial=np.inf) < speed * latest.max(initial=0.0):
        in_wind = arrays.terms["in_wind"][0]
        use = (0.0, speed) if in_wind else by_length
        rows.append((start_time * speed if in_wind else start, use, nothing_used, nothing_used, reach))
    if np.isfinite(latest).any() or np.isfinite(land_by):
        first = np.maximum(ready + start_time, arrays.areas["earliest"][0]) + service
        until = land_by + abs(land_by) * tolerance
        rows.append(
            (
                first,
                by_time,
                service,
                arrays.areas["earliest"][0] + service,
                np.minimum(latest + service, until - home_time),
            )
        )
    if np.isfinite(endurance):
        aloft = endurance * (1.0 + tolerance) - float(arrays.uavs["airborne"][0, i]) - home_time
        rows.append((start_time + service, by_time, service, nothing_used, aloft))
    for need, load, most in zip(arrays.need[0].T, arrays.load[0, i], needed, strict=True):
        if most > load:
            rows.append(
                (need, (0.0, 0.0), need, nothing_used, np.broadcast_to(load * (1.0 + tolerance), need.shape))
            )
    weight, nothing = float(arrays.terms["weight"][0]), _AS_MUCH * float(worth(arrays).max(initial=0.0))
    charged = weight if arrays.terms["charge_return"][0] else 0.0
    columns = [
        np.column_stack([row[at] for row in rows] or [np.empty((len(start), 0))]) for at in (0, 2, 3, 4)
    ]
    first, amount, least, most = (np.ascontiguousarray(column, np.float64) for column in columns)
    uses = np.array([row[1] for row in rows], np.float64).reshape(-1, 2)
    return VehicleResources(
        leg=between,
        time=arrays.between_time[0, arrays.uavs["leg_class"][0, i]] if timed else between,
        ordered=not timed and arrays.between.shape[1] == 1,
        first=first,
        rate=np.ascontiguousarray(uses[:, 0]),
        pace=np.ascontiguousarray(uses[:, 1]),
        amount=amount,
        least=least,
        most=most,
        farthest=(most - amount).max(axis=0, initial=-np.inf),
        start=weight * start,
        finish=charged * home,
        weight=weight,
        visits=visits,
        nothing=nothing,
    )
