"""What a UAV lacks for one more visit, if it keeps all the others of its route."""

from __future__ import annotations

from app.simulation import simulator, visit
from app.simulation.arrays import Floats, ProblemArrays
from app.simulation.flown_plan import FlownPlan
from app.simulation.visit import inlined

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
    elif arrays.charge_return[0]:
        extra += visit.way_home(arrays, 0, i, j) - plan.back[i]
    return extra


@simulator.compiled
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
    length, voyage = plan.visits.length[i], arrays.voyage[0, i]
    there, extra = _leg(arrays, plan, i, place, j), detour(arrays, plan, i, place, j)
    lack = 0
    lacks[0] = 0.0
    if length >= arrays.max_steps[0]:
        lacks[0], lack = 1.0, STEP
    lacks[1] = visit.flown_with_return(arrays, 0, i, j, plan.flown[i, place] + there) - voyage
    arrival = visit.arrival_after(arrays, 0, i, plan.clock[i, place], there)
    lacks[2] = arrival - arrays.deadline[0, j]
    late = visit.is_late(arrival, arrays.deadline[0, j])
    for s in range(place, length):
        x = plan.visits.target[i, s]
        reach = visit.flown_with_return(arrays, 0, i, x, plan.flown[i, s + 1] + extra)
        lacks[1] = max(lacks[1], reach - voyage)
        arrival = visit.departure_after(
            arrays, 0, j, visit.arrival_after(arrays, 0, i, plan.clock[i, s], plan.leg[i, s] + extra)
        )
        lacks[3 + s - place] = arrival - arrays.deadline[0, x]
        late = late or visit.is_late(arrival, arrays.deadline[0, x])
    if voyage + lacks[1] > visit.farthest(voyage):
        lack += RANGE
    return lack + TIME if late else lack
