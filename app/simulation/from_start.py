"""Which UAVs could come to a target from where the request has the swarm, and what stands in the way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation import simulator, visit
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.flown_plan import FlownPlan
from app.simulation.visit import inlined


class Start(NamedTuple):
    """Which UAV could come to each target from where the request has the swarm; NONE where none could.

    Attributes
    ----------
    carrier, missing
        (N,) the UAV that carries something needed and lacks least range, and how much it lacks.
    fastest, arrival
        (N,) the UAV among those with the range that arrives first, and when.
    able
        (N,) a UAV that could fly there directly, whatever it is committed to.
    """

    carrier: Integers
    missing: Floats
    fastest: Integers
    arrival: Floats
    able: Integers


class DirectNeeds(NamedTuple):
    """What a flight from the start to a target, and home where it is required, takes of a UAV.

    Attributes
    ----------
    aloft, waiting
        Time in the air, and how much of it is waiting.
    landing
        When the UAV has landed.
    """

    aloft: float
    waiting: float
    landing: float


def look_from_start(arrays: ProblemArrays, plan: FlownPlan, targets: Integers) -> Start:
    """Look at the swarm from some targets."""
    n = arrays.shape[1]
    start = Start(
        np.full(n, NONE, np.int64), np.full(n, np.inf), np.full(n, NONE, np.int64), np.full(n, np.inf),
        np.full(n, NONE, np.int64),
    )  # fmt: skip
    # What is found does not depend on the order; neighbours in memory are quicker one after the other.
    _look_from_start(arrays, plan, np.sort(targets), start)
    return start


def needs_of(arrays: ProblemArrays, i: int, j: int) -> DirectNeeds:
    """Work out what a flight of UAV `i` from its start to target `j` takes."""
    found = np.zeros(3)
    _measure(arrays, i, j, found)
    return DirectNeeds(*found.tolist())


@simulator.compiled
def _measure(arrays: ProblemArrays, i: int, j: int, found: Floats) -> None:
    clock = visit.ready(arrays, 0, i)
    length = visit.leg(arrays, 0, i, visit.START, j)
    arrival = clock + visit.leg_time(arrays, 0, i, visit.START, j, length)
    end = visit.departure_after(arrays, 0, j, arrival)
    aloft = visit.aloft_after(arrays, 0, i, True, visit.airborne(arrays, 0, i), clock, arrival, end, j)
    back = visit.time_home(arrays, 0, i, j)
    on_ground = end - clock + visit.airborne(arrays, 0, i) - aloft
    found[0], found[2] = aloft + back, end + back
    found[1] = max(0.0, visit.begin_after(arrays, 0, j, arrival) - arrival - on_ground)


@inlined
def carries(arrays: ProblemArrays, plan: FlownPlan, i: int, j: int) -> bool:
    """Whether a UAV can be sent and carries, at first, something that a target still needs at the end."""
    useful = False
    for k in range(plan.remaining.shape[1]):
        useful = useful or visit.can_unload(arrays.load[0, i, k], plan.remaining[j, k])
    return bool(useful and not arrays.ret[0, i])


@simulator.compiled
def direct_rule(arrays: ProblemArrays, i: int, j: int) -> int:
    """Rule that a UAV's flight from its start to a target breaks, whatever it unloads and is committed to."""
    flown, clock, aloft = arrays.uavs[0, i].dis, visit.ready(arrays, 0, i), visit.airborne(arrays, 0, i)
    return visit.reach_rule(arrays, 0, i, visit.START, j, visit.FREE, flown, clock, aloft)


@simulator.compiled
def _look_from_start(arrays: ProblemArrays, plan: FlownPlan, targets: Integers, start: Start) -> None:
    """Which UAV carries what a target needs, which of these has the range, and which of those is first."""
    for i in range(arrays.load.shape[1]):
        for q in range(targets.shape[0]):
            j = targets[q]
            if not carries(arrays, plan, i, j):
                continue
            length = visit.leg(arrays, 0, i, visit.START, j)
            time = visit.leg_time(arrays, 0, i, visit.START, j, length)
            flown = arrays.uavs[0, i].dis + visit.air_length(arrays, 0, i, length, time)
            missing = visit.flown_with_return(arrays, 0, i, j, flown) - arrays.uavs[0, i].voyage
            if missing < start.missing[j]:
                start.missing[j], start.carrier[j] = missing, i
            rule = direct_rule(arrays, i, j)
            if rule not in (visit.BARRED, visit.OUT_OF_RANGE):
                arrival = visit.ready(arrays, 0, i) + time
                if arrival < start.arrival[j]:
                    start.arrival[j], start.fastest[j] = arrival, i
            if rule == visit.ALLOWED and start.able[j] < 0:
                start.able[j] = i
