"""What a UAV lacks for one more visit, if it keeps all the others of its route."""

from __future__ import annotations

import numpy as np

from app.simulation import visit
from app.simulation.arrays import Floats, ProblemArrays
from app.simulation.decorators import compiled, inlined
from app.simulation.flown_plan import FlownPlan

STEP, RANGE, TIME = 1, 2, 4
"""What a visit lacks, as a sum, where the UAV keeps all the others of its route."""


@inlined
def _leg(arrays: ProblemArrays, plan: FlownPlan, i: int, place: int, j: int) -> float:
    """Distance to a target from where a UAV is before its visit `place`."""
    at = visit.START if place == 0 else plan.visits.target[i, place - 1]
    return visit.leg(arrays, 0, i, at, j)


@inlined
def detour(arrays: ProblemArrays, plan: FlownPlan, i: int, place: int, j: int) -> float:
    """Distance to a target and on to the next one, more than there directly."""
    extra = _leg(arrays, plan, i, place, j)
    if place < plan.visits.length[i]:
        extra += visit.leg(arrays, 0, i, j, plan.visits.target[i, place]) - plan.leg[i, place]
    elif arrays.terms[0].charge_return:
        extra += visit.way_home(arrays, 0, i, j) - plan.back[i]
    return extra


@compiled
def lacking(arrays: ProblemArrays, plan: FlownPlan, i: int, place: int, j: int, lacks: Floats) -> int:
    """What a UAV lacks for one more visit, if it keeps all others.

    Parameters
    ----------
    arrays, plan
        The problem and its plan.
    i, place, j
        The visit.
    lacks
        Filled: 1 where a step is missing, range, and how long after the deadlines it and all later visits
        arrive.

    Returns
    -------
    int
        The sum of what is lacking, beyond the tolerance.
    """
    length, voyage = plan.visits.length[i], arrays.uavs[0, i].voyage
    lack = 0
    lacks[0] = 0.0
    if length >= arrays.max_steps[0]:
        lacks[0], lack = 1.0, STEP
    at = visit.START if place == 0 else plan.visits.target[i, place - 1]
    flown, clock, late = plan.flown[i, place], plan.clock[i, place], False
    lacks[1] = -np.inf
    for s in range(place - 1, length):
        x = j if s < place else plan.visits.target[i, s]
        leg = visit.leg(arrays, 0, i, at, x)
        time = visit.leg_time(arrays, 0, i, at, x, leg)
        flown += visit.air_length(arrays, 0, i, leg, time)
        lacks[1] = max(lacks[1], visit.flown_with_return(arrays, 0, i, x, flown) - voyage)
        arrival = clock + time
        if visit.is_base(arrays, x):
            flown, lacks[3 + s - place] = 0.0, 0.0
        else:
            lacks[3 + s - place] = arrival - arrays.areas[0, x].deadline
            late = late or visit.is_late(arrival, arrays.areas[0, x].deadline)
        clock, at = visit.departure_after(arrays, 0, x, arrival), x
    if voyage + lacks[1] > visit.farthest(voyage):
        lack += RANGE
    return lack + TIME if late else lack
