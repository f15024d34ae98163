"""The public multi-UAV benchmark of Xiao et al. (arXiv:2009.00363): an extended team orienteering problem.

Open routes from one depot, speeds of 10, 15 or 30, service times, a time limit on arrival (the service at a
route's last target may end after it, as the benchmark's algorithms count); 5 UAVs and 30 targets, 10 and 60,
15 and 90. In our terms: one material, of which every target needs 1 and every UAV carries enough for all; the
level is the reward; the deadline is the time limit; ``return_to_base`` is false, range unlimited, distance
free, and there is a step for every target up to the specification's 100. Drawn as the benchmark's enhanced
version does, seeds 37 i + 13.

Run: ``python tests/benchmarks/bench_top.py [--seconds 1] [--cut 0.4] [--threads 1] [--pyvrp] [--bound 10]``.
With ``--cut`` the time limit is that share of the original, so that not everything can be collected. Every
plan is replayed by the referee of the tests. ``--pyvrp`` solves each problem with PyVRP too, in the same time
and on one core (``pip install -e ".[compare]"``). ``--bound 10`` prints what no plan exceeds, as far as it is
known after ten seconds, and how long that took.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1] / "support")]

from referee import replay  # noqa: E402

from app.domain.plan import Plan  # noqa: E402
from app.domain.problem import UAV, Objective, Problem, Target  # noqa: E402
from app.domain.records import problem_to_record  # noqa: E402
from app.reproduction.errors import MissingPackage  # noqa: E402
from app.reproduction.general_optimisers import pyvrp_plan, require  # noqa: E402
from app.solvers.bound.upper_bound import upper_bound  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import create_solver, parse_parameters  # noqa: E402
from app.solvers.stop import Deadline  # noqa: E402

SIZES = {"small": (5, 30, 5_000), "medium": (10, 60, 10_000), "large": (15, 90, 15_000)}
SPEEDS = (10.0, 15.0, 30.0)
PROBLEMS = 5

PUBLISHED = {"small": (178, 154, 167, 133, 154)}
"""The best rewards of the enhanced version's own table; 20 to 160 s on 16 cores."""

PYVRP_5_S = {"small": (179, 162, 176, 140, 155)}
"""PyVRP 0.14 in 5 s on one core; on medium and large it collects everything."""


def generate_top(size: str, number: int, share: float = 1.0) -> Problem:
    """Return problem `number` of a size, its time limit multiplied by a share."""
    m, n, side = SIZES[size]
    rng = random.Random(37 * number + 13)
    speeds = [SPEEDS[rng.randint(0, 2)] for _ in range(m)]
    limit = share * side / SPEEDS[1]
    targets = []
    for j in range(n):
        # Positions are whole numbers around the depot in the middle.
        x, y = (rng.randint(1, side) - side // 2 for _ in range(2))
        reward, service = rng.randint(1, 10), rng.randint(5, 30)
        targets.append(
            Target(
                f"target-{j + 1}",
                float(x),
                float(y),
                float(reward),
                (1.0,),
                deadline=limit,
                service_time=float(service),
            )
        )
    uavs = tuple(
        UAV(f"uav-{i + 1}", 0.0, 0.0, 0.0, 0.0, speed, 4.0 * limit * speed, (float(n),))
        for i, speed in enumerate(speeds)
    )
    objective = Objective(distance_weight=0.0, return_to_base=False)
    return Problem(uavs, tuple(targets), max_steps=min(n, 100), objective=objective)


def solve(problem: Problem, algorithm: str, seconds: float, threads: int = 1) -> Plan:
    """Let one of our algorithms solve it."""
    solver = create_solver(algorithm, parse_parameters(algorithm, {}), SolverContext(threads=threads))
    return solver.solve(problem, 1, Deadline(seconds), lambda _progress: None).plan


def main() -> None:
    """Print a row a problem and the sums."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seconds", type=float, default=1.0)
    options.add_argument("--cut", type=float, default=1.0)
    options.add_argument("--algorithm", default="auto")
    options.add_argument("--threads", type=int, default=1, help="cores of our search; PyVRP has one")
    options.add_argument("--pyvrp", action="store_true")
    options.add_argument("--bound", type=float, default=0.0, help="seconds for an upper bound")
    given = options.parse_args()
    if given.pyvrp:
        try:
            require("pyvrp")
        except MissingPackage as missing:
            sys.exit(str(missing))
    # What is compiled or loaded at a first call is not the search's; its limit may end it before the search.
    for _ in range(2):
        solve(generate_top("small", 0), given.algorithm, 0.1)
    print(f"{given.algorithm}, {given.seconds} s, {given.threads} threads, time limit x {given.cut}")
    heads = {"all": 6, "ours": 8, "PyVRP": 8, "PyVRP 5 s": 11, "published": 11, "s": 7, "bound": 8, "s ": 7}
    print(f"{'problem':<12}" + "".join(f"{head:>{width}}" for head, width in heads.items()))
    sums = [0.0, 0.0]
    for size in SIZES:
        for number in range(PROBLEMS):
            problem = generate_top(size, number, given.cut)
            record = problem_to_record(problem)
            begin = time.perf_counter()
            ours = reward(record, solve(problem, given.algorithm, given.seconds, given.threads))
            took = time.perf_counter() - begin
            theirs = reward(record, pyvrp_plan(problem, given.seconds, 1)) if given.pyvrp else float("nan")
            begin = time.perf_counter()
            bound = upper_bound(problem, ours, Deadline(given.bound)).value if given.bound else float("nan")
            bounding = time.perf_counter() - begin
            sums = [sums[0] + ours, sums[1] + theirs]
            everything = sum(target.level for target in problem.targets)
            known = [
                f"{table[size][number]}" if given.cut == 1.0 and size in table else "-"
                for table in (PYVRP_5_S, PUBLISHED)
            ]
            print(
                f"{size} {number:<6}{everything:>6.0f}{ours:>8.0f}{theirs:>8.0f}{known[0]:>11}{known[1]:>11}"
                f"{took:>7.2f}{bound:>8.1f}{bounding:>7.2f}",
                flush=True,
            )
    print(f"{'sum':<18}{sums[0]:>8.0f}{sums[1]:>8.0f}")


def reward(record: dict[str, object], plan: Plan) -> float:
    """Replay a plan by the independent referee."""
    return float(replay(record, plan.assignment)["reward"])


if __name__ == "__main__":
    main()
