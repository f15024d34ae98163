"""Ways of replanning that are compared, by name."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.learning.parameters import TransferQmixParameters
from app.learning.transfer import TransferQmix
from app.missions.days.flying_a_day import Arm
from app.missions.days.futures import over_futures
from app.missions.days.insertion import insert
from app.missions.state import MissionState, Routes, routes_of
from app.simulation.evaluation import reward_of
from app.solvers.protocol import Solver, SolverContext
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import Deadline, never

MORNING_S = 1.0
"""Processor seconds of the first plan of an arm that does not replan by a search of its own."""


def arms_of(library_url: str, kind: str) -> Mapping[str, Arm]:
    """Return the ways of replanning.

    Parameters
    ----------
    library_url
        Database of the policies.
    kind
        The kind of the days, of which the futures are.
    """
    context = SolverContext(library_url)
    auto = create_solver("auto", parse_parameters("auto", {}), context)
    transfer = create_solver("transfer_qmix", parse_parameters("transfer_qmix", {}), context)
    # Bare: that no plan is below the greedy rule's is the service's doing, not the policy's.
    policy = TransferQmix(
        TransferQmixParameters(n_epochs=0, samples=0, recombine=False, polish=False), context
    )
    return {
        "none": Arm(_searching(auto, MORNING_S), replans=False),
        "insertion": Arm(_inserting),
        "auto then insertion": Arm(_morning(_searching(auto, MORNING_S), _inserting)),
        "policy": Arm(_rolling_out(policy)),
        "transfer 1 s": Arm(_searching(transfer, 1.0)),
        "auto 0.25 s": Arm(_searching(auto, 0.25)),
        "auto 1 s": Arm(_searching(auto, 1.0)),
        "auto over futures": Arm(over_futures(auto, 0.5, kind), ticks=True),
    }


PRICES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Prices on a visit of the plan in force that a new one leaves out; :func:`priced` names arms by them."""


def priced(library_url: str) -> Mapping[str, Arm]:
    """Return `auto` with prices on change."""
    auto = create_solver("auto", parse_parameters("auto", {}), SolverContext(library_url))
    return {f"price {price:g}": Arm(_searching(auto, 0.25, price)) for price in PRICES}


def solved(solver: Solver, problem: Problem, seconds: float, seed: int) -> Plan:
    """Return the plan of a search in some processor seconds."""
    return solver.solve(problem, seed, Deadline(seconds, time.process_time), lambda _progress: None).plan


def _searching(solver: Solver, seconds: float, change_weight: float = 0.0) -> Any:
    def decide(state: MissionState, number: int, rng: np.random.Generator) -> Routes | None:
        problem = state.problem
        if number and change_weight:
            problem = replace(problem, objective=replace(problem.objective, change_weight=change_weight))
        plan = solved(solver, problem, seconds, int(rng.integers(2**31)))
        return _if_better(problem, plan)

    return decide


def _if_better(problem: Problem, plan: Plan) -> Routes | None:
    """Return a plan if it earns more than the one in force."""
    better = reward_of(problem, plan) > reward_of(problem, Plan(problem.start_plan or ()))
    return routes_of(problem, plan.assignment) if better else None


def _inserting(state: MissionState, _number: int, _rng: np.random.Generator) -> Routes | None:
    return insert(state.problem, state.routes)


def _rolling_out(policy: Solver) -> Any:
    def decide(state: MissionState, _number: int, rng: np.random.Generator) -> Routes | None:
        bare = replace(state.problem, start_plan=None)
        plan = policy.solve(bare, int(rng.integers(2**31)), never, lambda _progress: None).plan
        return _if_better(state.problem, plan)

    return decide


def _morning(first: Any, then: Any) -> Any:
    def decide(state: MissionState, number: int, rng: np.random.Generator) -> Routes | None:
        found: Routes | None = (then if number else first)(state, number, rng)
        return found

    return decide
