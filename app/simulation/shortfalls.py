"""What a UAV lacks for one more visit, if it keeps all the others of its route."""

from __future__ import annotations

from app.simulation import simulator
from app.simulation.arrays import Floats, ProblemArrays
from app.simulation.flown_plan import FlownPlan
from app.simulation.insertion import inlined

STEP, RANGE, TIME = 1, 2, 4
"""What a visit lacks, as a sum, where the UAV keeps all the others of its route."""


@simulator.compiled
def is_late(arrival: float, deadline: float) -> bool:
    """Whether an arrival is after a deadline, beyond the tolerance."""
    return arrival > simulator.latest(deadline)


@inlined
def _leg(arrays: ProblemArrays, plan: FlownPlan, i: int, place: int, j: int) -> float:
    """Distance to a target from where a UAV is before its visit `place`."""
    at = simulator.START if place == 0 else plan.visits.target[i, place - 1]
    leg: float = arrays.start_target[0, i, j] if at == simulator.START else arrays.between[0, at, j]
    return leg


@inlined
def detour(arrays: ProblemArrays, plan: FlownPlan, i: int, place: int, j: int) -> float:
    """Distance to a target and on to the next one, more than there directly."""
    extra = _leg(arrays, plan, i, place, j)
    if place < plan.visits.length[i]:
        extra += arrays.between[0, j, plan.visits.target[i, place]] - plan.leg[i, place]
    elif arrays.charge_return[0]:
        extra += arrays.home[0, i, j] - plan.back[i]
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
    length, speed, voyage = plan.visits.length[i], arrays.speed[0, i], arrays.voyage[0, i]
    there, extra = _leg(arrays, plan, i, place, j), detour(arrays, plan, i, place, j)
    lack = 0
    lacks[0] = 0.0
    if length >= arrays.max_steps[0]:
        lacks[0], lack = 1.0, STEP
    reach = plan.flown[i, place] + there
    if arrays.return_to_base[0]:
        reach += arrays.home[0, i, j]
    lacks[1] = reach - voyage
    arrival = plan.clock[i, place] + there / speed
    lacks[2] = arrival - arrays.deadline[0, j]
    late = is_late(arrival, arrays.deadline[0, j])
    for s in range(place, length):
        x = plan.visits.target[i, s]
        reach = plan.flown[i, s + 1] + extra
        if arrays.return_to_base[0]:
            reach += arrays.home[0, i, x]
        lacks[1] = max(lacks[1], reach - voyage)
        arrival = plan.clock[i, s] + (plan.leg[i, s] + extra) / speed + arrays.service[0, j]
        lacks[3 + s - place] = arrival - arrays.deadline[0, x]
        late = late or is_late(arrival, arrays.deadline[0, x])
    if voyage + lacks[1] > simulator.farthest(voyage):
        lack += RANGE
    return lack + TIME if late else lack
