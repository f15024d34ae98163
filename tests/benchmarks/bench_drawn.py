"""`auto` on problems whose every property is drawn, over the best that anything found: it decides, no family.

Run: ``python tests/benchmarks/bench_drawn.py [--problems 200] [--first 0] [--seconds 1] [--reference 20]
[--beside ga] [--without "large moves"]``. Problems are numbered; those from 10,000 on are kept for judging,
and not looked at while anything is tuned. One core each; limits are processor seconds, so that other work on
the machine disturbs little. With ``--without`` a part of the search is left out beside the whole, in one run.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parent)]

from library_on_trial import library_of, policies_for_every_size  # noqa: E402

from app.allocation.warm_up import load_all  # noqa: E402
from app.domain.problem import Problem  # noqa: E402
from app.simulation.drawn_generator import drawn, drawn_size  # noqa: E402
from app.simulation.evaluation import reward_of  # noqa: E402
from app.solvers.local_search import effort, improvement, temperatures  # noqa: E402
from app.solvers.protocol import SolverContext  # noqa: E402
from app.solvers.registry import create_solver, parse_parameters  # noqa: E402
from app.solvers.scale import common_level, largest_level  # noqa: E402
from app.solvers.stop import Deadline  # noqa: E402

PARTS: dict[str, Callable[[], None]] = {
    "large moves": lambda: setattr(effort, "_LARGE_SHARE", 0.0),
    "gains": lambda: setattr(
        improvement, "gains", lambda arrays, _routes: (largest_level(arrays), common_level(arrays))
    ),
    "distances": lambda: setattr(temperatures, "_COLD_LEGS", math.inf),
    "combining": lambda: setattr(effort, "_LONGEST_COMBINED", -1.0),
}
"""Parts of the search, and how each is left out."""


def problem(number: int) -> Problem:
    """Return the problem of a number."""
    rng = np.random.default_rng([20261129, number])
    return drawn(*drawn_size(rng), rng)


def answer(number: int, algorithm: str, seconds: float, without: str | None, url: str) -> float:
    """Return what an algorithm's plan earns that has some processor seconds."""
    import time  # noqa: PLC0415 - replaced in this process alone

    time.monotonic = time.process_time
    if without:
        PARTS[without]()
    solver = create_solver(algorithm, parse_parameters(algorithm, {}), SolverContext(url))
    asked = problem(number)
    return reward_of(
        asked, solver.solve(asked, 1, Deadline(seconds, time.process_time), lambda _told: None).plan
    )


def rewards(
    numbers: range, url: str, algorithm: str, seconds: float, without: str | None = None
) -> Iterator[float]:
    """Yield what an algorithm earns on each problem, one a core at a time."""
    cores = os.cpu_count() or 1
    with ProcessPoolExecutor(cores, initializer=load_all) as processes:
        # What is compiled or loaded at a first call is not the search's.
        first = partial(answer, algorithm=algorithm, seconds=0.2, without=without, url=url)
        list(processes.map(first, [0] * 2 * cores))
        work = partial(answer, algorithm=algorithm, seconds=seconds, without=without, url=url)
        yield from processes.map(work, numbers)


def main() -> None:
    """Print a row for each algorithm or part."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--problems", type=int, default=200)
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--seconds", type=float, default=1.0)
    options.add_argument("--reference", type=float, default=20.0, help="seconds of `auto` to compare with")
    options.add_argument("--beside", action="append", default=[], help="algorithms in the same time")
    options.add_argument("--without", action="append", default=[], choices=PARTS)
    given = options.parse_args()
    numbers = range(given.first, given.first + given.problems)
    asked = {name: (name, given.seconds, None) for name in ("auto", *given.beside)}
    asked |= {f"without {part}": ("auto", given.seconds, part) for part in given.without}
    if given.reference:
        asked[f"auto, {given.reference:g} s"] = ("auto", given.reference, None)
    with library_of(policies_for_every_size(None)) as url:
        found = {name: np.array(list(rewards(numbers, url, *work))) for name, work in asked.items()}
    best = np.max(list(found.values()), axis=0)
    print(f"{'':<24}{'mean':>8}{'1 %':>8}{'worst':>8}{'ahead of auto':>15}{'by at most':>12}")
    ratios = {
        name: np.divide(earned, best, out=np.ones_like(best), where=best > 0)
        for name, earned in found.items()
    }
    for name, ratio in ratios.items():
        lead = ratio - ratios["auto"]
        print(
            f"{name:<24}{ratio.mean():>8.4f}{np.quantile(ratio, 0.01):>8.4f}{ratio.min():>8.4f}"
            f"{int((lead > 1e-9).sum()):>15}{max(0.0, lead.max()):>12.4f}"
        )


if __name__ == "__main__":
    main()
