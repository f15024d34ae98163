"""`auto` on kinds of problems where searches have been weak, beside what others find in the same time.

Run: ``python tests/benchmarks/bench_kinds.py [--problems 30] [--first 0] [--seconds 1] [--reference 10]
[--beside ga transfer_qmix] [--kinds "one village"]``. Rewards are over the best that anything found, `auto`
in the seconds of the reference among it. One core each; limits are processor seconds. Problems from number
1000 on are kept for judging.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parent)]

from library_on_trial import library_of, policies_for_every_size  # noqa: E402
from problem_kinds import HARD_KINDS  # noqa: E402

from app.allocation.warm_up import load_all  # noqa: E402
from app.domain.problem import Problem  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import create_solver, parse_parameters  # noqa: E402
from app.solvers.stop import Deadline  # noqa: E402

STREAM = 90_000_049


def problem_of(kind: str, number: int) -> Problem:
    """Return the problem of a number."""
    return HARD_KINDS[kind](number, np.random.default_rng([STREAM, number, *kind.encode()]))


def answer(kind: str, number: int, algorithm: str, seconds: float, url: str) -> float:
    """Return what an algorithm's plan earns that has some processor seconds."""
    time.monotonic = time.process_time
    problem = problem_of(kind, number)
    solver = create_solver(algorithm, parse_parameters(algorithm, {}), SolverContext(url))
    limit = Deadline(seconds, time.process_time)
    return reward_of(problem, solver.solve(problem, 1, limit, lambda _told: None).plan)


def row(pool: ProcessPoolExecutor, kind: str, given: argparse.Namespace, url: str) -> Iterator[str]:
    """Yield the line of a kind, and one for each algorithm that is ahead of `auto` somewhere."""
    numbers = range(given.first, given.first + given.problems)
    asked = [("auto", given.seconds), ("auto", given.reference), *((a, given.seconds) for a in given.beside)]
    futures = [
        [pool.submit(answer, kind, number, name, seconds, url) for number in numbers]
        for name, seconds in asked
    ]
    earned = np.array([[future.result() for future in each] for each in futures])
    best = earned.max(axis=0)
    ratios = np.divide(earned, best, out=np.ones_like(earned), where=best > 0)
    ours = ratios[0]
    yield (
        f"{kind:<24}{ours.mean():>8.4f}{ours.min():>8.4f}  lowest: "
        + ", ".join(f"{numbers[place]} ({ours[place]:.3f})" for place in np.argsort(ours)[:3])
    )
    for (name, _), theirs in zip(asked[2:], ratios[2:], strict=True):
        ahead = [
            f"{numbers[place]} (+{theirs[place] - ours[place]:.4f})"
            for place in np.flatnonzero(theirs > ours + 1e-9)
        ]
        figures = f"{theirs.mean():>8.4f}{theirs.min():>8.4f}"
        yield f"    {name:<20}{figures}  ahead: {', '.join(ahead) or 'nowhere'}"


def main() -> None:
    """Print the rows."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--problems", type=int, default=30)
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--seconds", type=float, default=1.0)
    options.add_argument("--reference", type=float, default=10.0)
    options.add_argument("--beside", nargs="*", default=["ga", "transfer_qmix"])
    options.add_argument("--kinds", nargs="+", default=list(HARD_KINDS), choices=list(HARD_KINDS))
    options.add_argument("--workers", type=int, default=os.cpu_count())
    given = options.parse_args()
    with (
        library_of(policies_for_every_size(None)) as url,
        ProcessPoolExecutor(given.workers, initializer=load_all) as pool,
    ):
        # What is compiled or loaded at a first call is not the search's.
        for algorithm in ("auto", *given.beside):
            first = [
                pool.submit(answer, given.kinds[0], 0, algorithm, 0.3, url) for _ in range(2 * given.workers)
            ]
            _ = [each.result() for each in first]
        for kind in given.kinds:
            for line in row(pool, kind, given, url):
                print(line, flush=True)


if __name__ == "__main__":
    main()
