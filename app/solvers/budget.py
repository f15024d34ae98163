"""How long the algorithms for comparison search, and what they have found so far."""

from __future__ import annotations

import math

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.simulation.arrays import Integers
from app.simulation.evaluation import reward_of
from app.solvers.protocol import History, Progress, Report, StopCriterion

_DEFAULT_ACTIONS = 20_000_000
"""Actions that are looked at in the evaluations of a search where nobody says how many: some seconds."""

_LEAST, _MOST = 500, 20_000
"""Evaluations between which the default lies."""


class Budget:
    """Evaluations that may be made, and time for them.

    An evaluation is one flight of a whole plan through the simulator.

    Parameters
    ----------
    evaluations
        How many; None: as many as a time limit allows, and where there is none, by the size of the problem.
    problem
        The problem.
    stop
        Ends it earlier.

    Attributes
    ----------
    spent
        Evaluations made.
    """

    def __init__(self, evaluations: int | None, problem: Problem, stop: StopCriterion) -> None:
        self._stop = stop
        self._seconds = stop.seconds_left()
        limited = math.isfinite(self._seconds)
        if evaluations is None and not limited:
            evaluations = default_evaluations(problem)
        self._most = math.inf if evaluations is None else evaluations
        self.spent = 0

    def over(self) -> bool:
        """Say whether the search should return what it has."""
        return self.spent >= self._most or self._stop()

    def left(self, wanted: int) -> int:
        """Return how many of some evaluations may still be made."""
        return int(max(0, min(wanted, self._most - self.spent)))

    def fraction(self) -> float:
        """Return the part that is spent, 0 to 1: of the evaluations or of the time, whichever is more."""
        part = self.spent / self._most if self._most else 1.0
        if math.isfinite(self._seconds):
            left = self._stop.seconds_left()
            part = max(part, 1.0 - left / self._seconds if self._seconds > 0.0 else 1.0)
        return min(1.0, max(0.0, part))


def default_evaluations(problem: Problem) -> int:
    """Return how many evaluations a search without a time limit makes, if the request leaves it open."""
    actions = problem.max_steps * problem.n_uavs * (problem.n_targets + problem.n_bases)
    return max(_LEAST, min(_MOST, _DEFAULT_ACTIONS // max(1, actions)))


class Incumbent:
    """The best plan so far, its history by evaluations, and who is told of it.

    Parameters
    ----------
    problem
        The problem.
    budget
        Counts the evaluations, which are the history's epochs.
    report
        Is told of every better plan.

    Attributes
    ----------
    reward
        What it earns; at first what staying at home earns.
    history
        A point whenever :meth:`tell` is called.
    """

    def __init__(self, problem: Problem, budget: Budget, report: Report) -> None:
        self._n_targets, self._budget, self._report = problem.n_targets, budget, report
        self._plan = Plan.empty(problem.n_uavs, problem.n_targets)
        self._actions: Integers | None = None
        self._fraction = 0.0
        self.reward = reward_of(problem, self._plan)
        self.history = History()
        self.history.add(0, self.reward)

    def offer(self, reward: float, actions: Integers) -> bool:
        """Take a plan, (S, M), if it earns more; say whether it does."""
        if not reward > self.reward:
            return False
        self.reward, self._actions = float(reward), np.array(actions)
        return True

    def tell(self) -> None:
        """Add a point to the history and report."""
        spent = self._budget.spent
        if spent > self.history.epoch[-1]:
            self.history.add(spent, self.reward)
        # Two questions to a clock may be answered in any order.
        self._fraction = max(self._fraction, self._budget.fraction())
        self._report(Progress(self._fraction, spent, self.reward, self.plan()))

    def plan(self) -> Plan:
        """Return the best plan so far."""
        if self._actions is not None:
            self._plan, self._actions = Plan.of(self._actions, self._n_targets), None
        return self._plan
