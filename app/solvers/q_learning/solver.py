"""Semi-random Q-learning as an algorithm: the paper's [14]."""

from __future__ import annotations

import numpy as np

from app.domain.errors import ProblemTooLarge
from app.domain.problem import Problem
from app.domain.said import said
from app.simulation.arrays import compile_problem
from app.solvers.budget import Budget, Incumbent
from app.solvers.comparison_parameters import SemiRandomQParameters
from app.solvers.protocol import Report, Solution, SolverContext, StopCriterion
from app.solvers.q_learning.table import new_learner, play, table_size
from app.solvers.seeds import seed_sequence

MAX_VALUES = 50_000_000
"""Most values of the tables: 400 MB."""

_TOLD_EVERY = 100
"""Episodes between two points of the history."""


class SemiRandomQLearning:
    """A :class:`~app.solvers.protocol.Solver`; an epoch of its history is an episode, an evaluation."""

    def __init__(self, parameters: SemiRandomQParameters, context: SolverContext) -> None:  # noqa: ARG002 - as the protocol has it
        self.parameters = parameters

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`."""
        given = self.parameters
        values = table_size(problem.n_uavs, problem.n_targets, problem.n_bases)
        if values > MAX_VALUES:
            raise ProblemTooLarge(
                said(
                    "tables for {uavs} UAVs and {stops} stops have {values} values; the limit is {limit}",
                    uavs=problem.n_uavs,
                    stops=problem.n_targets + problem.n_bases,
                    values=values,
                    limit=MAX_VALUES,
                ),
                details={"values": values, "limit": MAX_VALUES},
            )
        rng = np.random.default_rng(seed_sequence(seed))
        learner = new_learner(compile_problem(problem))
        budget = Budget(given.evaluations, problem, stop)
        best = Incumbent(problem, budget, report)
        while not budget.over():
            fraction = budget.fraction()
            epsilon = given.epsilon_start + fraction * (given.epsilon_end - given.epsilon_start)
            reward = play(learner, (epsilon, given.learning_rate, given.gamma), rng)
            budget.spent += 1
            best.offer(reward, learner.actions)
            if budget.spent % _TOLD_EVERY == 0:
                best.tell()
        best.tell()
        return Solution(best.plan(), best.history, given)
