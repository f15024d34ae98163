"""What a plan would earn with one more visit in a problem that is a little easier."""

from __future__ import annotations

from decimal import ROUND_CEILING, Context, Decimal
from typing import NamedTuple

import numpy as np

from app.domain.allocation import LaterDeadline, Relaxation
from app.domain.problem import Problem
from app.simulation.arrays import ProblemArrays
from app.simulation.flown_plan import FlownPlan
from app.simulation.insertion import HELPS, MADE, Trial, gain_of_visit
from app.simulation.planned_insertion import PlannedTrial, gain_of_planned_visit

NO_VISIT = -1
"""In place of a place in a route: nothing is inserted."""

_DIGITS = Context(prec=6, rounding=ROUND_CEILING)


class Outcome(NamedTuple):
    """The plan with one more visit.

    Attributes
    ----------
    gain
        Change of the reward.
    helps
        Whether the visit is legal, and the visited target gets more than before.
    """

    gain: float
    helps: bool


class Counterfactuals:
    """Flies a plan with one more visit.

    Parameters
    ----------
    problem, arrays
        The problem, and the same as a stack of one; they are not changed.
    plan, trial, planned
        Its plan, and scratch space for it; `planned` is None where unloading is greedy.
    """

    def __init__(
        self,
        problem: Problem,
        arrays: ProblemArrays,
        plan: FlownPlan,
        trial: Trial,
        planned: PlannedTrial | None,
    ) -> None:
        self._index = {target.id: j for j, target in enumerate(problem.targets)}
        self._given, self._plan, self._trial, self._planned = arrays, plan, trial, planned
        # Copies of what a relaxation may change.
        self._arrays = arrays._replace(
            uavs=arrays.uavs.copy(),
            areas=arrays.areas.copy(),
            load=arrays.load.copy(),
            max_steps=arrays.max_steps.copy(),
        )

    def visit(self, i: int, place: int, j: int, relaxation: Relaxation | None = None) -> Outcome:
        """Fly the plan with target `j` as visit `place` of UAV `i`, or NO_VISIT, in an easier problem."""
        given, arrays = self._given, self._arrays
        reloaded = relaxation is not None and any(relaxation.more_load)
        if relaxation is not None:
            arrays.load[0, i] += relaxation.more_load
            arrays.uavs["voyage"][0, i] += relaxation.more_range
            arrays.max_steps[0] += relaxation.more_steps
            for later in relaxation.later_deadlines:
                arrays.areas["deadline"][0, self._index[later.target_id]] += later.by
        outcome = self._fly(i, place, j, reloaded)
        if relaxation is not None:
            arrays.load[0, i] = given.load[0, i]
            arrays.uavs["voyage"][0, i] = given.uavs["voyage"][0, i]
            arrays.max_steps[0] = given.max_steps[0]
            for later in relaxation.later_deadlines:
                x = self._index[later.target_id]
                arrays.areas["deadline"][0, x] = given.areas["deadline"][0, x]
        return outcome

    def _fly(self, i: int, place: int, j: int, reloaded: bool) -> Outcome:
        arrays, plan, trial = self._arrays, self._plan, self._trial
        if self._planned is None:
            gain = float(gain_of_visit(arrays, plan, trial, i, place, j, reloaded))
        else:
            gain = float(gain_of_planned_visit(arrays, plan, trial, self._planned, i, place, j, True))
        made = place == NO_VISIT or bool(trial.tally[MADE])
        return Outcome(gain, made and bool(trial.tally[HELPS]))


def relaxation_for(
    problem: Problem,
    more_load: np.ndarray | None = None,
    more_range: float = 0.0,
    more_steps: int = 0,
    late: dict[int, float] | None = None,
) -> Relaxation:
    """Make a relaxation with figures of six digits, rounded up, so that they suffice as they are printed."""
    load = (0.0,) * problem.n_materials if more_load is None else tuple(rounded_up(x) for x in more_load)
    return Relaxation(
        load,
        rounded_up(more_range),
        more_steps,
        tuple(LaterDeadline(problem.targets[x].id, rounded_up(by)) for x, by in (late or {}).items()),
    )


def rounded_up(amount: float) -> float:
    """The least number of six digits that is not below an amount, apart from the rounding of the amount."""
    amount = float(amount)
    if not amount > 0.0:
        return 0.0
    nearest = float(f"{amount:.6g}")
    return nearest if nearest >= amount * (1 - 1e-12) else float(_DIGITS.create_decimal(Decimal(amount)))
