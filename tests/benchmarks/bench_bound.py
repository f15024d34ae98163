"""Bounds: held against brute force on many small problems, and their gaps on the paper's sizes.

Run: ``python tests/benchmarks/bench_bound.py [--problems 10000] [--first 0] [--seconds 10] [--each 10]``. One
thread.

The first part tries every plan of random small problems with every option of the specification, under greedy
and under planned unloading, and stops at the first bound below the best. Every problem has a seed of its own,
``[2022, number]``, so the 10,000 can be done in portions: ``--first 2500 --problems 2500 --each 0`` is the
second quarter. The second takes the plan of the
local search under greedy unloading; its gap has two parts: what the search misses, and what planned unloading
could bring. ``exact`` tells them apart.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1] / "support")]

from brute_force import best_reward  # noqa: E402
from brute_force_unloading import best_planned_reward  # noqa: E402
from problems import random_problem  # noqa: E402

from app.domain.problem import Problem  # noqa: E402
from app.domain.records import problem_to_record  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.simulation.generator import generate  # noqa: E402
from app.solvers.bound.upper_bound import gap, upper_bound  # noqa: E402
from app.solvers.exact import Exact  # noqa: E402
from app.solvers.greedy import greedy_plan  # noqa: E402
from app.solvers.local_search.solver import LocalSearch  # noqa: E402
from app.solvers.parameters import ExactParameters, LocalSearchParameters  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.stop import Deadline, never  # noqa: E402

SIZES = ((5, 5), (5, 10), (10, 5), (10, 10))
FAMILIES = ("uniform", "clustered", "deadline")


def check_small(first: int, count: int) -> None:
    """Hold bounds of random small problems against brute force; raises at the first that is too low."""
    loose = 0
    start = time.perf_counter()
    for number in range(first, first + count):
        problem = small_problem(number)
        record = problem_to_record(problem)
        greedy, planned = best_reward(record), best_planned_reward(record)
        for reward in (None, reward_of(problem, greedy_plan(problem))):
            value = upper_bound(problem, reward, never).value
            for best in (greedy, planned):
                if value < best - 1e-12 * abs(best):
                    raise AssertionError(f"number {number}: bound {value!r} below {best!r}: {record}")
        loose += value > planned + 1e-6 * max(1.0, abs(planned))
        if (number + 1 - first) % 500 == 0:
            print(f"... {first} to {number}: no bound too low, {loose} loose", flush=True)
    print(
        f"numbers {first} to {first + count - 1}: {count} problems, 0 bounds too low under either rule, "
        f"{loose} above the planned optimum, {time.perf_counter() - start:.0f} s",
        flush=True,
    )


def small_problem(number: int) -> Problem:
    """Return a random problem whose plans are few enough to try them all."""
    rng = np.random.default_rng([2022, number])
    while True:
        problem = random_problem(rng, max_uavs=3, max_targets=3)
        if (problem.n_targets + 1) ** (problem.n_uavs * problem.max_steps) <= 4**5:
            return problem


def gaps(seconds: float, each: int) -> None:
    """Print a row a family and size."""
    print(
        f"{'family':>10} {'M x N':>7} {'gap %':>7} {'worst':>7} {'tight':>6} {'s':>6} {'exact %':>8} "
        f"{'proven':>7}"
    )
    everything = []
    for family in FAMILIES:
        for m, n in SIZES:
            rows = [_row(family, m, n, seed, seconds) for seed in range(each)]
            found = np.array(rows)
            everything.extend(found[:, 0])
            print(
                f"{family:>10} {f'{m} x {n}':>7} {100 * found[:, 0].mean():>7.2f} "
                f"{100 * found[:, 0].max():>7.2f} {int(found[:, 1].sum()):>6} {found[:, 2].mean():>6.2f} "
                f"{100 * found[:, 3].mean():>8.3f} {int(found[:, 4].sum()):>7}",
                flush=True,
            )
    print(f"mean gap {100 * np.mean(everything):.2f} %")


def _row(family: str, m: int, n: int, seed: int, seconds: float) -> tuple[float, float, float, float, float]:
    problem = generate(family, m, n, 3, np.random.default_rng([seed, m, n]))
    search = LocalSearch(LocalSearchParameters(), SolverContext())
    reward = reward_of(problem, search.solve(problem, 1, never, lambda _told: None).plan)
    start = time.perf_counter()
    bound = upper_bound(problem, reward, Deadline(seconds))
    taken = time.perf_counter() - start
    solution = Exact(ExactParameters(), SolverContext()).solve(
        problem, 1, Deadline(seconds), lambda _told: None
    )
    assert solution.proof is not None
    best = gap(solution.proof.bound, reward_of(problem, solution.plan)) or 0.0
    return gap(bound.value, reward) or 0.0, bound.tight, taken, best, solution.proof.proven


def main() -> None:
    """Check, then measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--each", type=int, default=10)
    given = parser.parse_args()
    if given.problems:
        check_small(given.first, given.problems)
    if given.each:
        gaps(given.seconds, given.each)


if __name__ == "__main__":
    main()
