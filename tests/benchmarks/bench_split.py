"""Split deliveries where everything must be served, over the best known distances.

Run: ``python tests/benchmarks/bench_split.py [--seconds 5] [--threads 2] [--seeds 1] [--only 1 5 9]``.
The 21 problems of Chen, Golden and Wasil (The split delivery vehicle routing problem, Networks 49(4), 2007):
customers on rings around a depot need 60 or 90, and a vehicle carries 100. There is one vehicle more than the
units need. A level far above any distance asks for every unit, unloading is planned, the way home counts, and
a distance weight of 1 leaves the length to be shortened. Best known distances as they are commonly reported.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2])]

from app.allocation import tasks  # noqa: E402
from app.domain.problem import UAV, Objective, Problem, Target  # noqa: E402
from app.domain.records import problem_to_record  # noqa: E402
from app.jobs.worker import WorkContext  # noqa: E402

CARRIED, LEVEL = 100.0, 10_000.0

PROBLEMS = (
    (4, 2, 228.28), (4, 4, 708.28), (8, 2, 430.58), (12, 2, 631.05), (8, 4, 1390.57), (16, 2, 831.24),
    (4, 10, 3640.00), (4, 12, 5068.28), (12, 4, 2044.20), (16, 4, 2684.88), (4, 20, 13280.00),
    (8, 10, 7213.61), (8, 12, 10105.86), (12, 10, 10717.53), (12, 12, 15094.48), (72, 2, 3379.33),
    (8, 20, 26493.56), (16, 10, 14202.53), (16, 12, 19995.69), (12, 20, 39635.51), (72, 4, 11271.06),
)  # fmt: skip
"""Customers of a ring, rings, best known distance."""


def problem_of(around: int, rings: int) -> Problem:
    """Return a problem with so many customers of each of so many rings."""
    targets = []
    for ring in range(1, rings + 1):
        for i in range(around):
            angle, need = 2.0 * i * math.pi / around, 90.0 if i % 4 in (1, 2) else 60.0
            x, y = 10.0 * ring * math.cos(angle), 10.0 * ring * math.sin(angle)
            targets.append(Target(f"area-{len(targets) + 1}", x, y, LEVEL, (need,)))
    needed = math.ceil(sum(target.loadlist[0] for target in targets) / CARRIED)
    uavs = (UAV(f"uav-{i + 1}", 0.0, 0.0, 0.0, 0.0, 1.0, 1e5, (CARRIED,)) for i in range(needed + 1))
    objective = Objective(distance_weight=1.0, charge_return=True, unloading="planned")
    return Problem(tuple(uavs), tuple(targets), objective=objective, max_steps=8)


def length_of(problem: Problem, seed: int, given: argparse.Namespace) -> float:
    """Return how long the routes of an answer are; what is not served counts as its level."""
    request = {
        "problem": problem_to_record(problem), "algorithm": "auto", "parameters": {}, "seed": seed,
        "library_url": None, "threads": given.threads,
    }  # fmt: skip
    context = WorkContext.in_process(lambda _told: None, time_limit_s=given.seconds)
    return LEVEL * problem.n_targets - float(tasks.allocate(request, context).result["reward"])


def main() -> None:
    """Print a line a problem, and the mean."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seconds", type=float, default=5.0)
    options.add_argument("--threads", type=int, default=2)
    options.add_argument("--seeds", type=int, default=1)
    options.add_argument("--only", type=int, nargs="+", default=range(1, len(PROBLEMS) + 1))
    given = options.parse_args()
    # What is loaded or compiled at a first call is not the search's.
    length_of(problem_of(4, 2), 0, given)
    over = []
    for number in given.only:
        around, rings, best = PROBLEMS[number - 1]
        problem, begun = problem_of(around, rings), time.perf_counter()
        lengths = np.array([length_of(problem, seed, given) for seed in range(given.seeds)])
        seconds = (time.perf_counter() - begun) / given.seeds
        over.extend(100.0 * (lengths / best - 1.0))
        size = f"{problem.n_uavs:>5} x {problem.n_targets:<4}"
        lowest = f"{lengths.min():>10.2f} of {best:>9.2f}"
        print(
            f"{number:>2}{size}{lowest}{np.mean(over[-given.seeds :]):>7.2f} %{seconds:>6.2f} s", flush=True
        )
    print(f"mean {np.mean(over):.2f} %, worst {np.max(over):.2f} %")


if __name__ == "__main__":
    main()
