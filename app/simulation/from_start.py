"""Which UAVs could come to a target from where the request has the swarm, and what stands in the way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation import visit
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled, inlined
from app.simulation.flown_plan import FlownPlan

_NOWHERE = -2
"""In place of where a flight begins: there is no such place."""


class Start(NamedTuple):
    """Which UAV could come to each target from where the request has the swarm; NONE where none could.

    A flight begins where a UAV is, or at a base that it flies to directly.

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


@compiled
def _measure(arrays: ProblemArrays, i: int, j: int, found: Floats) -> None:
    clock = visit.ready(arrays, 0, i)
    length = visit.leg(arrays, 0, i, visit.START, j)
    arrival = clock + visit.leg_time(arrays, 0, i, visit.START, j, length)
    end = visit.departure_after(arrays, 0, j, arrival)
    aloft = visit.aloft_after(arrays, 0, i, visit.START, visit.airborne(arrays, 0, i), clock, arrival, end, j)
    back = visit.time_home(arrays, 0, i, j)
    on_ground = end - clock + visit.airborne(arrays, 0, i) - aloft
    found[0], found[2] = aloft + back, end + back
    found[1] = max(0.0, visit.begin_after(arrays, 0, j, arrival) - arrival - on_ground)


@inlined
def carries(arrays: ProblemArrays, plan: FlownPlan, i: int, j: int) -> bool:
    """Whether a UAV can be sent and carries, now or from a base, something that a target needs at the end."""
    useful = False
    for k in range(plan.remaining.shape[1]):
        useful = useful or visit.can_unload(visit.most_ever(arrays, 0, i, k), plan.remaining[j, k])
    return bool(useful and not arrays.ret[0, i])


@compiled
def is_carried(arrays: ProblemArrays, plan: FlownPlan, i: int, j: int) -> bool:
    """As :func:`carries`, to be called from Python."""
    return carries(arrays, plan, i, j)


@compiled
def _rule_from(arrays: ProblemArrays, i: int, at: int, j: int) -> int:
    """Rule that a flight to a target breaks that begins at the start, or at a base flown to directly."""
    flown, clock, aloft = arrays.uavs[0, i].dis, visit.ready(arrays, 0, i), visit.airborne(arrays, 0, i)
    if at != visit.START:
        flown, clock, aloft = 0.0, _ready_at(arrays, i, at), 0.0
    return visit.reach_rule(arrays, 0, i, at, j, visit.FREE, flown, clock, aloft)


@inlined
def _ready_at(arrays: ProblemArrays, i: int, at: int) -> float:
    """Clock at which a UAV can set out from its start, or from a base that it has flown to directly."""
    clock = visit.ready(arrays, 0, i)
    if at != visit.START:
        length = visit.leg(arrays, 0, i, visit.START, at)
        arrival = clock + visit.leg_time(arrays, 0, i, visit.START, at, length)
        clock = visit.departure_after(arrays, 0, at, arrival)
    return clock


@inlined
def _origin(arrays: ProblemArrays, i: int, d: int) -> int:
    """Where a flight can begin: number 0 is the start, the others are bases; ``_NOWHERE`` where none can."""
    at = visit.START
    if d > 0:
        at = arrays.need.shape[1] + d
        if visit.is_barred(arrays, 0, i, visit.START, at):
            at = _NOWHERE
    return at


@inlined
def _progress(rule: int) -> int:
    """How far a flight that breaks a rule could get: rules in the order in which reasons are given."""
    if rule == visit.ALLOWED:
        far = 4
    elif rule == visit.BARRED:
        far = 0
    elif rule == visit.OUT_OF_RANGE:
        far = 1
    else:
        far = 2 if rule == visit.TOO_LATE else 3
    return far


@compiled
def direct_rule(arrays: ProblemArrays, i: int, j: int) -> int:
    """Rule that a UAV's direct flight to a target breaks, whatever it unloads and is committed to.

    It begins at its start, or at a base that it has flown to directly; the one that gets farthest counts.
    """
    rule = _rule_from(arrays, i, visit.START, j)
    for d in range(1, arrays.stock.shape[1] + 1):
        at = _origin(arrays, i, d)
        if at != _NOWHERE:
            other = _rule_from(arrays, i, at, j)
            if _progress(other) > _progress(rule):
                rule = other
    return rule


@compiled
def _look_from_start(arrays: ProblemArrays, plan: FlownPlan, targets: Integers, start: Start) -> None:
    """Which UAV carries what a target needs, which of these has the range, and which of those is first."""
    for i in range(arrays.load.shape[1]):
        for q in range(targets.shape[0]):
            j = targets[q]
            if not carries(arrays, plan, i, j):
                continue
            for d in range(arrays.stock.shape[1] + 1):
                at = _origin(arrays, i, d)
                if at == _NOWHERE:
                    continue
                length = visit.leg(arrays, 0, i, at, j)
                time = visit.leg_time(arrays, 0, i, at, j, length)
                flown = arrays.uavs[0, i].dis if at == visit.START else 0.0
                flown += visit.air_length(arrays, 0, i, length, time)
                missing = visit.flown_with_return(arrays, 0, i, j, flown) - arrays.uavs[0, i].voyage
                if missing < start.missing[j]:
                    start.missing[j], start.carrier[j] = missing, i
                rule = _rule_from(arrays, i, at, j)
                if rule not in (visit.BARRED, visit.OUT_OF_RANGE):
                    arrival = _ready_at(arrays, i, at) + time
                    if arrival < start.arrival[j]:
                        start.arrival[j], start.fastest[j] = arrival, i
                if rule == visit.ALLOWED and start.able[j] < 0:
                    start.able[j] = i
