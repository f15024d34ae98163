"""Allocation without a server: what UAVs agree on by messages alone, in one market."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.solvers.comparison_parameters import MarketParameters
from app.solvers.markets.solver import MarketSolver, by_level
from app.solvers.protocol import StopCriterion
from app.solvers.seeds import seed_sequence
from app.solvers.stop import never


class Agreed(NamedTuple):
    """What came of a market.

    Attributes
    ----------
    plan
        Of all routes together. Stops that two UAVs believed to be theirs are left out of the later route.
    reward
        What it earns.
    messages
        Sent, from one UAV to one other; lost ones are among them.
    rounds
        Of messages; of the contract net, announcements and what follows each.
    conflicts
        Stops that were left out.
    """

    plan: Plan
    reward: float
    messages: int
    rounds: int
    conflicts: int


def agree(
    problem: Problem, market: MarketSolver[MarketParameters], seed: int = 0, stop: StopCriterion = never
) -> Agreed:
    """Let UAVs agree once.

    Parameters
    ----------
    problem
        The problem, with greedy unloading.
    market
        :class:`~app.solvers.markets.solver.ContractNetSolver` or
        :class:`~app.solvers.markets.solver.BundleSolver`; its parameters say who hears whom.
    seed
        Decides which messages are lost.
    stop
        Ends it early: then everybody flies what it has.

    Raises
    ------
    ProblemTooLarge
        If the market cannot hold the problem.
    """
    agreement = market.agreement(problem, np.random.default_rng(seed_sequence(seed)))
    agreement.agree(by_level(problem), stop)
    reward, actions = agreement.fly()
    method = agreement.method
    plan = Plan.of(actions, problem.n_targets)
    return Agreed(plan, reward, agreement.network.sent, method.rounds, method.conflicts)
