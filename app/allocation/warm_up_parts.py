"""What a worker loads and compiles before it gets work, part by part."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from app.allocation import bounding, evaluating, tasks
from app.domain.errors import IllegalPlan
from app.domain.problem import UAV, Problem, Target
from app.domain.records import problem_to_record
from app.domain.surroundings import Base
from app.jobs.model import Progress
from app.jobs.worker import WorkContext, resolve
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate
from app.solvers import protocol
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.annealing import new_search, set_routes
from app.solvers.local_search.relinking import Elite
from app.solvers.registry import create_solver, parse_parameters
from app.solvers.stop import never

# The learners are named, not imported, so that this room does not depend on them.
_TRANSFER = "app.learning.universal.request.warm_up:warm_up"
_TRANSFER_REST = "app.learning.universal.request.warm_up:warm_up_the_rest"

_PARAMETERS: dict[str, dict[str, Any]] = {
    "greedy": {},
    "local_search": {"moves": 200},
    "dqn": {"n_epochs": 4, "evaluate_per_epoch": 2, "buffer_size": 2, "batch_size": 2, "learning_starts": 1},
    "exact": {"nodes": 10},
    "ga": {"num_total": 4, "iteration": 2},
    # In service mode nothing that the transfer's warm-up leaves out.
    "qmix": {
        "mode": "paper",
        "n_epochs": 4,
        "evaluate_per_epoch": 2,
        "buffer_size": 2,
        "batch_size": 2,
        "learning_starts": 1,
    },
    "auto": {"moves": 200, "policy": False},
    **{
        name: {"evaluations": 50}
        for name in (
            "particle_swarm",
            "grey_wolf",
            "beetle_antennae",
            "ant_colony",
            "contract_net",
            "bundles",
            "semi_random_q",
        )
    },
}


def small_problem() -> Problem:
    """Return a problem of 2 UAVs and 3 areas, for what only has to be done once."""
    # Floats throughout, as requests have them: an array of integers would be compiled for apart.
    at, home = (1.0, 2.0), (0.0, 0.0)
    return Problem(
        uavs=tuple(UAV(f"uav-{i}", *home, *home, 1.0, 10.0, (2.0, 1.0)) for i in (1, 2)),
        targets=tuple(Target(f"area-{j}", *at, 9.0, (1.0, 2.0), deadline=9.0) for j in (1, 2, 3)),
        max_steps=2,
    )


def large_problem(n_uavs: int, n_targets: int) -> Problem:
    """Return a problem of a size, 3 materials; always the same."""
    return generate("uniform", n_uavs, n_targets, 3, np.random.default_rng(0))


def request_for(problem: Problem, algorithm: str, parameters: dict[str, Any]) -> dict[str, Any]:
    """Return what a job gets that solves a problem."""
    record = problem_to_record(problem)
    return {
        "problem": record, "algorithm": algorithm, "parameters": parameters, "seed": 0, "library_url": None
    }  # fmt: skip


def unlimited() -> WorkContext:
    """Return the context of work that nobody waits for."""
    return WorkContext.in_process(_untold, time_limit_s=None)


def _untold(_progress: Progress) -> None:
    """Nobody waits for a warm-up's progress."""


def _algorithm(name: str) -> None:
    problem = small_problem()
    found = tasks.allocate(request_for(problem, name, _PARAMETERS[name]), unlimited())
    if found.artifact is not None:
        tasks.verify(found.artifact, problem)


def _named(warm_up_of: str) -> None:
    resolve(warm_up_of)(small_problem())


def _bound() -> None:
    bounding.warm_up(small_problem())


def unloading() -> None:
    """Plan unloading, without reasons."""
    problem = small_problem()
    planned = replace(problem, objective=replace(problem.objective, unloading="planned"))
    tasks.allocate_at_once(request_for(planned, "greedy", {}), unlimited())


def planned_reasons() -> None:
    """Find reasons, and the amounts that go with them, where unloading is planned."""
    problem = small_problem()
    planned = replace(problem, objective=replace(problem.objective, unloading="planned"))
    tasks.allocate(request_for(planned, "greedy", {}), unlimited())


def _reloads() -> None:
    """Find reasons where there are bases; with planned loads, and with stocks that are refilled from."""
    problem = small_problem()
    stocked = Base("base-1", 0.5, 0.5, stock=(1.0, 1.0))
    refilled = replace(problem, bases=(stocked,))
    objective = replace(problem.objective, unloading="planned", loading="planned")
    for each in (refilled, replace(refilled, objective=objective)):
        tasks.allocate(request_for(each, "greedy", {}), unlimited())
    for algorithm in ("local_search", "exact"):
        tasks.allocate(request_for(refilled, algorithm, _PARAMETERS[algorithm]), unlimited())
    # What could be brought besides is not worth the way.
    dear = replace(refilled, objective=replace(objective, distance_weight=100.0))
    tasks.allocate(request_for(dear, "greedy", {}), unlimited())


def _promises() -> None:
    """Find reasons where an area is promised, nobody may fly to another one, and the end costs reward."""
    problem = small_problem()
    (carrier, other), (*rest, last) = problem.uavs, problem.targets
    problem = replace(
        problem,
        uavs=(replace(carrier, committed=("area-1",)), other),
        targets=(*rest, replace(last, skills=("winch",))),
        objective=replace(problem.objective, makespan_weight=0.1),
    )
    tasks.allocate(request_for(problem, "local_search", _PARAMETERS["local_search"]), unlimited())


def _combining() -> None:
    problem = small_problem()
    problem = replace(problem, uavs=tuple(replace(u, loadlist=(9.0, 9.0)) for u in problem.uavs))
    parameters = parse_parameters("local_search", {"moves": 40_000, "restarts": 1})
    solver = create_solver("local_search", parameters, protocol.SolverContext(threads=2))
    solver.solve(problem, 0, never, lambda _progress: None)


def _sharing() -> None:
    """Let threads share a plan, which has to have UAVs enough."""
    parameters = parse_parameters("local_search", {"moves": 400, "restarts": 0})
    solver = create_solver("local_search", parameters, protocol.SolverContext(threads=2))
    solver.solve(large_problem(40, 80), 0, never, lambda _progress: None)


def _relinking() -> None:
    """Look for a plan between two, as searches under a time limit do."""
    problem, elite = large_problem(6, 12), Elite()
    search = new_search(compile_problem(problem))
    elite.add(search)
    set_routes(search, greedy_plan(problem).as_array())
    elite.add(search)
    elite.relink(search, np.random.default_rng(0), 0.1, never)


def _evaluation() -> None:
    """Evaluate a plan of nothing, which has reasons, and one that breaks a rule."""
    problem = small_problem()
    problem = replace(problem, uavs=tuple(replace(uav, endurance=0.1) for uav in problem.uavs))
    payload = {"problem": problem_to_record(problem), "at": 0.0}
    evaluating.evaluate({**payload, "assignment": [[3, 3]]}, unlimited())
    with suppress(IllegalPlan):
        evaluating.evaluate({**payload, "assignment": [[0, 3]]}, unlimited())


def geography() -> None:
    """Measure distances on the globe."""
    compile_problem(replace(small_problem(), crs="wgs84"))


PARTS: dict[str, Callable[[], None]] = {
    "greedy": partial(_algorithm, "greedy"),
    "transfer": partial(_named, _TRANSFER),
    "planned unloading": unloading,
    "reasons of planned unloading": planned_reasons,
    **{name: partial(_algorithm, name) for name in _PARAMETERS if name != "greedy"},
    "rest of transfer": partial(_named, _TRANSFER_REST),
    "reloads": _reloads,
    "promises": _promises,
    "combining": _combining,
    "sharing": _sharing,
    "relinking": _relinking,
    "bound": _bound,
    "geography": geography,
    "evaluation": _evaluation,
}
"""What together loads and compiles all there is."""

DEFAULT = ("transfer", "local_search", "greedy", "planned unloading", "geography")
"""Parts that an answer of the default algorithm needs: what takes longest first, then what is
a part of it and is compiled beside it."""

OTHERS = tuple(part for part in PARTS if part not in DEFAULT)
