"""What the learned policy's starts add to `auto`: with and without them, by size and time limit.

Run: ``python tests/benchmarks/bench_auto.py [--seconds 0.25 1 5] [--sizes 5x10 20x30] [--problems 8]``. Uses
the library that is shipped; families in turn, generated problems that no policy was trained on. One process,
warmed up before the first measurement, as a worker is. Prints the mean ratio to the better of the two on each
problem, how often each was better, and whether `auto` would ask the policy on its own.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from statistics import fmean

sys.path[:0] = [str(Path(__file__).parents[2])]

import numpy as np  # noqa: E402

from app.domain.problem import Problem  # noqa: E402
from app.learning.auto import policy_pays  # noqa: E402
from app.library.seeding import seed_library  # noqa: E402
from app.simulation.arrays import compile_problem  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.simulation.generator import FAMILIES, generate  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import create_solver, parse_parameters  # noqa: E402
from app.solvers.stop import Deadline  # noqa: E402
from policy_store.database import Database  # noqa: E402
from policy_store.library import PolicyLibrary  # noqa: E402


def main() -> None:
    """Print a row a size and time limit."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seconds", type=float, nargs="+", default=[0.25, 1.0, 5.0])
    options.add_argument("--sizes", nargs="+", default=["5x10", "10x20", "20x30", "50x100", "100x300"])
    options.add_argument("--problems", type=int, default=8)
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        context = SolverContext(library(Path(folder)))
        solve(generate("uniform", 3, 4, 3, np.random.default_rng(0)), context, 1.0, policy=True)
        print(f"{'size':>9}{'s':>6}{'with':>9}{'without':>9}{'better':>8}{'worse':>7}  asks")
        for size in given.sizes:
            m, n = map(int, size.split("x"))
            for seconds in given.seconds:
                rewards = []
                for number in range(given.problems):
                    family = list(FAMILIES)[number % len(FAMILIES)]
                    problem = generate(family, m, n, 3, np.random.default_rng([29, m, n, number]))
                    rewards.append(
                        [solve(problem, context, seconds, policy=policy) for policy in (True, False)]
                    )
                best = [max(*pair, 1e-12) for pair in rewards]
                ratios = [
                    fmean(pair[which] / top for pair, top in zip(rewards, best, strict=True))
                    for which in (0, 1)
                ]
                better = sum(with_ > without + 1e-9 for with_, without in rewards)
                worse = sum(with_ < without - 1e-9 for with_, without in rewards)
                asks = policy_pays(compile_problem(problem), seconds)
                print(
                    f"{size:>9}{seconds:>6.2f}{ratios[0]:>9.4f}{ratios[1]:>9.4f}{better:>8}{worse:>7}"
                    f"  {'yes' if asks else 'no'}",
                    flush=True,
                )


def solve(problem: Problem, context: SolverContext, seconds: float, *, policy: bool) -> float:
    """Return the reward that `auto` finds."""
    solver = create_solver("auto", parse_parameters("auto", {"policy": policy}), context)
    return reward_of(problem, solver.solve(problem, 1, Deadline(seconds), lambda _progress: None).plan)


def library(folder: Path) -> str:
    """Make a library of the shipped policies and return its address."""
    url = f"sqlite:///{folder / 'library.sqlite3'}"
    database = Database(url)
    store = PolicyLibrary(database)
    store.migrate()
    seed_library(store, database)
    database.dispose()
    return url


if __name__ == "__main__":
    main()
