"""What all searches over random keys share: evaluation in slices, the incumbent, and the solver."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

import numpy as np

from app.domain.errors import ProblemTooLarge
from app.domain.problem import Problem
from app.domain.said import said
from app.simulation.arrays import Floats, compile_problem
from app.solvers.budget import Budget, Incumbent
from app.solvers.comparison_parameters import KeySearchParameters
from app.solvers.protocol import Report, Solution, SolverContext, StopCriterion
from app.solvers.seeds import seed_sequence
from app.solvers.swarms.decoder import NEUTRAL, fly, fly_all, new_flight

MAX_KEYS = 5_000_000
"""Most keys of a swarm: so a move of all its members takes a tenth of a second."""

_SLICE_ACTIONS = 200_000
"""Actions that are looked at between two looks at the stop criterion: some milliseconds."""

Given = TypeVar("Given", bound=KeySearchParameters)


class KeyFlights:
    """The objective of a search over keys, and its best plan so far.

    Parameters
    ----------
    problem
        The problem.
    budget
        Evaluations and time.
    report
        Is told of better plans.

    Attributes
    ----------
    shape
        Of one vector of keys: (M, N + D).
    budget
        As given.
    best
        The best plan so far.
    """

    def __init__(self, problem: Problem, budget: Budget, report: Report) -> None:
        arrays = compile_problem(problem)
        self._flight = new_flight(arrays)
        self.shape = (problem.n_uavs, problem.n_targets + problem.n_bases)
        self.budget, self.best = budget, Incumbent(problem, budget, report)
        actions = problem.max_steps * self.shape[0] * max(1, self.shape[1])
        self._slice = max(1, _SLICE_ACTIONS // actions)

    def rewards(self, keys: Floats) -> Floats:
        """Fly vectors of keys, (P, M, N + D); return what each earns, (P,).

        What the budget leaves no room for has minus infinity.
        """
        reward = np.full(len(keys), -np.inf)
        first = 0
        while first < len(keys) and not self.budget.over():
            count = self.budget.left(min(self._slice, len(keys) - first))
            fly_all(self._flight, keys, reward, first, first + count)
            self.budget.spent += count
            first += count
        top = int(np.argmax(reward))
        if reward[top] > self.best.reward:
            fly(self._flight, keys, top)
            self.best.offer(reward[top], self._flight.actions)
        return reward

    def drawn(self, count: int, rng: np.random.Generator) -> Floats:
        """Draw the first vectors of a swarm, (P, M, N + D): the neutral one, and others from 0 to 1."""
        keys = rng.random((count, *self.shape))
        keys[0] = NEUTRAL
        return keys


class KeySearch(ABC, Generic[Given]):
    """A :class:`~app.solvers.protocol.Solver` over random keys; an epoch of its history is an evaluation."""

    def __init__(self, parameters: Given, context: SolverContext) -> None:  # noqa: ARG002 - as the protocol has it
        self.parameters = parameters

    @abstractmethod
    def search(self, flights: KeyFlights, rng: np.random.Generator) -> None:
        """Search until the budget of the flights is over."""

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`."""
        keys = self.parameters.swarm * problem.n_uavs * (problem.n_targets + problem.n_bases)
        if keys > MAX_KEYS:
            raise ProblemTooLarge(
                said(
                    "swarm {swarm} times {uavs} UAVs times {stops} stops are {keys} keys; the limit "
                    "is {limit}",
                    swarm=self.parameters.swarm,
                    uavs=problem.n_uavs,
                    stops=problem.n_targets + problem.n_bases,
                    keys=keys,
                    limit=MAX_KEYS,
                ),
                details={"keys": keys, "limit": MAX_KEYS},
            )
        rng = np.random.default_rng(seed_sequence(seed))
        budget = Budget(self.parameters.evaluations, problem, stop)
        flights = KeyFlights(problem, budget, report)
        self.search(flights, rng)
        flights.best.tell()
        return Solution(flights.best.plan(), flights.best.history, self.parameters)
