"""Speed of the simulator and of the solvers on it, beside a plain Python replay.

Run: ``python tests/benchmarks/bench_simulator.py``. One thread; every figure is the best of five runs, since
noise only ever adds.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from referee import replay as slow_replay  # noqa: E402

from app.domain.records import problem_to_record  # noqa: E402
from app.simulation.arrays import compile_problem  # noqa: E402
from app.simulation.evaluation import rewards_of  # noqa: E402
from app.simulation.generator import generate  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import create_solver, parse_parameters  # noqa: E402
from app.solvers.stop import never  # noqa: E402

SIZES = ((5, 10), (10, 20), (20, 30), (100, 300))


def best_of(runs: int, work: Callable[[], object]) -> float:
    """Seconds of the fastest of several runs, after one that is not counted."""
    work()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    """Print the tables."""
    print("UAV decisions a second, replaying greedy plans (uniform family, 3 materials, 5 steps, seed 1)")
    print(f"{'size':>9} {'compiled':>14} {'plain Python':>14} {'times':>7}")
    for m, n in SIZES:
        problem = generate("uniform", m, n, 3, np.random.default_rng(1))
        arrays, record = compile_problem(problem), problem_to_record(problem)
        solver = create_solver("greedy", parse_parameters("greedy", {}), SolverContext())
        plan = solver.solve(problem, 1, never, lambda _: None).plan
        decisions = len(plan.assignment) * m
        batch = np.repeat(plan.as_array()[None], max(1, 400_000 // decisions), axis=0)
        fast = len(batch) * decisions / best_of(5, lambda a=arrays, b=batch: rewards_of(a, b))
        slow = decisions / best_of(5, lambda r=record, p=plan: slow_replay(r, p.assignment))
        print(f"{f'{m}x{n}':>9} {fast:>14,.0f} {slow:>14,.0f} {fast / slow:>7.0f}")

    print("\nMilliseconds of a solver with its default parameters, compiled and warm")
    print(f"{'size':>9} {'greedy':>9} {'ga':>9}")
    for m, n in SIZES:
        problem = generate("uniform", m, n, 3, np.random.default_rng(1))
        row = []
        for name in ("greedy", "ga"):
            solver = create_solver(name, parse_parameters(name, {}), SolverContext())
            row.append(best_of(5, lambda s=solver, p=problem: s.solve(p, 123, never, lambda _: None)))
        print(f"{f'{m}x{n}':>9} " + " ".join(f"{1e3 * seconds:>9.2f}" for seconds in row))


if __name__ == "__main__":
    main()
