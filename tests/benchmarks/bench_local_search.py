"""Speed of the local search from 5 x 5 to 1000 x 2000: what a move costs, and how time and memory grow.

Run: ``python tests/benchmarks/bench_local_search.py [--moves 1000000]``. Processor time of one thread; K = 3,
S = 5, family ``uniform``. ``ready`` is all that comes before the first move: arrays, neighbour lists and the
greedy rule's plan; ``MiB`` is what a search and its problem hold in arrays.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2])]

from app.simulation.arrays import compile_problem  # noqa: E402
from app.simulation.generator import generate  # noqa: E402
from app.solvers.greedy import greedy_plan  # noqa: E402
from app.solvers.local_search.annealing import Search, new_search, set_routes  # noqa: E402
from app.solvers.local_search.improvement import Cooling, improve  # noqa: E402
from app.solvers.stop import never  # noqa: E402

SIZES = (
    (5, 5), (5, 10), (10, 20), (20, 30), (50, 100), (100, 300), (300, 1000), (1000, 2000),
)  # fmt: skip


def main() -> None:
    """Print a row a size."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--moves", type=int, default=1_000_000)
    moves = options.parse_args().moves
    ready(5, 5)
    print(
        f"{'M x N':>12} {'moves/s':>10} {'ns a move':>10} {'growth':>7} {'greedy':>10} {'after':>10} "
        f"{'ready s':>8} {'MiB':>8}"
    )
    first = None
    for m, n in SIZES:
        start = time.process_time()
        search = ready(m, n)
        readiness = time.process_time() - start
        greedy = float(search.best[0])
        rng = np.random.default_rng(1)
        improve(search, rng, 1000, 1, Cooling(), never, lambda *_told: None)
        start = time.process_time()
        improve(search, rng, moves, 1, Cooling(), never, lambda *_told: None)
        seconds = time.process_time() - start
        first = seconds if first is None else first
        print(
            f"{f'{m} x {n}':>12} {moves / seconds:>10,.0f} {1e9 * seconds / moves:>10.0f} "
            f"{seconds / first:>7.2f} {greedy:>10.3f} {float(search.best[0]):>10.3f} {readiness:>8.3f} "
            f"{held(search) / 2**20:>8.1f}",
            flush=True,
        )


def ready(m: int, n: int) -> Search:
    """Return a search of a generated problem that has the greedy rule's plan."""
    problem = generate("uniform", m, n, 3, np.random.default_rng(1))
    search = new_search(compile_problem(problem))
    set_routes(search, greedy_plan(problem).as_array())
    return search


def held(search: Search) -> int:
    """Return the bytes of its arrays."""
    parts = (search.arrays, search.near, search.routes, search.change, search[4:7])
    return sum(array.nbytes for part in parts for array in part)


if __name__ == "__main__":
    main()
