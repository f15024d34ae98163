"""What one more visit adds to a plan with planned amounts and reloads, where all others keep their amounts.

Each place in the route of each UAV is looked at. The visit unloads what is left over: what stays aboard
until the end and, where loading is planned too, what the UAV could have taken besides at the base before it.
Keeping all other amounts, it adds at least that much to the plan; amounts worked out anew could add more.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.domain.allocation import Relaxation
from app.simulation import simulator, visit, worth
from app.simulation.amounts import Amounts, stops_in_order
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.counterfactual import Outcome
from app.simulation.decorators import compiled, inlined
from app.simulation.flown_plan import FlownPlan
from app.simulation.from_start import Start
from app.simulation.insertion import (
    MADE,
    WORK,
    Trial,
    begin,
    change_uav,
    charge,
    closing_cost_of,
    exchange,
    gain,
    new_trial,
    take_up,
)
from app.simulation.openings import AS_IS, Places, no_places

_NO_STEPS = 0
"""In place of a rule: no step is left."""

_WORK = 2_000_000
"""Stops flown for all areas of an answer."""


class SpareLookout:
    """Looks at every place for one more visit, for one target after the other, as long as there is time.

    It is both a :class:`~app.simulation.openings.Lookout` and a
    :class:`~app.simulation.counterfactual.Counterfactuals`, of the problem as it is alone.

    Parameters
    ----------
    arrays
        A stack of one problem.
    plan, actions, amounts
        Its plan, flown; the same as joint actions, and what they unload and load.
    hurry
        Once it is true, no more is looked at.
    """

    def __init__(
        self,
        arrays: ProblemArrays,
        plan: FlownPlan,
        actions: Integers,
        amounts: Amounts,
        hurry: Callable[[], bool],
    ) -> None:
        self._arrays, self._plan, self._hurry = arrays, plan, hurry
        self.trial = new_trial(arrays, plan)
        self._stock = _least_stock(arrays, actions, amounts)
        self._unloaded, self._rule = np.zeros(arrays.shape[2]), np.zeros(1, np.int64)

    @property
    def spent(self) -> bool:
        """Whether this answer has had its share of looking, however much time there is."""
        return int(self.trial.tally[WORK]) >= _WORK

    def look(self, j: int, _start: Start) -> Places | None:
        """Look at all places for a visit to target `j`; None if that cannot be finished."""
        if self.spent or self._hurry():
            return None
        found = no_places()
        _look(self._arrays, self._plan, self.trial, self._stock, self._unloaded, j, found, self._rule)
        found.uav[0], found.place[0], found.gain[0] = found.uav[AS_IS], found.place[AS_IS], found.gain[AS_IS]
        return found

    def visit(self, i: int, place: int, j: int, relaxation: Relaxation | None = None) -> Outcome:
        """Fly the plan with target `j` as visit `place` of UAV `i`; nothing is known of easier problems."""
        if relaxation is not None or place < 0:
            return Outcome(0.0, False)
        plan, trial = self._plan, self.trial
        _take_spare(self._arrays, plan, self._stock, i, place, j, self._unloaded)
        change = float(_gain_of(self._arrays, plan, trial, self._unloaded, i, place, j, self._rule))
        return Outcome(change, bool(trial.tally[MADE]))


def _least_stock(arrays: ProblemArrays, actions: Integers, amounts: Amounts) -> Floats:
    """Return the least that there is at each base after any stop, (D, K): what could be taken besides."""
    stock = arrays.stock[0].copy()
    least, n = stock.copy(), arrays.shape[1]
    for s, i, j in stops_in_order(actions, n):
        if j > n:
            stock[j - n - 1] -= amounts.loaded[s, i]
            least[j - n - 1] = np.minimum(least[j - n - 1], stock[j - n - 1])
    return np.asarray(np.maximum(least, 0.0))


@compiled
def _look(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, stock: Floats, unloaded: Floats, j: int,
    found: Places, rule: Integers,
) -> None:  # fmt: skip
    """Keep the best visit that is legal, and the first rule that forbids one."""
    for i in range(plan.back.shape[0]):
        if arrays.ret[0, i]:
            continue
        for place in range(plan.visits.length[i] + 1):
            _take_spare(arrays, plan, stock, i, place, j, unloaded)
            any_spare = False
            for k in range(unloaded.shape[0]):
                any_spare = any_spare or unloaded[k] > 0.0
            if not any_spare:
                continue
            found.left_over[0] = 1
            change = _gain_of(arrays, plan, trial, unloaded, i, place, j, rule)
            if trial.tally[MADE] == 0:
                if found.blocked[0] == NONE and rule[0] != _NO_STEPS:
                    found.blocked[0], found.blocked[1], found.blocked[2] = i, place, rule[0]
            elif found.uav[AS_IS] == NONE or change > found.gain[AS_IS]:
                found.uav[AS_IS], found.place[AS_IS], found.gain[AS_IS] = i, place, change


@inlined
def _take_spare(
    arrays: ProblemArrays, plan: FlownPlan, stock: Floats, i: int, place: int, j: int, unloaded: Floats
) -> None:
    """Fill in what a visit could unload at its target while all others keep their amounts."""
    length, home, loading = plan.visits.length[i], arrays.need.shape[1], arrays.terms[0].plans_loading
    reload, end = NONE, length
    for s in range(length - 1, -1, -1):
        if plan.visits.target[i, s] > home:
            if s < place and reload == NONE:
                reload = s
            elif s >= place and not loading:
                # Where a reload fills up what is taken before it, from a stock that others need, nothing is.
                end = s if visit.is_unlimited(arrays, plan.visits.target[i, s]) else NONE
    room = 0.0
    if loading and reload != NONE:
        room = arrays.uavs[0, i].capacity
        for k in range(unloaded.shape[0]):
            room -= arrays.weights[0, k] * plan.load[i, reload + 1, k]
        room = max(0.0, room)
    for k in range(unloaded.shape[0]):
        spare = 0.0
        if end != NONE:
            spare = plan.load[i, place, k]
            for s in range(place, end + 1):
                spare = min(spare, plan.load[i, s, k])
        if room > 0.0 and spare < plan.remaining[j, k]:
            weight = arrays.weights[0, k]
            more = min(plan.remaining[j, k] - spare, stock[plan.visits.target[i, reload] - home - 1, k])
            if weight > 0.0:
                more = min(more, room / weight)
                room -= more * weight
            spare += more
        unloaded[k] = min(spare, plan.remaining[j, k])


@compiled
def _gain_of(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, unloaded: Floats, i: int, place: int, j: int,
    rule: Integers,
) -> float:  # fmt: skip
    """Change of the reward with a visit; `rule` says why it is not legal where ``tally[MADE]`` is 0."""
    length, episodes, total = plan.visits.length[i], trial.episodes, trial.total
    begin(trial, i, place, j)
    rule[0] = _NO_STEPS
    if length >= arrays.max_steps[0]:
        return 0.0
    take_up(arrays, plan, trial, i, place)
    change_uav(trial, i, place)
    for s in range(place - 1, length):
        x = j if s < place else plan.visits.target[i, s]
        trial.tally[WORK] += 1
        rule[0] = simulator.reach_verdict(arrays, episodes, 0, i, x)
        if rule[0] != visit.ALLOWED:
            return 0.0
        way = simulator.leg_to(arrays, episodes, 0, i, x)
        if s < place:
            charge(total, -worth.cost_of(arrays, 0, way))
        elif s == place:
            exchange(total, -worth.cost_of(arrays, 0, plan.leg[i, s]), -worth.cost_of(arrays, 0, way))
        if visit.is_base(arrays, x):
            simulator.fly_to_base(arrays, episodes, 0, i, x)
        else:
            simulator.fly_to(arrays, episodes, 0, i, x)
    for k in range(unloaded.shape[0]):
        if unloaded[k] > 0.0:
            charge(total, worth.earned_by(arrays, 0, j, unloaded[k]))
            if worth.has_bonus(arrays, 0):
                charge(total, worth.bonus_of(arrays, 0, j, k, plan.remaining[j, k], unloaded[k]))
    if arrays.terms[0].charge_return:
        back = simulator.leg_home(arrays, episodes, 0, i)
        exchange(total, -worth.cost_of(arrays, 0, plan.back[i]), -worth.cost_of(arrays, 0, back))
    if worth.has_closing_cost(arrays, 0):
        before, after = (
            closing_cost_of(arrays, plan, trial, False),
            closing_cost_of(arrays, plan, trial, True),
        )
        exchange(total, -before, -after)
    trial.tally[MADE] = 1
    return gain(total)
