"""The local search as an algorithm of its own: annealing from the greedy rule's plan."""

from __future__ import annotations

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.simulation.arrays import ProblemArrays, compile_problem
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.annealing import actions_of, new_search, set_routes
from app.solvers.local_search.effort import default_moves, default_restarts
from app.solvers.local_search.improvement import Cooling, improve
from app.solvers.parameters import LocalSearchParameters
from app.solvers.protocol import History, Progress, Report, Solution, SolverContext, StopCriterion


class LocalSearch:
    """A :class:`~app.solvers.protocol.Solver`; an epoch of its history is a round of annealing."""

    def __init__(self, parameters: LocalSearchParameters, context: SolverContext) -> None:  # noqa: ARG002
        self.parameters = parameters

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`; epoch 0 is the greedy rule's plan."""
        arrays = compile_problem(problem)
        parameters, moves, rounds = self._filled_in(arrays)
        rng = np.random.default_rng([abs(seed), int(seed < 0)])
        search, history = new_search(arrays), History()
        set_routes(search, greedy_plan(problem).as_array())
        history.add(0, float(search.best[0]))

        def watch(done: float, ended: int) -> None:
            reward = float(search.best[0])
            if ended > history.epoch[-1]:
                history.add(ended, reward)
            report(Progress(done, ended, reward, Plan.of(actions_of(search), problem.n_targets)))

        improve(search, rng, moves, rounds, Cooling(), stop, watch)
        return Solution(Plan.of(actions_of(search), problem.n_targets), history, parameters)

    def _filled_in(self, arrays: ProblemArrays) -> tuple[LocalSearchParameters, int, int]:
        """Fill in what a request leaves open; also return the moves and the number of rounds."""
        given = self.parameters
        moves = default_moves(arrays) if given.moves is None else given.moves
        restarts = default_restarts(arrays, moves) if given.restarts is None else given.restarts
        return given.model_copy(update={"moves": moves, "restarts": restarts}), moves, restarts + 1
