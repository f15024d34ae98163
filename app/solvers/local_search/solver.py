"""The local search as an algorithm of its own: annealing from the greedy rule's plan."""

from __future__ import annotations

import math

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.simulation.arrays import compile_problem
from app.solvers.local_search.annealing import Search, actions_of, new_search, replica
from app.solvers.local_search.effort import default_moves, default_restarts, moves_within_limit
from app.solvers.local_search.improvement import Cooling, Watch, improve_together
from app.solvers.parameters import LocalSearchParameters
from app.solvers.protocol import History, Progress, Report, Solution, SolverContext, StopCriterion
from app.solvers.seeds import seed_sequence
from app.solvers.start import begin_search
from app.solvers.stop import a_thread_each


class LocalSearch:
    """A :class:`~app.solvers.protocol.Solver`; an epoch of its history is a round of annealing."""

    def __init__(self, parameters: LocalSearchParameters, context: SolverContext) -> None:
        self.parameters = parameters
        self._context = context

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`; epoch 0 is the plan that it begins from."""
        arrays = compile_problem(problem)
        search, history = new_search(arrays), History()
        begin_search(search, problem, stop)
        moves, restarts = how_long(search, self.parameters.moves, self.parameters.restarts, stop)
        history.add(0, float(search.best[0]))
        watch = watching(search, history, report)
        search_on(search, seed, self._context, moves, restarts + 1, stop, watch)
        used = self.parameters.model_copy(update={"moves": moves, "restarts": restarts})
        return Solution(Plan.of(actions_of(search), problem.n_targets), history, used)


def how_long(search: Search, moves: int | None, restarts: int | None, stop: StopCriterion) -> tuple[int, int]:
    """Fill in the moves and the restarts that a request leaves open, for a search from its current plan."""
    arrays = search.arrays
    if moves is None:
        moves = default_moves(arrays) if math.isinf(stop.seconds_left()) else moves_within_limit(arrays)
    if restarts is None:
        restarts = default_restarts(arrays, moves, search.routes.length)
    return moves, restarts


def search_on(
    search: Search,
    seed: int,
    context: SolverContext,
    moves: int,
    rounds: int,
    stop: StopCriterion,
    watch: Watch,
) -> None:
    """Search from a current plan on some threads, each with the moves and a stream of random numbers.

    The same seed and number of threads give the same plan as long as `stop` does not end it early.
    """
    stops = a_thread_each(stop, context)
    streams = seed_sequence(seed).spawn(len(stops))
    searches = [search, *(replica(search) for _ in stops[1:])]
    generators = [np.random.default_rng(stream) for stream in streams]
    improve_together(searches, generators, stops, moves, rounds, Cooling(), watch)


def watching(search: Search, history: History, report: Report, begin: float = 0.0) -> Watch:
    """Return a watch that reports and keeps the history, where `begin` of the work was done before."""
    known: list[tuple[float, Plan]] = []

    def watch(done: float, ended: int) -> None:
        reward = float(search.best[0])
        if ended > history.epoch[-1]:
            history.add(ended, reward)
        if not known or known[-1][0] != reward:
            known[:] = [(reward, Plan.of(actions_of(search), search.arrays.shape[1]))]
        report(Progress(begin + (1.0 - begin) * done, ended, reward, known[0][1]))

    return watch
