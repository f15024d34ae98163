"""The algorithms for comparison on a folder of problem files: shares of the best known reward.

Run: ``python tests/benchmarks/bench_comparison.py FOLDER [--seconds 1] [--algorithms 'ga bundles']``. A file
has a ``problem``, as a request has it, and ``best_known``, its best known reward. Limits are processor
seconds, so that other work on the machine disturbs little; one thread.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2])]

from app.domain.records import problem_from_record  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.solvers.greedy import greedy_plan  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import ALGORITHMS, create_solver, parse_parameters  # noqa: E402
from app.solvers.stop import Deadline  # noqa: E402

LEARNERS = ("dqn",)
"""For comparison too, but not for problems of these sizes."""


def main() -> None:
    """Print a row a file and a column an algorithm; below, means, and on how many files greedy is beaten."""
    time.monotonic = time.process_time
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("folder", type=Path)
    options.add_argument("--seconds", type=float, default=1.0)
    options.add_argument("--algorithms", default=None, help="with spaces between them; default: all")
    given = options.parse_args()
    names = (given.algorithms or "").split() or [
        name for name, each in ALGORITHMS.items() if each.comparison and name not in LEARNERS
    ]
    print("| file | greedy |", " | ".join(names), "|")
    print("|" + " --- |" * (len(names) + 2))
    shares: dict[str, list[float]] = {name: [] for name in ("greedy", *names)}
    for number, file in enumerate(sorted(given.folder.glob("*.json"))):
        record = json.loads(file.read_text(encoding="utf-8"))
        problem, best = problem_from_record(record["problem"]), record["best_known"]
        shares["greedy"].append(reward_of(problem, greedy_plan(problem)) / best)
        for name in names:
            solver = create_solver(name, parse_parameters(name, {}), SolverContext())
            # What is loaded or compiled at a first call is not the search's.
            for seconds in (0.1, given.seconds) if number == 0 else (given.seconds,):
                stop = Deadline(seconds, time.process_time)
                plan = solver.solve(problem, 1, stop, lambda _told: None).plan
            shares[name].append(reward_of(problem, plan) / best)
        row = " | ".join(f"{found[-1]:.3f}" for found in shares.values())
        print(f"| {file.stem} | {row} |", flush=True)
    print("| mean |", " | ".join(f"{np.mean(found):.3f}" for found in shares.values()), "|")
    greedy = np.array(shares["greedy"])
    above = [int((np.array(shares[name]) > greedy * (1 + 1e-9)).sum()) for name in names]
    print("| above greedy | |", " | ".join(map(str, above)), "|")


if __name__ == "__main__":
    main()
