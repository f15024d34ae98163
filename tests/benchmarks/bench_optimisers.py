"""General optimisers against `auto`: generated problems of every family, the same time, plans replayed.

Run: ``python tests/benchmarks/bench_optimisers.py [--seconds 1] [--sizes 5x10 10x20 20x30] [--problems 2]``.
PyVRP and OR-Tools are an extra: ``pip install -e ".[compare]"``. What they cannot express is listed in
``app/reproduction/general_optimisers.py``. One core each. Every plan is replayed by the tests' referee, an
illegal one counts as 0 and is counted; figures are the mean ratio to the best of the three on each problem.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from statistics import fmean

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1] / "support")]

import numpy as np  # noqa: E402
from referee import Illegal, replay  # noqa: E402

from app.domain.plan import Plan  # noqa: E402
from app.domain.problem import Problem  # noqa: E402
from app.domain.records import problem_to_record  # noqa: E402
from app.reproduction.errors import MissingPackage  # noqa: E402
from app.reproduction.general_optimisers import pyvrp_plan, require, routing_plan  # noqa: E402
from app.simulation.generator import FAMILIES  # noqa: E402
from app.simulation.world_generator import WORLD_FAMILIES  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import create_solver, parse_parameters  # noqa: E402
from app.solvers.stop import Deadline  # noqa: E402


def auto_plan(problem: Problem, seconds: float, seed: int) -> Plan:
    """Let `auto` solve it, without a library."""
    solver = create_solver("auto", parse_parameters("auto", {}), SolverContext())
    return solver.solve(problem, seed, Deadline(seconds), lambda _progress: None).plan


def reloads(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `sorties` with whole needs and windows, where capacity and time are short and range is not."""
    problem = WORLD_FAMILIES["sorties"](n_uavs, n_targets, n_materials, rng)
    most = np.array([t.loadlist for t in problem.targets]).max(axis=0)
    load = tuple((most * float(rng.uniform(1.5, 3.0))).tolist())
    opens = rng.uniform(0, 3.0, n_targets) * (rng.random(n_targets) < 0.7)
    stays = rng.uniform(1.0, 3.0, n_targets)
    targets = tuple(
        replace(t, earliest=float(at), deadline=float(at + stay), service_time=float(rng.uniform(0.02, 0.1)))
        for t, at, stay in zip(problem.targets, opens, stays, strict=True)
    )
    uavs = tuple(replace(u, voyage=1e3, loadlist=load) for u in problem.uavs)
    return replace(problem, uavs=uavs, targets=targets, max_steps=40)


EVERY = {**FAMILIES, **WORLD_FAMILIES, "reloads": reloads}
OPTIMISERS = {"auto": auto_plan, "PyVRP": pyvrp_plan, "OR-Tools": routing_plan}


def main() -> None:
    """Print a row a family."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seconds", type=float, default=1.0)
    options.add_argument("--sizes", nargs="+", default=["5x10", "10x20", "20x30"])
    options.add_argument("--problems", type=int, default=2)
    options.add_argument("--families", nargs="+", default=list(EVERY))
    given = options.parse_args()
    try:
        require("pyvrp")
        require("ortools")
    except MissingPackage as missing:
        sys.exit(str(missing))
    auto_plan(EVERY["uniform"](3, 4, 3, np.random.default_rng(0)), 0.1, 0)
    print(f"{given.seconds} s each; sizes {' '.join(given.sizes)}; {given.problems} problems each")
    print(f"{'family':<14}" + "".join(f"{name:>10}" for name in OPTIMISERS) + f"{'illegal':>10}")
    every: dict[str, list[float]] = defaultdict(list)
    for family in given.families:
        ratios: dict[str, list[float]] = defaultdict(list)
        illegal = 0
        for size in given.sizes:
            m, n = map(int, size.split("x"))
            for number in range(given.problems):
                problem = EVERY[family](m, n, 3, np.random.default_rng([17, m, n, number]))
                record, rewards = problem_to_record(problem), {}
                for name, optimise in OPTIMISERS.items():
                    try:
                        plan = optimise(problem, given.seconds, number)
                        rewards[name] = float(replay(record, plan.assignment)["reward"])
                    except Illegal:
                        rewards[name], illegal = 0.0, illegal + 1
                best = max(rewards.values())
                for name, reward in rewards.items():
                    ratios[name].append(reward / best if best > 0 else 1.0)
        for name in OPTIMISERS:
            every[name] += ratios[name]
        row = "".join(f"{fmean(ratios[name]):>10.3f}" for name in OPTIMISERS)
        print(f"{family:<14}{row}{illegal:>10}", flush=True)
    print(f"{'all':<14}" + "".join(f"{fmean(every[name]):>10.3f}" for name in OPTIMISERS))


if __name__ == "__main__":
    main()
