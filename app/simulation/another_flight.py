"""What one more flight at the end of a UAV's route would bring a target: a reload, and a visit after it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation import simulator, visit, worth
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled, inlined
from app.simulation.episodes import Episodes
from app.simulation.flown_plan import FlownPlan
from app.simulation.insertion import (
    GAIN,
    Trial,
    begin,
    change_uav,
    charge,
    closing_cost_of,
    exchange,
    gain,
    need_at,
    take_up,
)
from app.simulation.legs import UNREACHABLE

NO_STEPS = -1
"""In place of a rule: no two steps are left."""


class AnotherFlight(NamedTuple):
    """The best flight to a target, if any is allowed; otherwise why not.

    Attributes
    ----------
    uav, base
        Who flies, and from which base; NONE where no flight is allowed.
    gain
        Change of the reward.
    in_stock
        Whether a base has anything left of what the target needs, for a UAV that may load there.
    rules
        Rules that forbid the flights of UAVs that could load something, and ``NO_STEPS``.
    """

    uav: int
    base: int
    gain: float
    in_stock: bool
    rules: frozenset[int]


def another_flight(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, j: int) -> AnotherFlight:
    """Look at one more flight of every UAV, from every base, to target `j`.

    It comes after all other stops of its UAV, so it changes nothing for them; others at the target, or the
    base, that come after it in the order of the plan count as if they came before.

    Parameters
    ----------
    arrays, plan
        A stack of one problem, and its plan with greedy unloading.
    trial
        Scratch space.
    j
        The target.
    """
    best, found = np.array([-np.inf]), np.full(2, NONE, np.int64)
    rules = np.zeros(max(visit.RULES) + 2, np.int64)
    in_stock = bool(_look(arrays, plan, trial, j, best, found, rules))
    seen = frozenset(rule - 1 for rule in np.flatnonzero(rules).tolist())
    return AnotherFlight(int(found[0]), int(found[1]), float(best[0]), in_stock, seen)


@compiled
def _look(
    arrays: ProblemArrays,
    plan: FlownPlan,
    trial: Trial,
    j: int,
    best: Floats,
    found: Integers,
    rules: Integers,
) -> bool:
    """Keep the best flight; count the rules that forbid others, each one place further."""
    episodes, home, in_stock = trial.episodes, arrays.need.shape[1], False
    m, end = plan.back.shape[0], arrays.max_steps[0]
    for i in range(m):
        length = plan.visits.length[i]
        for d in range(arrays.stock.shape[1]):
            base = home + 1 + d
            if arrays.ret[0, i] or not _loads(arrays, plan, i, d, j):
                continue
            in_stock = True
            if length + 2 > end:
                rules[NO_STEPS + 1] += 1
                continue
            begin(trial, i, length, j)
            take_up(arrays, plan, trial, i, length)
            # After the last slot: everything has been unloaded, and loaded, that the plan does.
            need_at(arrays, plan, trial, base, end * m)
            need_at(arrays, plan, trial, j, end * m)
            rule = simulator.verdict(arrays, episodes, 0, i, base)
            if rule == visit.ALLOWED:
                charge(trial.total, simulator.act(arrays, episodes, 0, i, base))
                if arrays.terms[0].plans_loading:
                    _load_for(arrays, plan, episodes, i, j)
                rule = simulator.verdict(arrays, episodes, 0, i, j)
            if rule != visit.ALLOWED:
                rules[rule + 1] += 1
                continue
            charge(trial.total, simulator.act(arrays, episodes, 0, i, j))
            change_uav(trial, i, length)
            if arrays.terms[0].charge_return:
                back = simulator.leg_home(arrays, episodes, 0, i)
                exchange(
                    trial.total, -worth.cost_of(arrays, 0, plan.back[i]), -worth.cost_of(arrays, 0, back)
                )
            if worth.has_closing_cost(arrays, 0):
                before, after = (
                    closing_cost_of(arrays, plan, trial, False),
                    closing_cost_of(arrays, plan, trial, True),
                )
                exchange(trial.total, -before, -after)
            change = gain(trial.total)
            if change > best[0]:
                best[0], found[0], found[1] = change, i, d
    trial.total[GAIN] = 0.0
    return in_stock


@inlined
def _load_for(arrays: ProblemArrays, plan: FlownPlan, episodes: Episodes, i: int, j: int) -> None:
    """Where loading is planned, take aboard what a target needs alone, as far as the capacity allows."""
    room = arrays.uavs[0, i].capacity
    for k in range(plan.spare.shape[1]):
        room -= arrays.weights[0, k] * plan.spare[i, k]
    for k in range(plan.spare.shape[1]):
        had, weight = plan.spare[i, k], arrays.weights[0, k]
        more = max(0.0, min(episodes.load[0, i, k], plan.remaining[j, k]) - had)
        if weight > 0.0:
            more = min(more, max(0.0, room) / weight)
            room -= more * weight
        episodes.load[0, i, k] = had + more


@compiled
def _loads(arrays: ProblemArrays, plan: FlownPlan, i: int, d: int, j: int) -> bool:
    """Whether a UAV could take up at a base, at the end, anything that the target still needs."""
    loads = False
    if arrays.kept_range[0, i, arrays.need.shape[1] + 1 + d] < UNREACHABLE:
        for k in range(plan.spare.shape[1]):
            room = visit.loaded_of(plan.spare[i, k], arrays.full[0, i, k], plan.stock[d, k])
            loads = loads or (room > 0.0 and plan.remaining[j, k] > 0.0)
    return loads
