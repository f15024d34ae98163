"""The rules of a visit (section 3 of the specification), and the only place that knows them.

What a leg is, whether a visit is allowed and why not, when it ends, what is left of loads and needs, and what
it earns and costs. The simulator, the searches, bounds, explanations and the learners' observation ask here.
The functions are compiled as a part of their callers, so asking costs nothing.

Everywhere `p` is a problem of the stack, `i` a UAV, `j` a target, and `at` where the UAV is: ``START``, a
target, or N for its starting point.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from app.domain.problem import ROUNDING, TOLERANCE
from app.simulation.arrays import NONE, Flags, Floats, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.legs import UNREACHABLE

Function = TypeVar("Function", bound=Callable[..., Any])

_INLINED: dict[str, Any] = {"inline": "always", "cache": True, "error_model": "numpy", "_nrt": False}
inlined: Callable[[Function], Function] = njit(**_INLINED)
"""For small functions, and those with one caller: they are compiled as a part of their callers.

Whatever is compiled by itself takes long where all the arrays of a plan are its arguments, and once more in
each of its callers. Functions that are not inlined take only the arrays that they need.
"""

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

RULES = {
    RETURNING: "a returning UAV gets no more targets",
    OUT_OF_RANGE: "the visit, and the way home where it is required, exceed the voyage",
    TOO_LATE: "it arrives after the deadline",
    UNLOADS_NOTHING: "it would unload nothing",
    NO_SUCH_ACTION: "there is no such action",
    TOO_MANY_STEPS: "the plan has more rows than max_steps",
    TOO_MUCH: "it would unload more than the UAV carries or the area needs",
    BARRED: "no way leads there, or home from there, or the UAV lacks a skill or is excluded",
    COMMITTED_ELSEWHERE: "another visit that the UAV is committed to comes first",
    TOO_LONG_ALOFT: "the visit, and the way home where it is required, exceed the endurance",
    HOME_TOO_LATE: "it would land after available_until",
}
"""Rules that an action can break, in words."""


@inlined
def leg(arrays: ProblemArrays, p: int, i: int, at: int, j: int) -> float:
    """Length of the leg to a target, over ground (rule 1)."""
    return (
        arrays.start_target[p, i, j] if at == START else arrays.between[p, arrays.uavs[p, i].leg_class, at, j]
    )


@inlined
def leg_time(arrays: ProblemArrays, p: int, i: int, at: int, j: int, length: float) -> float:
    """Time of the leg to a target, whose length is known (rule 1)."""
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
    """Length of the leg to the UAV's starting point; 0 where there is none."""
    if at == START:
        distance = arrays.uavs[p, i].start_home
    elif at == arrays.need.shape[1]:
        distance = 0.0
    else:
        distance = arrays.home[p, i, at]
    return distance


@inlined
def time_home(arrays: ProblemArrays, p: int, i: int, at: int) -> float:
    """Time until the UAV has landed, by the leg to its starting point where it must return."""
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
    first: bool,
    aloft: float,
    clock: float,
    arrival: float,
    end: float,
    j: int,
) -> float:
    """Time in the air at the end of a visit (rule 3); a flight that begins with it waits on the ground.

    Parameters
    ----------
    arrays, p, i
        As everywhere.
    first
        Whether it is the UAV's first visit.
    aloft, clock
        Time in the air, and clock, when the UAV sets out.
    arrival, end
        When it arrives, and when the visit has ended.
    j
        The target.
    """
    time = aloft + (end - clock)
    if first and arrays.uavs[p, i].on_ground:
        time -= max(0.0, arrays.areas[p, j].earliest - arrival)
    return time


@inlined
def exceeds_endurance(arrays: ProblemArrays, p: int, i: int, j: int, aloft: float) -> bool:
    """Whether a visit exceeds the endurance (rule 2), by the time in the air at its end."""
    return aloft + time_home(arrays, p, i, j) > farthest(arrays.uavs[p, i].endurance)


@inlined
def lands_late(arrays: ProblemArrays, p: int, i: int, j: int, end: float) -> bool:
    """Whether a UAV would land after ``available_until`` (rule 2), by the clock at the end of a visit."""
    return end + time_home(arrays, p, i, j) > latest(arrays.uavs[p, i].until)


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
    """Time at which a visit has ended (rule 3)."""
    return begin_after(arrays, p, j, arrival) + arrays.areas[p, j].service


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
        What the amount is a part of: the first load, or what was requested.
    """
    left = amount - taken
    return left if left >= ROUNDING * whole else 0.0


@inlined
def earned_by(arrays: ProblemArrays, p: int, j: int, amount: float) -> float:
    """Satisfaction that an amount unloaded at a target brings (rule 5), all of it beyond the first share.

    Its need is not nothing. To it comes :func:`bonus_of`, material by material, and time takes some of both
    (:func:`discount`).
    """
    if arrays.terms[p].bonus == 0.0:
        earned = arrays.areas[p, j].level * amount / arrays.areas[p, j].need_total
    else:
        earned = arrays.areas[p, j].unit * amount
    return earned


@inlined
def bonus_of(arrays: ProblemArrays, p: int, j: int, k: int, need: float, amount: float) -> float:
    """What an amount of a material earns above :func:`earned_by`, as far as it is of the first share."""
    first = min(amount, max(0.0, need - arrays.beyond[p, j, k]))
    return arrays.terms[p].bonus * arrays.areas[p, j].unit * first


@inlined
def most_earned_by(arrays: ProblemArrays, p: int, j: int, amount: float) -> float:
    """Satisfaction that an amount unloaded at a target brings at most, at whatever time."""
    return earned_by(arrays, p, j, amount) * (1.0 + arrays.terms[p].bonus)


@inlined
def has_bonus(arrays: ProblemArrays, p: int) -> bool:
    """Whether the first share of a need earns more than the rest."""
    return arrays.terms[p].bonus != 0.0


@inlined
def decays(arrays: ProblemArrays, p: int) -> bool:
    """Whether what a delivery earns falls with time."""
    return arrays.terms[p].decay != 0.0


@inlined
def discount(arrays: ProblemArrays, p: int, begin: float) -> float:
    """Share that is left of what a delivery earns at a time (rule 5)."""
    return 2.0 ** (-begin * arrays.terms[p].decay) if decays(arrays, p) else 1.0


@inlined
def cost_of(arrays: ProblemArrays, p: int, distance: float) -> float:
    """Reward that a distance costs (rule 5)."""
    return arrays.terms[p].weight * distance


@inlined
def has_closing_cost(arrays: ProblemArrays, p: int) -> bool:
    """Whether reward is lost for what is known at the end alone: the makespan, and changes."""
    return arrays.terms[p].makespan != 0.0 or arrays.terms[p].change != 0.0


@inlined
def closing_cost(arrays: ProblemArrays, p: int, makespan: float, changes: float) -> float:
    """Reward lost for the makespan and for changes (section 10)."""
    return arrays.terms[p].makespan * makespan + arrays.terms[p].change * changes


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
    """All of rule 2 but whether something is unloaded: ``ALLOWED``, or the rule that forbids a visit.

    Parameters
    ----------
    arrays, p, i, at, j
        As everywhere.
    visits
        How many visits the UAV has made; ``FREE`` before the first, whatever it is committed to.
    flown, clock, aloft
        Air length, clock, and time in the air when it sets out.
    """
    length = leg(arrays, p, i, at, j)
    time = leg_time(arrays, p, i, at, j, length)
    rule = ALLOWED
    if is_out_of_range(arrays, p, i, j, flown + air_length(arrays, p, i, length, time)):
        rule = BARRED if is_barred(arrays, p, i, at, j) else OUT_OF_RANGE
    elif is_late(clock + time, arrays.areas[p, j].deadline):
        rule = TOO_LATE
    elif visits != FREE and is_committed_elsewhere(arrays, p, i, visits, j):
        rule = COMMITTED_ELSEWHERE
    elif is_watched(arrays, p, i):
        end = departure_after(arrays, p, j, clock + time)
        in_air = aloft_after(arrays, p, i, visits <= 0, aloft, clock, clock + time, end, j)
        if exceeds_endurance(arrays, p, i, j, in_air):
            rule = TOO_LONG_ALOFT
        elif lands_late(arrays, p, i, j, end):
            rule = HOME_TOO_LATE
    return rule


def worths(arrays: ProblemArrays) -> Floats:
    """Return what a unit of material earns at most at each target, (N,); 0 where none is needed."""
    needed = arrays.areas["need_total"][0] > 0
    if arrays.terms["bonus"][0] != 0.0:
        first = (arrays.need[0] > arrays.beyond[0]).any(axis=1)
        return np.where(needed, arrays.areas["unit"][0] * (1.0 + arrays.terms["bonus"][0] * first), 0.0)
    return np.where(needed, arrays.areas["level"][0], 0.0) / np.where(
        needed, arrays.areas["need_total"][0], 1.0
    )


def worth_by_material(arrays: ProblemArrays) -> Floats:
    """Return what the need of each material earns at most where the first share earns more, (N, K).

    That is as if all of a need were of the first share, as long as any of it is: any part of the need earns
    at most that part of it.
    """
    need = arrays.need[0]
    first = np.where(need > arrays.beyond[0], 1.0 + arrays.terms["bonus"][0], 1.0)
    return arrays.areas["unit"][0][:, None] * need * first


def limits(arrays: ProblemArrays, tolerance: float = TOLERANCE) -> tuple[Floats, Floats]:
    """Return ranges (M,) and deadlines (N,) of the first problem with a tolerance."""
    return (
        arrays.uavs["voyage"][0] * (1.0 + tolerance),
        arrays.areas["deadline"][0] + np.abs(arrays.areas["deadline"][0]) * tolerance,
    )


def first_visits(arrays: ProblemArrays, tolerance: float = TOLERANCE) -> Flags:
    """Return which UAV of a problem can be at which target in range and in time if it flies there first.

    Whatever it unloads. No way there is shorter, so no other visit is allowed in any plan. Where a way over
    a third place may be shorter, the least that it could be counts.

    Returns
    -------
    Flags
        (M, N).
    """
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
