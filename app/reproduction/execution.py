"""One run: solve a problem, fly the plan again in the simulator, and write down what that earns."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from app.domain.errors import IllegalPlan
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.library.entries import new_policy
from app.library.seeding import add_policies
from app.reproduction.general_optimisers import pyvrp_plan, routing_plan
from app.reproduction.grid import FIRST_SEED, Run, problem_of
from app.reproduction.methods import METHODS, Kind, Method
from app.reproduction.records import Record
from app.reproduction.scale import Cell
from app.simulation.explain import explain
from app.solvers.protocol import Solution, SolverContext
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import Deadline, never
from policy_store.database import Database
from policy_store.library import PolicyLibrary

NEIGHBOUR_MOVED = 0.05
"""Standard deviation by which a neighbouring task's positions differ, in the side of the unit square."""

GENERAL = {"pyvrp": pyvrp_plan, "ortools": routing_plan}
"""The general optimisers, by their names."""


class Outcome(NamedTuple):
    """A record, and the seconds that the solver took."""

    record: Record
    seconds: float


def execute(run: Run, library_url: str) -> Outcome:
    """Do a run.

    Parameters
    ----------
    run
        What to do.
    library_url
        Library with the shipped policies.
    """
    problem = problem_of(run.cell, run.problem)
    if run.how.kind is Kind.TIMED:
        return _timed(run, problem, library_url)
    extra: Record = {}
    if run.how.kind is Kind.NEAR:
        solution, seconds, source_reward = transfer_from_neighbour(problem, run)
        extra["source_reward"] = source_reward
    else:
        solution, seconds = _solve(run.how, run.parameters, problem, run.seed, SolverContext(library_url))
    history = solution.history
    return Outcome(
        {
            **replayed(problem, solution.plan),
            "history": {"epoch": history.epoch, "reward": history.reward},
            "source_policy": solution.source_policy.id if solution.source_policy else None,
            "source_distance": solution.source_policy.distance if solution.source_policy else None,
            "bound": solution.proof.bound if solution.proof else None,
            "proven": solution.proof.proven if solution.proof else None,
            **extra,
        },
        seconds,
    )


def replayed(problem: Problem, plan: Plan) -> Record:
    """Fly a plan and return what it earns, by the field names of ``POST /allocate``.

    A plan that breaks a rule earns nothing and is marked: only a general optimiser's could.
    """
    assignment = [list(row) for row in plan.assignment]
    try:
        found = explain(problem, plan)
    except IllegalPlan:
        return {"assignment": assignment, "reward": 0.0, "satisfaction": 0.0, "distance": 0.0, "legal": False}
    return {
        "assignment": assignment,
        "reward": found.reward,
        "satisfaction": found.satisfaction,
        "distance": found.distance,
        "legal": True,
    }


def neighbour(problem: Problem, rng: np.random.Generator) -> Problem:
    """Return a similar task: every position moved a little, everything else as it was."""

    def moved(x: float, y: float) -> tuple[float, float]:
        return x + NEIGHBOUR_MOVED * rng.standard_normal(), y + NEIGHBOUR_MOVED * rng.standard_normal()

    uavs, targets = [], []
    for uav in problem.uavs:
        x, y = moved(uav.x_s, uav.y_s)
        uavs.append(replace(uav, x_s=x, y_s=y, x_c=x, y_c=y))
    for target in problem.targets:
        x, y = moved(target.x, target.y)
        targets.append(replace(target, x=x, y=y))
    return replace(problem, uavs=tuple(uavs), targets=tuple(targets))


def transfer_from_neighbour(problem: Problem, run: Run) -> tuple[Solution, float, float]:
    """Train QMIX on a neighbouring task, then run Algorithm 2 with that as the only source.

    Returns
    -------
    solution, seconds
        Of the transfer alone.
    source_reward
        The source policy's last greedy roll-out on its own task.
    """
    task = neighbour(problem, np.random.default_rng([run.cell.m, run.cell.n, run.problem, run.seed]))
    trained, _ = _solve(METHODS["qmix-paper"], run.parameters, task, run.seed, SolverContext())
    with tempfile.TemporaryDirectory() as folder:
        database = Database(f"sqlite:///{Path(folder) / 'library.sqlite3'}")
        library = PolicyLibrary(database)
        library.migrate()
        policy = new_policy("neighbour", task, cast(bytes, trained.checkpoint), policy_id="neighbour")
        add_policies(library, database, [policy])
        try:
            solution, seconds = _solve(
                METHODS["transfer-paper"], {"mode": "paper"}, problem, run.seed, SolverContext(database.url)
            )
        finally:
            database.dispose()
    return solution, seconds, trained.history.reward[-1]


def warm_up(library_url: str, methods: set[str]) -> None:
    """Run methods for a moment, so that loading and compiling is not part of what is timed."""
    small = problem_of(Cell(5, 5), 0)
    for name in sorted(methods):
        method = METHODS[name]
        if method.kind is Kind.TIMED:
            run = Run(Cell(5, 5), 0, name, FIRST_SEED, {"seconds": 0.05})
            _timed(run, small, library_url)
            continue
        parameters = dict(method.warm_up)
        if method.algorithm == "transfer_qmix" and not parameters:
            parameters = {"mode": "paper", "n_epochs": 4, "buffer_size": 2, "batch_size": 2}
        _solve(method, parameters, small, FIRST_SEED, SolverContext(library_url))


def _solve(
    method: Method, given: Mapping[str, Any], problem: Problem, seed: int, context: SolverContext
) -> tuple[Solution, float]:
    solver = create_solver(method.algorithm, parse_parameters(method.algorithm, given), context)
    begun = time.perf_counter()
    solution = solver.solve(problem, seed, never, lambda _progress: None)
    return solution, time.perf_counter() - begun


def _timed(run: Run, problem: Problem, library_url: str) -> Outcome:
    seconds, name = float(run.parameters["seconds"]), run.how.algorithm
    begun = time.perf_counter()
    if name in GENERAL:
        plan = GENERAL[name](problem, seconds, run.seed)
    else:
        solver = create_solver(name, parse_parameters(name, {}), SolverContext(library_url))
        plan = solver.solve(problem, run.seed, Deadline(seconds), lambda _progress: None).plan
    return Outcome(replayed(problem, plan), time.perf_counter() - begun)
