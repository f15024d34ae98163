"""Allocation without a server: what UAVs that agree by messages lose against a centre.

Run: ``python tests/benchmarks/bench_messages.py [--problems 20]``. The centre is a long local search.
Problems are of the families `uniform` and `clustered`, 10 UAVs and 20 areas.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2])]

from app.simulation.evaluation import reward_of  # noqa: E402
from app.simulation.generator import generate  # noqa: E402
from app.solvers.comparison_parameters import BundleParameters, ContractNetParameters  # noqa: E402
from app.solvers.greedy import greedy_plan  # noqa: E402
from app.solvers.markets.agree import agree  # noqa: E402
from app.solvers.markets.solver import BundleSolver, ContractNetSolver  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import create_solver, parse_parameters  # noqa: E402
from app.solvers.stop import never  # noqa: E402

SIZE = (10, 20, 3)
RANGES = (None, 0.5, 0.25, 0.0)
"""Of communication, in extents of the problem."""

TROUBLES = ({}, {"message_delay": 3}, {"message_loss": 0.2}, {"message_loss": 0.5})
METHODS = (
    ("contract net", ContractNetSolver, ContractNetParameters),
    ("bundles", BundleSolver, BundleParameters),
)


def main() -> None:
    """Print a row a family, method, range and trouble."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--problems", type=int, default=20)
    given = options.parse_args()
    columns = ("family", "method", "range", "messages", "share", "lowest", "sent", "rounds", "conflicts")
    print("|", " | ".join(columns), "|")
    print("|" + " --- |" * len(columns))
    for family in ("uniform", "clustered"):
        problems = [
            generate(family, *SIZE, np.random.default_rng([27, number])) for number in range(given.problems)
        ]
        centre = create_solver("local_search", parse_parameters("local_search", {}), SolverContext())
        best = [reward_of(each, centre.solve(each, 1, never, lambda _told: None).plan) for each in problems]
        rule = np.mean([reward_of(e, greedy_plan(e)) / b for e, b in zip(problems, best, strict=True)])
        print(f"| {family} | greedy rule, at a centre | | | {rule:.3f} | | | | |")
        for name, solver, parameters in METHODS:
            for reach in RANGES:
                for trouble in TROUBLES if reach is None else TROUBLES[:1]:
                    found = []
                    for number, problem in enumerate(problems):
                        range_ = None if reach is None else reach * problem.extent
                        market = solver(parameters(communication_range=range_, **trouble), SolverContext())
                        found.append(agree(problem, market, number))
                    shares = [agreed.reward / b for agreed, b in zip(found, best, strict=True)]
                    means = [np.mean([getattr(each, of) for each in found]) for of in ("messages", "rounds")]
                    conflicts = np.mean([each.conflicts for each in found])
                    how = ", ".join(f"{key.removeprefix('message_')} {v}" for key, v in trouble.items())
                    print(
                        f"| {family} | {name} | {'all hear all' if reach is None else reach} | "
                        f"{how or 'all arrive at once'} | {np.mean(shares):.3f} | {min(shares):.3f} | "
                        f"{means[0]:.0f} | {means[1]:.0f} | {conflicts:.1f} |",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
