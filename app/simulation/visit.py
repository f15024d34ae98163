"""The rules of a visit and of a reload (sections 3 and 9 of the rules), and the only place that knows them.

What a leg is, whether an action is allowed and why not, when it ends, and what is left of loads, needs and
stocks; what a visit earns is in :mod:`app.simulation.worth`. The simulator, the searches, bounds,
explanations and the learners' observation ask here. The functions are compiled as a part of their callers, so
asking costs nothing.

Everywhere `p` is a problem of the stack, `i` a UAV, `j` a target or, as N + 1 + d, base d, and `at` where the
UAV is: ``START``, such a stop, or N where it has landed for good.
"""

from __future__ import annotations

import numpy as np

from app.domain.problem import ROUNDING, TOLERANCE
from app.simulation.arrays import NONE, Flags, Floats, ProblemArrays
from app.simulation.decorators import inlined
from app.simulation.legs import UNREACHABLE

START = -1
"""Value of ``at`` for a UAV that is still where the request has it."""

FREE = -1
"""In place of a number of visits: the UAV has made none, and its commitments do not count."""

ALLOWED = 0
RETURNING = 1
OUT_OF_RANGE = 2
TOO_LATE = 3
UNLOADS_NOTHING = 4
NO_SUCH_ACTION = 5
TOO_MANY_STEPS = 6
TOO_MUCH = 7
BARRED = 8
COMMITTED_ELSEWHERE = 9
TOO_LONG_ALOFT = 10
HOME_TOO_LATE = 11
RELOADED = 12
NOT_IN_STOCK = 13
TOO_HEAVY = 14

RULES = {
    RETURNING: "a returning UAV gets no more targets",
    OUT_OF_RANGE: "the visit, and the way home where it is required, exceed the voyage",
    TOO_LATE: "it arrives after the deadline",
    UNLOADS_NOTHING: "it would unload nothing",
    NO_SUCH_ACTION: "there is no such action",
    TOO_MANY_STEPS: "the plan has more rows than max_steps",
    TOO_MUCH: "it would unload more than the UAV carries or the area needs",
    BARRED: "no way leads there, or home from there, or the UAV lacks a skill or may not be sent there",
    COMMITTED_ELSEWHERE: "another visit that the UAV is committed to comes first",
    TOO_LONG_ALOFT: "the visit, and the way home where it is required, exceed the endurance",
    HOME_TOO_LATE: "it would land after available_until",
    RELOADED: "it has just reloaded",
    NOT_IN_STOCK: "it would take more than the base has in stock",
    TOO_HEAVY: "with that load it exceeds its capacity",
}
"""Rules that an action can break, in words."""


@inlined
def is_base(arrays: ProblemArrays, j: int) -> bool:
    """Whether a stop is a base."""
    return j > arrays.need.shape[1]


@inlined
def is_unlimited(arrays: ProblemArrays, j: int) -> bool:
    """Whether a stop of the first problem is a base with as much as is asked for."""
    return is_base(arrays, j) and arrays.stock[0, j - arrays.need.shape[1] - 1, 0] == np.inf


@inlined
def leg(arrays: ProblemArrays, p: int, i: int, at: int, j: int) -> float:
    """Length of the leg to a stop, over ground (rule 1)."""
    return (
        arrays.start_target[p, i, j] if at == START else arrays.between[p, arrays.uavs[p, i].leg_class, at, j]
    )


@inlined
def leg_time(arrays: ProblemArrays, p: int, i: int, at: int, j: int, length: float) -> float:
    """Time of the leg to a stop, whose length is known (rule 1)."""
    if not arrays.terms[p].timed:
        time = length / arrays.uavs[p, i].speed
    elif at == START:
        time = arrays.start_time[p, i, j]
    else:
        time = arrays.between_time[p, arrays.uavs[p, i].leg_class, at, j]
    return time


@inlined
def air_length(arrays: ProblemArrays, p: int, i: int, length: float, time: float) -> float:
    """Length of a leg in the air, which is what range counts (rule 1)."""
    in_wind = arrays.terms[p].in_wind and length < UNREACHABLE
    return time * arrays.uavs[p, i].speed if in_wind else length


@inlined
def way_home(arrays: ProblemArrays, p: int, i: int, at: int) -> float:
    """Length of the leg to where the UAV lands; 0 where there is none."""
    if at == START:
        distance = arrays.uavs[p, i].start_home
    elif at == arrays.need.shape[1]:
        distance = 0.0
    else:
        distance = arrays.home[p, i, at]
    return distance


@inlined
def time_home(arrays: ProblemArrays, p: int, i: int, at: int) -> float:
    """Time until the UAV has landed, by the leg to where it lands, if it must return."""
    if not arrays.terms[p].return_to_base or at == arrays.need.shape[1]:
        time = 0.0
    elif not arrays.terms[p].timed:
        time = way_home(arrays, p, i, at) / arrays.uavs[p, i].speed
    elif at == START:
        time = arrays.uavs[p, i].start_home_time
    else:
        time = arrays.home_time[p, i, at]
    return time


@inlined
def ready(arrays: ProblemArrays, p: int, i: int) -> float:
    """Clock of a UAV at the start."""
    return arrays.uavs[p, i].ready


@inlined
def airborne(arrays: ProblemArrays, p: int, i: int) -> float:
    """Time that a UAV has been in the air at the start."""
    return arrays.uavs[p, i].airborne


@inlined
def flown_with_return(arrays: ProblemArrays, p: int, i: int, j: int, flown: float) -> float:
    """Air length that has to be in range for a visit: that flown on arrival, and the way home if required."""
    return flown + arrays.kept_range[p, i, j]


@inlined
def is_barred(arrays: ProblemArrays, p: int, i: int, at: int, j: int) -> bool:
    """Whether a UAV must not, or cannot, fly from where it is to a target, whatever it has left."""
    return arrays.kept_range[p, i, j] >= UNREACHABLE or leg(arrays, p, i, at, j) >= UNREACHABLE


@inlined
def is_out_of_range(arrays: ProblemArrays, p: int, i: int, j: int, flown: float) -> bool:
    """Whether a visit exceeds the range (rule 2), by the air length flown on arrival."""
    return flown_with_return(arrays, p, i, j, flown) > farthest(arrays.uavs[p, i].voyage)


@inlined
def is_late(arrival: float, deadline: float) -> bool:
    """Whether an arrival is after a deadline (rule 2)."""
    return arrival > latest(deadline)


@inlined
def is_watched(arrays: ProblemArrays, p: int, i: int) -> bool:
    """Whether a UAV has an endurance, or a time to have landed by: only then its time in the air counts."""
    return arrays.uavs[p, i].watched


@inlined
def aloft_after(
    arrays: ProblemArrays,
    p: int,
    i: int,
    at: int,
    aloft: float,
    clock: float,
    arrival: float,
    end: float,
    j: int,
) -> float:
    """Time in the air at the end of a visit, or on arrival at a base (rule 3).

    A flight that begins with a visit waits on the ground.

    Parameters
    ----------
    arrays, p, i, at
        As everywhere; `at` is where it sets out.
    aloft, clock
        Time in the air, and clock, when the UAV sets out.
    arrival, end
        When it arrives, and when the visit has ended.
    j
        The target, or base.
    """
    if is_base(arrays, j):
        time = aloft + (arrival - clock)
    else:
        time = aloft + (end - clock)
        if is_base(arrays, at) or (at == START and arrays.uavs[p, i].on_ground):
            time -= max(0.0, arrays.areas[p, j].earliest - arrival)
    return time


@inlined
def exceeds_endurance(arrays: ProblemArrays, p: int, i: int, j: int, aloft: float) -> bool:
    """Whether a stop exceeds the endurance (rule 2), by :func:`aloft_after`."""
    home = 0.0 if is_base(arrays, j) else time_home(arrays, p, i, j)
    return aloft + home > farthest(arrays.uavs[p, i].endurance)


@inlined
def lands_late(arrays: ProblemArrays, p: int, i: int, j: int, end: float) -> bool:
    """Whether a UAV would land after ``available_until`` (rule 2), by the clock at the end of a stop."""
    home = 0.0 if is_base(arrays, j) else time_home(arrays, p, i, j)
    return end + home > latest(arrays.uavs[p, i].until)


@inlined
def is_committed_elsewhere(arrays: ProblemArrays, p: int, i: int, visits: int, j: int) -> bool:
    """Whether another visit comes first that a UAV is committed to (rule 2), after some visits made."""
    elsewhere = False
    if visits < arrays.committed.shape[2]:
        elsewhere = arrays.committed[p, i, visits] != NONE and arrays.committed[p, i, visits] != j
    return elsewhere


@inlined
def farthest(voyage: float, tolerance: float = TOLERANCE) -> float:
    """Distance or time that a range or an endurance allows, with a tolerance: rule 2's, or a relaxation's."""
    return voyage * (1.0 + tolerance)


@inlined
def latest(deadline: float, tolerance: float = TOLERANCE) -> float:
    """Time at which a deadline allows to arrive, with a tolerance: that of rule 2, or a relaxation's."""
    return deadline + abs(deadline) * tolerance


@inlined
def begin_after(arrays: ProblemArrays, p: int, j: int, arrival: float) -> float:
    """Time at which a visit begins: who arrives before its earliest time waits (rule 1)."""
    return max(arrival, arrays.areas[p, j].earliest)


@inlined
def departure_after(arrays: ProblemArrays, p: int, j: int, arrival: float) -> float:
    """Time at which a visit, or the turnaround at a base, has ended (rule 3)."""
    if is_base(arrays, j):
        end = arrival + arrays.bases[p, j - arrays.need.shape[1] - 1].turnaround
    else:
        end = begin_after(arrays, p, j, arrival) + arrays.areas[p, j].service
    return end


@inlined
def can_unload(load: float, need: float) -> bool:
    """Whether a visit can unload some of a material, by what is carried and what is needed."""
    return load > 0.0 and need > 0.0


@inlined
def left_of(amount: float, taken: float, whole: float) -> float:
    """What is left of a load or need after some of it was taken; rounding of the whole is nothing (rule 4).

    Parameters
    ----------
    amount, taken
        What there was, and what is taken from it.
    whole
        What the amount is a part of: :func:`most_carried`, or what was requested.
    """
    left = amount - taken
    return left if left >= ROUNDING * whole else 0.0


@inlined
def most_carried(arrays: ProblemArrays, p: int, i: int, k: int) -> float:
    """Most of a material that a UAV carries: at first, or when it leaves a base."""
    return max(arrays.load[p, i, k], arrays.full[p, i, k])


@inlined
def most_ever(arrays: ProblemArrays, p: int, i: int, k: int) -> float:
    """Most of a material that a UAV may carry: at first, or after reloads at bases that it may use."""
    in_stock = 0.0
    for d in range(arrays.stock.shape[1]):
        if arrays.kept_range[p, i, arrays.need.shape[1] + 1 + d] < UNREACHABLE:
            in_stock += arrays.stock[p, d, k]
    load = arrays.load[p, i, k]
    return max(load, min(arrays.full[p, i, k], load + in_stock))


@inlined
def loaded_of(load: float, full: float, stock: float) -> float:
    """What a reload takes of a material, with what is aboard, what it leaves with, and what is in stock."""
    return max(0.0, min(full - load, stock))


@inlined
def reach_rule(
    arrays: ProblemArrays,
    p: int,
    i: int,
    at: int,
    j: int,
    visits: int,
    flown: float,
    clock: float,
    aloft: float,
) -> int:
    """All of rule 2 but whether something is unloaded: ``ALLOWED``, or the rule that forbids a stop.

    Parameters
    ----------
    arrays, p, i, at, j
        As everywhere.
    visits
        How many stops the UAV has made, all of which are visits as long as it is committed to some;
        ``FREE`` before the first, whatever it is committed to.
    flown, clock, aloft
        Air length, clock, and time in the air when it sets out.
    """
    length = leg(arrays, p, i, at, j)
    time = leg_time(arrays, p, i, at, j, length)
    rule = ALLOWED
    if is_out_of_range(arrays, p, i, j, flown + air_length(arrays, p, i, length, time)):
        rule = BARRED if is_barred(arrays, p, i, at, j) else OUT_OF_RANGE
    elif not is_base(arrays, j) and is_late(clock + time, arrays.areas[p, j].deadline):
        rule = TOO_LATE
    elif visits != FREE and is_committed_elsewhere(arrays, p, i, visits, j):
        rule = COMMITTED_ELSEWHERE
    elif is_base(arrays, j) and is_base(arrays, at):
        rule = RELOADED
    elif is_watched(arrays, p, i):
        end = departure_after(arrays, p, j, clock + time)
        in_air = aloft_after(arrays, p, i, at, aloft, clock, clock + time, end, j)
        if exceeds_endurance(arrays, p, i, j, in_air):
            rule = TOO_LONG_ALOFT
        elif lands_late(arrays, p, i, j, end):
            rule = HOME_TOO_LATE
    return rule


def limits(arrays: ProblemArrays, tolerance: float = TOLERANCE) -> tuple[Floats, Floats]:
    """Return ranges (M,) and deadlines (N,) of the first problem with a tolerance."""
    return (
        arrays.uavs["voyage"][0] * (1.0 + tolerance),
        arrays.areas["deadline"][0] + np.abs(arrays.areas["deadline"][0]) * tolerance,
    )


def first_visits(arrays: ProblemArrays, tolerance: float = TOLERANCE) -> Flags:
    """Return which UAV of a problem can be at which target in range and in time if it flies there first.

    Whatever it unloads. No way there is shorter, so no other visit is allowed in any plan. Where a way over
    a third place may be shorter, the least that it could be counts; where it may reload on the way, whatever
    is not barred.

    Returns
    -------
    Flags
        (M, N).
    """
    if arrays.n_bases:
        return np.asarray(arrays.kept_range[0, :, : arrays.shape[1]] < UNREACHABLE)
    speed, timed = arrays.uavs["speed"][0][:, None], bool(arrays.terms["timed"][0])
    length = arrays.start_target[0]
    time = arrays.start_time[0] if timed else length / speed
    if not arrays.terms["metric"][0]:
        between, of = arrays.between[0], arrays.uavs["leg_class"][0]
        length = np.minimum(length, length.min(axis=1)[:, None] + between.min(axis=1)[of])
        over = arrays.between_time[0].min(axis=1)[of] if timed else between.min(axis=1)[of] / speed
        time = np.minimum(time, time.min(axis=1)[:, None] + over)
    flown = arrays.uavs["dis"][0][:, None] + (time * speed if arrays.terms["in_wind"][0] else length)
    ranges, deadlines = limits(arrays, tolerance)
    in_range = flown + arrays.kept_range[0] <= ranges[:, None]
    return in_range & (arrays.uavs["ready"][0][:, None] + time <= deadlines)
