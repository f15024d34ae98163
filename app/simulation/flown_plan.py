"""A plan as one more visit meets it: where every UAV is, when and with what, before each of its visits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation import simulator
from app.simulation.amounts import Amounts
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.replay import deliver, load
from app.simulation.visit import is_base
from app.simulation.visit_lists import Visits, visits_of


class FlownPlan(NamedTuple):
    """The record of a legal plan of one problem; L is the length of its longest route.

    Attributes
    ----------
    visits
        Its routes. They have room for one visit more.
    flown, clock, aloft
        (M, L+1) air length, time and time in the air before each stop, the last entry of a route after its
        last one; the time in the air of UAVs for which it counts.
    load
        (M, L+1, K) what is aboard then.
    need
        (M, L+1, K) what the stop's target needs, or its base has, then.
    value, leg
        (M, L+1) what each stop earns after its distance is charged, and the length of its leg.
    back
        (M,) legs home.
    remaining
        (N, K) what is still needed at the end.
    spare
        (M, K) what is aboard at the end.
    stock
        (D, K) what is at the bases at the end.
    """

    visits: Visits
    flown: Floats
    clock: Floats
    aloft: Floats
    load: Floats
    need: Floats
    value: Floats
    leg: Floats
    back: Floats
    remaining: Floats
    spare: Floats
    stock: Floats


def record_plan(arrays: ProblemArrays, actions: Integers, amounts: Amounts, planned: bool) -> FlownPlan:
    """Fly a legal plan and write down what one more visit would meet.

    Parameters
    ----------
    arrays
        A stack of one problem.
    actions, amounts
        (S', M) joint actions, and what they unload and load.
    planned
        Whether these amounts are to be unloaded, not the simulator's own; and loaded, where that is planned.
    """
    m, n, k = arrays.shape
    steps = int((actions != n).sum(axis=0).max()) + 1
    visits = visits_of(arrays._replace(max_steps=np.array([steps])), actions)
    episodes = simulator.new_episodes(arrays, 1)
    plan = FlownPlan(
        visits,
        np.zeros((m, steps)),
        np.zeros((m, steps)),
        np.zeros((m, steps)),
        np.zeros((m, steps, k)),
        np.zeros((m, steps, k)),
        np.zeros((m, steps)),
        np.zeros((m, steps)),
        np.zeros(m),
        episodes.need[0],
        episodes.load[0],
        episodes.stock[0],
    )
    _fly(arrays, episodes, plan, amounts, planned)
    return plan


@compiled
def _fly(arrays: ProblemArrays, episodes: Episodes, plan: FlownPlan, amounts: Amounts, planned: bool) -> None:
    m, materials = plan.load.shape[0], plan.load.shape[2]
    visits = plan.visits
    for s in range(plan.leg.shape[1]):
        for i in range(m):
            if s > visits.length[i]:
                continue
            plan.flown[i, s], plan.clock[i, s] = episodes.flown[0, i], episodes.clock[0, i]
            plan.aloft[i, s] = episodes.aloft[0, i]
            for k in range(materials):
                plan.load[i, s, k] = episodes.load[0, i, k]
            if s == visits.length[i]:
                continue
            j = visits.target[i, s]
            for k in range(materials):
                if is_base(arrays, j):
                    plan.need[i, s, k] = episodes.stock[0, j - arrays.need.shape[1] - 1, k]
                else:
                    plan.need[i, s, k] = episodes.need[0, j, k]
            plan.leg[i, s] = simulator.leg_to(arrays, episodes, 0, i, j)
            if planned and is_base(arrays, j) and arrays.terms[0].plans_loading:
                load(arrays, episodes, i, j, amounts.loaded, s)
                plan.value[i, s] = -arrays.terms[0].weight * plan.leg[i, s]
            elif planned and not is_base(arrays, j):
                before = episodes.satisfaction[0]
                deliver(arrays, episodes, i, j, amounts.delivered, s)
                plan.value[i, s] = episodes.satisfaction[0] - before - arrays.terms[0].weight * plan.leg[i, s]
            else:
                plan.value[i, s] = simulator.act(arrays, episodes, 0, i, j)
    for i in range(m):
        plan.back[i] = 0.0 if arrays.ret[0, i] else simulator.leg_home(arrays, episodes, 0, i)
