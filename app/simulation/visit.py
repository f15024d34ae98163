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
from app.simulation.arrays import Flags, Floats, ProblemArrays
from app.simulation.compilation import njit

Function = TypeVar("Function", bound=Callable[..., Any])

_INLINED: dict[str, Any] = {"inline": "always", "cache": True, "error_model": "numpy", "_nrt": False}
inlined: Callable[[Function], Function] = njit(**_INLINED)
"""For small functions, and those with one caller: they are compiled as a part of their callers.

Whatever is compiled by itself takes long where all the arrays of a plan are its arguments, and once more in
each of its callers. Functions that are not inlined take only the arrays that they need.
"""

START = -1
"""Value of ``at`` for a UAV that is still where the request has it."""

ALLOWED = 0
RETURNING = 1
OUT_OF_RANGE = 2
TOO_LATE = 3
UNLOADS_NOTHING = 4
NO_SUCH_ACTION = 5
TOO_MANY_STEPS = 6
TOO_MUCH = 7

RULES = {
    RETURNING: "a returning UAV gets no more targets",
    OUT_OF_RANGE: "the visit, and the way home where it is required, exceed the voyage",
    TOO_LATE: "it arrives after the deadline",
    UNLOADS_NOTHING: "it would unload nothing",
    NO_SUCH_ACTION: "there is no such action",
    TOO_MANY_STEPS: "the plan has more rows than max_steps",
    TOO_MUCH: "it would unload more than the UAV carries or the area needs",
}
"""Rules that an action can break, in words."""


@inlined
def leg(arrays: ProblemArrays, p: int, i: int, at: int, j: int) -> float:
    """Distance to a target (rule 1)."""
    return arrays.start_target[p, i, j] if at == START else arrays.between[p, at, j]


@inlined
def way_home(arrays: ProblemArrays, p: int, i: int, at: int) -> float:
    """Distance to the UAV's starting point."""
    if at == START:
        distance = arrays.start_home[p, i]
    elif at == arrays.level.shape[1]:
        distance = 0.0
    else:
        distance = arrays.home[p, i, at]
    return distance


@inlined
def flown_with_return(arrays: ProblemArrays, p: int, i: int, j: int, flown: float) -> float:
    """Distance that has to be in range for a visit: that flown on arrival, and the way home if required."""
    return flown + arrays.home[p, i, j] if arrays.return_to_base[p] else flown


@inlined
def is_out_of_range(arrays: ProblemArrays, p: int, i: int, j: int, flown: float) -> bool:
    """Whether a visit exceeds the range (rule 2), by the distance flown on arrival."""
    return flown_with_return(arrays, p, i, j, flown) > farthest(arrays.voyage[p, i])


@inlined
def is_late(arrival: float, deadline: float) -> bool:
    """Whether an arrival is after a deadline (rule 2)."""
    return arrival > latest(deadline)


@inlined
def farthest(voyage: float, tolerance: float = TOLERANCE) -> float:
    """Distance that a range allows, with a tolerance: that of rule 2, or a relaxation's."""
    return voyage * (1.0 + tolerance)


@inlined
def latest(deadline: float, tolerance: float = TOLERANCE) -> float:
    """Time at which a deadline allows to arrive, with a tolerance: that of rule 2, or a relaxation's."""
    return deadline + abs(deadline) * tolerance


@inlined
def arrival_after(arrays: ProblemArrays, p: int, i: int, clock: float, distance: float) -> float:
    """Time at which a UAV arrives that sets out now (rule 1)."""
    return clock + distance / arrays.speed[p, i]


@inlined
def departure_after(arrays: ProblemArrays, p: int, j: int, arrival: float) -> float:
    """Time at which a visit has ended (rule 3)."""
    return arrival + arrays.service[p, j]


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
    """Satisfaction that an amount unloaded at a target brings (rule 5); its need is not nothing."""
    return arrays.level[p, j] * amount / arrays.need_total[p, j]


@inlined
def cost_of(arrays: ProblemArrays, p: int, distance: float) -> float:
    """Reward that a distance costs (rule 5)."""
    return arrays.weight[p] * distance


def worths(arrays: ProblemArrays) -> Floats:
    """Return what a unit of material earns at each target of a problem, (N,); 0 where none is needed."""
    needed = arrays.need_total[0] > 0
    return np.where(needed, arrays.level[0], 0.0) / np.where(needed, arrays.need_total[0], 1.0)


def limits(arrays: ProblemArrays, tolerance: float = TOLERANCE) -> tuple[Floats, Floats]:
    """Return ranges (M,) and deadlines (N,) of the first problem with a tolerance."""
    return (
        arrays.voyage[0] * (1.0 + tolerance),
        arrays.deadline[0] + np.abs(arrays.deadline[0]) * tolerance,
    )


def first_visits(arrays: ProblemArrays, tolerance: float = TOLERANCE) -> Flags:
    """Return which UAV of a problem can be at which target in range and in time if it flies there first.

    Whatever it unloads. No way there is shorter, so no other visit is allowed in any plan.

    Returns
    -------
    Flags
        (M, N).
    """
    leg_to = arrays.start_target[0]
    flown = arrays.dis[0][:, None] + leg_to
    if arrays.return_to_base[0]:
        flown = flown + arrays.home[0]
    ranges, deadlines = limits(arrays, tolerance)
    return (flown <= ranges[:, None]) & (leg_to / arrays.speed[0][:, None] <= deadlines)
