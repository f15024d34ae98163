"""Ant colony with division of labour by response thresholds, and circular competition: the paper's [6]."""

from __future__ import annotations

import numpy as np

from app.domain.errors import ProblemTooLarge
from app.domain.problem import Problem
from app.domain.said import said
from app.simulation.arrays import Floats, Integers, compile_problem
from app.solvers.ant_colony.labour import Colony, live, new_colony
from app.solvers.budget import Budget, Incumbent
from app.solvers.comparison_parameters import AntColonyParameters
from app.solvers.protocol import Report, Solution, SolverContext, StopCriterion
from app.solvers.seeds import seed_sequence

MAX_THRESHOLDS = 500_000
"""Most thresholds: with them a turn takes some tenths of a second."""

_SLICE_STIMULI = 10_000
"""Stimuli that are felt between two looks at the stop criterion."""


class AntColony:
    """A :class:`~app.solvers.protocol.Solver`; an epoch of its history is an evaluation."""

    def __init__(self, parameters: AntColonyParameters, context: SolverContext) -> None:  # noqa: ARG002 - as the protocol has it
        self.parameters = parameters

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`."""
        given = self.parameters
        shape = (problem.n_uavs, problem.n_targets + problem.n_bases)
        if shape[0] * shape[1] > MAX_THRESHOLDS:
            raise ProblemTooLarge(
                said(
                    "{uavs} UAVs times {stops} stops are {thresholds} thresholds; the limit is {limit}",
                    uavs=shape[0],
                    stops=shape[1],
                    thresholds=shape[0] * shape[1],
                    limit=MAX_THRESHOLDS,
                ),
                details={"thresholds": shape[0] * shape[1], "limit": MAX_THRESHOLDS},
            )
        rng = np.random.default_rng(seed_sequence(seed))
        colony = new_colony(compile_problem(problem))
        budget = Budget(given.evaluations, problem, stop)
        best = Incumbent(problem, budget, report)
        threshold = np.full(shape, given.threshold_max)
        model = np.empty_like(colony.flight.actions)
        days = 0
        while not budget.over():
            top, resistance = -np.inf, threshold**given.steepness
            for _ in range(budget.left(given.days)):
                reward = _day(colony, resistance, given.steepness, rng, budget)
                if reward is None:
                    break
                best.offer(reward, colony.flight.actions)
                if reward > top:
                    top, model = reward, colony.flight.actions.copy()
            best.tell()
            days += 1
            # Every second time the best day so far is learned from, otherwise the best of these.
            if top > -np.inf:
                learn(threshold, model if days % 2 else best.plan().as_array(), problem.n_targets, given)
        best.tell()
        return Solution(best.plan(), best.history, given)


def _day(
    colony: Colony, resistance: Floats, steepness: float, rng: np.random.Generator, budget: Budget
) -> float | None:
    """Live a day, a few milliseconds between two questions; None where it is not lived to its end."""
    steps, reward = len(colony.lists), 0.0
    turns = max(1, min(steps, _SLICE_STIMULI // max(1, resistance.size)))
    for first in range(0, steps, turns):
        if budget.over():
            return None
        reward = live(colony, resistance, steepness, rng, first, min(first + turns, steps))
    budget.spent += 1
    return reward


def learn(threshold: Floats, actions: Integers, home: int, given: AntColonyParameters) -> None:
    """Lower the thresholds for what was done, raise the others (Theraulaz, Bonabeau and Deneubourg 1998).

    Parameters
    ----------
    threshold
        (M, N + D), changed.
    actions
        (S', M) a plan.
    home
        N.
    given
        How fast, and between which limits.
    """
    threshold *= 1.0 + given.forgetting
    for row in actions:
        for i, j in enumerate(row):
            if j != home:
                threshold[i, j if j < home else j - 1] *= 1.0 - given.learning
    np.clip(threshold, given.threshold_min, given.threshold_max, out=threshold)
