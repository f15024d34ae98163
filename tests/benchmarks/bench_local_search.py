"""Speed of the local search from 5 x 10 to 1000 x 2000: what a move costs, and what a second of moves brings.

Run: ``python tests/benchmarks/bench_local_search.py``. Processor time of one thread;
K = 3, S = 5, family ``uniform``.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2])]

from app.simulation.arrays import compile_problem  # noqa: E402
from app.simulation.generator import generate  # noqa: E402
from app.solvers.greedy import greedy_plan  # noqa: E402
from app.solvers.local_search.annealing import new_search, set_routes  # noqa: E402
from app.solvers.local_search.improvement import Cooling, improve  # noqa: E402
from app.solvers.stop import never  # noqa: E402

SIZES = ((5, 10), (10, 20), (20, 30), (50, 100), (100, 300), (300, 1000), (1000, 2000))
MOVES = 1_000_000


def main() -> None:
    """Print a row a size."""
    print(f"{'M x N':>12} {'moves/s':>10} {'ns a move':>10} {'greedy':>10} {'after 1M':>10}")
    for m, n in SIZES:
        problem = generate("uniform", m, n, 3, np.random.default_rng(1))
        search = new_search(compile_problem(problem))
        set_routes(search, greedy_plan(problem).as_array())
        greedy = float(search.best[0])
        rng = np.random.default_rng(1)
        improve(search, rng, 1000, 1, Cooling(), never, lambda *_told: None)
        start = time.process_time()
        improve(search, rng, MOVES, 1, Cooling(), never, lambda *_told: None)
        seconds = time.process_time() - start
        print(
            f"{f'{m} x {n}':>12} {MOVES / seconds:>10,.0f} {1e9 * seconds / MOVES:>10.0f} "
            f"{greedy:>10.3f} {float(search.best[0]):>10.3f}"
        )


if __name__ == "__main__":
    main()
