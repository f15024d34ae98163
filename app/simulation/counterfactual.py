"""What a plan would earn with one more visit, in the problem as it is or in one that is a little easier.

Routes are flown on the one simulator: in every step each UAV takes the next visit of its route that is legal,
so what comes out is the reward of a legal plan, whatever the additional visit does to those after it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from app.simulation import simulator
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.unloading import best_deliveries

_WORK = 1_200_000
"""Visits, UAVs and targets that all counterfactuals of an answer may go through: tens of milliseconds."""

_PLANNED_COST = 30
"""Times what planned unloading makes a counterfactual cost."""


class Outcome(NamedTuple):
    """The plan with one more visit.

    Attributes
    ----------
    reward
        What it earns.
    elsewhere
        What it earns at other targets, without distance.
    helps
        Whether the visited target gets more than before.
    """

    reward: float
    elsewhere: float
    helps: bool


class Counterfactuals:
    """Evaluates one more visit, as often as there is time for.

    Parameters
    ----------
    arrays
        A stack of one problem; it is not changed.
    target, length
        (M, S) and (M,) routes of the plan.
    planned
        Whether unloading is planned.
    remaining
        (N,) what each target needs after the plan, over all materials.
    hurry
        When true, no more are evaluated.
    """

    def __init__(
        self,
        arrays: ProblemArrays,
        target: Integers,
        length: Integers,
        planned: bool,
        remaining: Floats,
        hurry: Callable[[], bool],
    ) -> None:
        # Copies of what a counterfactual may relax, with one step more than there is.
        self._arrays = arrays._replace(
            voyage=arrays.voyage.copy(),
            deadline=arrays.deadline.copy(),
            load=arrays.load.copy(),
            max_steps=arrays.max_steps.copy(),
        )
        m, n, _ = arrays.shape
        self._routes = np.full((m, target.shape[1] + 1), n, np.int64)
        self._routes[:, :-1] = target
        self._length, self._planned, self._remaining = length.copy(), planned, remaining
        self._episodes = simulator.new_episodes(self._arrays, 1)
        self._actions = np.empty((target.shape[1] + 1, m), np.int64)
        self._cursor = np.empty(m, np.int64)
        cost = int(length.sum()) + m + n
        self._left = _WORK // (cost * (_PLANNED_COST if planned else 1))
        self._hurry = hurry

    @property
    def spent(self) -> bool:
        """Whether no further counterfactual should be evaluated."""
        return self._left <= 0 or self._hurry()

    def insert(
        self,
        i: int,
        place: int,
        j: int,
        more_load: Floats | None = None,
        more_range: float = 0.0,
        deadline: float | None = None,
        more_steps: int = 0,
    ) -> Outcome:
        """Fly the plan with target `j` as visit `place` of UAV `i`, in an easier problem if so asked."""
        self._left -= 1
        arrays = self._arrays
        kept = arrays.load[0, i].copy(), arrays.voyage[0, i], arrays.deadline[0, j]
        if more_load is not None:
            arrays.load[0, i] += more_load
        arrays.voyage[0, i] += more_range
        if deadline is not None:
            arrays.deadline[0, j] = deadline
        arrays.max_steps[0] += more_steps
        route = self._routes[i].copy()
        self._routes[i, place + 1 :] = route[place:-1]
        self._routes[i, place] = j
        self._length[i] += 1
        outcome = self._fly(j)
        self._length[i] -= 1
        self._routes[i] = route
        arrays.max_steps[0] -= more_steps
        arrays.load[0, i], arrays.voyage[0, i], arrays.deadline[0, j] = kept
        return outcome

    def _fly(self, j: int) -> Outcome:
        arrays, episodes = self._arrays, self._episodes
        _fly_routes(arrays, episodes, self._routes, self._length, self._planned, self._cursor, self._actions)
        satisfaction, lacking = float(episodes.satisfaction[0]), float(episodes.need[0, j].sum())
        if self._planned:
            delivered = best_deliveries(arrays, self._actions[: int(arrays.max_steps[0])])
            there = np.where(
                self._actions[: len(delivered)] < arrays.shape[1], self._actions[: len(delivered)], 0
            )
            per_unit = arrays.level[0] / np.where(arrays.need_total[0] > 0, arrays.need_total[0], 1.0)
            satisfaction = float((delivered.sum(axis=2) * per_unit[there]).sum())
            lacking = float(arrays.need_total[0, j] - delivered[self._actions[: len(delivered)] == j].sum())
        reward = satisfaction - float(arrays.weight[0] * episodes.distance[0])
        whole = float(arrays.need_total[0, j])
        elsewhere = satisfaction - float(arrays.level[0, j]) * (whole - lacking) / whole
        return Outcome(reward, elsewhere, bool(lacking < self._remaining[j] * (1 - 1e-9)))


@simulator.compiled
def _fly_routes(
    arrays: ProblemArrays,
    episodes: simulator.Episodes,
    routes: Integers,
    length: Integers,
    planned: bool,
    cursor: Integers,
    actions: Integers,
) -> None:
    """Fly routes, leaving out what is not allowed, and write the joint actions."""
    m, home = routes.shape[0], arrays.level.shape[1]
    simulator.reset_one(arrays, episodes, 0)
    for i in range(m):
        cursor[i] = 0
    for s in range(actions.shape[0]):
        for i in range(m):
            actions[s, i] = home
            while s < arrays.max_steps[0] and cursor[i] < length[i]:
                j = routes[i, cursor[i]]
                cursor[i] += 1
                if planned:
                    rule = simulator.reach_verdict(arrays, episodes, 0, i, j)
                    if episodes.ret[0, i]:
                        rule = simulator.RETURNING
                else:
                    rule = simulator.verdict(arrays, episodes, 0, i, j)
                if rule == simulator.ALLOWED:
                    actions[s, i] = j
                    if planned:
                        simulator.fly_to(arrays, episodes, 0, i, j)
                    else:
                        simulator.act(arrays, episodes, 0, i, j)
                    break
    for i in range(m):
        simulator.act(arrays, episodes, 0, i, home)
