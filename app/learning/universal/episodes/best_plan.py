"""The best plan so far, by its true reward."""

from __future__ import annotations

import numpy as np

from app.domain.plan import Plan
from app.simulation.arrays import Integers, ProblemArrays
from app.simulation.evaluation import rewards_of
from app.simulation.visit import ALLOWED
from app.solvers.local_search.annealing import ROUNDING


class BestPlan:
    """Keeps the best of the plans it is shown; begins with everybody at home.

    Parameters
    ----------
    arrays
        A stack of one problem.
    """

    def __init__(self, arrays: ProblemArrays) -> None:
        m, n, _ = arrays.shape
        self._arrays = arrays
        self.actions: Integers = np.full((int(arrays.max_steps[0]), m), n, np.int64)
        self.reward = float(rewards_of(arrays, self.actions[None]).reward[0])
        self._plan: Plan | None = None

    def consider(self, plans: Integers) -> float:
        """Look at plans (B, S', M), keep the best if it is better than all before, and return its reward.

        The reward is minus infinity where none of them is allowed.
        """
        replay = rewards_of(self._arrays, plans)
        rewards = np.where(replay.rule == ALLOWED, replay.reward, -np.inf)
        most = rewards.max()
        # Of equals the first, whatever rounding makes of them.
        best = int((rewards >= most - ROUNDING * abs(most)).argmax()) if most > -np.inf else 0
        if rewards[best] > self.reward + ROUNDING * abs(self.reward):
            self.reward = float(rewards[best])
            self.actions[:] = self._arrays.shape[1]
            self.actions[: plans.shape[1]] = plans[best]
            self._plan = None
        return float(rewards[best])

    @property
    def plan(self) -> Plan:
        """The plan; the same object until there is a better one."""
        if self._plan is None:
            self._plan = Plan.of(self.actions, self._arrays.shape[1])
        return self._plan
