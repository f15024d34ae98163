"""What a visit earns, and what is lost (rule 5 of section 3, and section 10): the only place that knows it.

The simulator, the searches, bounds, explanations and the learners ask here. As in
:mod:`app.simulation.visit`, functions are compiled as a part of their callers, `p` is a problem of the stack,
`j` a target and `k` a material.
"""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import Floats, ProblemArrays
from app.simulation.decorators import inlined


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


def satisfaction_of(arrays: ProblemArrays, met: Floats) -> float:
    """Return what amounts (N, K) of the needs earn, whenever they are delivered, where nothing decays."""
    first = np.maximum(0.0, arrays.need[0] - arrays.beyond[0])
    counted = met + float(arrays.terms["bonus"][0]) * np.minimum(met, first)
    return float((arrays.areas["unit"][0][:, None] * counted).sum())
