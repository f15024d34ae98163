"""Markets as algorithms: UAVs agree by messages; with time left, contracts are cancelled and made anew."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Generic, Protocol, TypeVar

import numpy as np

from app.domain.errors import ProblemTooLarge
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.domain.said import said
from app.simulation.arrays import Floats, Integers, ProblemArrays, compile_problem
from app.simulation.simulator import new_episodes
from app.solvers.budget import Budget, Incumbent
from app.solvers.comparison_parameters import BundleParameters, ContractNetParameters, MarketParameters
from app.solvers.genetic import Flight, decode
from app.solvers.markets.bundles import Bundles
from app.solvers.markets.contract_net import ContractNet
from app.solvers.markets.network import Network, manager_of, network_of
from app.solvers.markets.routes import Market, drop, new_market, settle
from app.solvers.protocol import Report, Solution, SolverContext, StopCriterion
from app.solvers.seeds import seed_sequence

MAX_BELIEFS = 50_000_000
"""Most pairs of UAV and area, times steps and rounds that a message takes longer: some 1.2 GB."""

Given = TypeVar("Given", bound=MarketParameters)


class Method(Protocol):
    """A way to agree."""

    conflicts: int
    rounds: int

    def agree(self, market: Market, order: Integers, stop: StopCriterion) -> None:
        """Contract what is open; `order`, (N,), is the one in which areas are announced, if they are."""
        ...


class Agreement:
    """One market, its network and its method; what UAVs do who agree without a server.

    Parameters
    ----------
    problem
        The problem.
    method
        Which one.
    network
        Which messages arrive.

    Attributes
    ----------
    market
        The routes.
    """

    def __init__(self, problem: Problem, method: Method, network: Network) -> None:
        arrays = compile_problem(problem)
        self.market, self.method, self.network = new_market(arrays), method, network
        self._flight = flight_of(arrays)
        self._n_targets = problem.n_targets
        self._committed = self.market.length.copy()

    def agree(self, order: Integers, stop: StopCriterion) -> None:
        """Contract what is open."""
        self.method.agree(self.market, order, stop)

    def fly(self) -> tuple[float, Integers]:
        """Fly all routes together; return what they earn and their plan, (S, M).

        Stops that are not allowed, because others were there before, are left out.
        """
        lists = np.full(self._flight.actions.shape, self._n_targets, np.int64)
        for i, length in enumerate(self.market.length):
            lists[:length, i] = self.market.path[i, :length]
        return float(decode(self._flight, lists)), self._flight.actions

    def plan(self) -> Plan:
        """Return the plan of all routes."""
        return Plan.of(self.fly()[1], self._n_targets)

    def cancel(self, share: float, rng: np.random.Generator) -> None:
        """Cancel a share of all contracts, drawn one by one; what UAVs are committed to stays."""
        market, home = self.market, self._n_targets
        for i, committed in enumerate(self._committed):
            # A reload and the area after it are one contract.
            areas = market.path[i, : market.length[i]] < home
            numbers = np.cumsum(np.concatenate([[False], areas[:-1]])) + 1 if len(areas) else np.zeros(0)
            numbers[:committed] = 0
            market.contract[i, : len(areas)] = numbers
            for number in np.unique(numbers[numbers > 0]):
                if rng.random() < share:
                    drop(market, i, int(number), int(number))
            settle(market, i)


def flight_of(arrays: ProblemArrays) -> Flight:
    """Prepare flights of whole plans."""
    m = arrays.shape[0]
    shape = (int(arrays.max_steps[0]), m)
    return Flight(arrays, new_episodes(arrays, 1), np.empty(m, np.int64), np.empty(shape, np.int64))


class CountedFlights:
    """A stop criterion that keeps a budget's count of evaluations: M routes flown alone are one.

    Parameters
    ----------
    budget
        The budget.
    market
        Counts the routes.
    """

    def __init__(self, budget: Budget, market: Market, stop: StopCriterion) -> None:
        self._budget, self._market, self._stop = budget, market, stop

    def __call__(self) -> bool:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        self._budget.spent = int(self._market.flights[0]) // len(self._market.length)
        return self._budget.over()

    def seconds_left(self) -> float:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        return self._stop.seconds_left()


class MarketSolver(ABC, Generic[Given]):
    """A :class:`~app.solvers.protocol.Solver`; an epoch of its history is an evaluation.

    The first market is what UAVs agree without a server. After it contracts are cancelled and made anew, and
    the better outcome is kept.
    """

    def __init__(self, parameters: Given, context: SolverContext) -> None:  # noqa: ARG002 - as the protocol has it
        self.parameters = parameters

    @abstractmethod
    def method(self, problem: Problem, network: Network) -> Method:
        """Return the way to agree."""

    def agreement(self, problem: Problem, rng: np.random.Generator) -> Agreement:
        """Return a market that has not begun."""
        given = self.parameters
        places = problem.max_steps + given.message_delay
        beliefs = problem.n_uavs * problem.n_targets * places
        if beliefs > MAX_BELIEFS:
            raise ProblemTooLarge(
                said(
                    "{uavs} UAVs times {areas} areas times {places} steps and rounds of delay are {beliefs} "
                    "beliefs; the limit is {limit}",
                    uavs=problem.n_uavs,
                    areas=problem.n_targets,
                    places=places,
                    beliefs=beliefs,
                    limit=MAX_BELIEFS,
                ),
                details={"beliefs": beliefs, "limit": MAX_BELIEFS},
            )
        network = network_of(problem, given.communication_range, given.message_loss, given.message_delay, rng)
        return Agreement(problem, self.method(problem, network), network)

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`."""
        rng = np.random.default_rng(seed_sequence(seed))
        budget = Budget(self.parameters.evaluations, problem, stop)
        best = Incumbent(problem, budget, report)
        agreement = self.agreement(problem, rng)
        market = agreement.market
        counted = CountedFlights(budget, market, stop)
        agreement.agree(by_level(problem), counted)
        earned, actions = agreement.fly()
        best.offer(earned, actions)
        while not counted():
            best.tell()
            before = [column.copy() for column in _state(market)]
            agreement.cancel(self.parameters.cancelled, rng)
            agreement.agree(rng.permutation(problem.n_targets), counted)
            outcome, actions = agreement.fly()
            best.offer(outcome, actions)
            if outcome >= earned:
                earned = outcome
                continue
            for column, value in zip(_state(market), before, strict=True):
                column[...] = value
        best.tell()
        return Solution(best.plan(), best.history, self.parameters)


class ContractNetSolver(MarketSolver[ContractNetParameters]):
    """The contract net with exchange of contracts, the paper's [7]."""

    def method(self, problem: Problem, network: Network) -> Method:
        """See :meth:`MarketSolver.method`."""
        return ContractNet(manager_of(problem), network)


class BundleSolver(MarketSolver[BundleParameters]):
    """The consensus-based bundle algorithm."""

    def method(self, problem: Problem, network: Network) -> Method:  # noqa: ARG002 - as the class has it
        """See :meth:`MarketSolver.method`."""
        return Bundles(self.parameters.rounds, network)


def by_level(problem: Problem) -> Integers:
    """Return the areas, (N,), those of the highest level first."""
    return np.argsort([-target.level for target in problem.targets], kind="stable")


def _state(market: Market) -> tuple[Integers | Floats, ...]:
    return (
        market.path, market.contract, market.length, market.worth, market.settled, market.settled_length,
        market.delivered, market.left,
    )  # fmt: skip
