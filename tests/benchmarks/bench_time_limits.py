"""Time limits on problems of all shapes: eight algorithms, with planned unloading and a bound and without.

    python tests/benchmarks/bench_time_limits.py [--shapes 1000x1,1x2000] [--algorithms exact,qmix] [--quick]

About 740 requests, one at a time, on fresh workers that are ready for the largest problems there may be. A
row for each shape: how many requests, how many came more than 100 ms late, the latest, and what it was.
Asked: at most 5 of all more than 100 ms late, none more than 0.5 s, none without a plan. An algorithm that
cannot hold a problem says so, and is not counted.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from lateness import ask  # noqa: E402
from live_service import LiveService  # noqa: E402

from app.domain.problem import Problem  # noqa: E402
from app.domain.records import problem_to_record  # noqa: E402
from app.simulation.generator import generate  # noqa: E402
from app.solvers.registry import ALGORITHMS  # noqa: E402

ASKED_S, ASKED_TIMES, ASKED_AT_MOST_S = 0.1, 5, 0.5
QUICK = "1x1", "20x30", "60x120"


class Shape(NamedTuple):
    """A problem, and the time limits it is asked with."""

    m: int
    n: int
    k: int
    steps: int
    limits_s: tuple[float, ...]
    change: Callable[[Problem], Problem] | None = None
    without: tuple[str, ...] = ()


def with_deadlines(problem: Problem) -> Problem:
    """Let some areas be served early, and some hardly at all."""
    rng = np.random.default_rng(5)
    deadlines = rng.uniform(0.05, 2.0, problem.n_targets)
    targets = tuple(
        replace(target, deadline=float(deadline), service_time=0.02)
        for target, deadline in zip(problem.targets, deadlines, strict=True)
    )
    return replace(problem, targets=targets)


def of_identical_uavs(problem: Problem) -> Problem:
    """Let every UAV be as the first, but for its name."""
    return replace(problem, uavs=tuple(replace(problem.uavs[0], id=uav.id) for uav in problem.uavs))


def in_one_place(problem: Problem) -> Problem:
    """Let all be where the first UAV is."""
    x, y = problem.uavs[0].x_s, problem.uavs[0].y_s
    uavs = tuple(replace(uav, x_s=x, y_s=y, x_c=x, y_c=y) for uav in problem.uavs)
    return replace(problem, uavs=uavs, targets=tuple(replace(each, x=x, y=y) for each in problem.targets))


def all_the_same(problem: Problem) -> Problem:
    """Let every area be as the first too, but for its place."""
    first = problem.targets[0]
    targets = tuple(replace(first, id=each.id, x=each.x, y=each.y) for each in problem.targets)
    return of_identical_uavs(replace(problem, targets=targets))


def flying(times: float) -> Callable[[Problem], Problem]:
    """Let ranges be so many times as long."""

    def change(problem: Problem) -> Problem:
        uavs = tuple(replace(uav, voyage=times * uav.voyage) for uav in problem.uavs)
        return replace(problem, uavs=uavs)

    return change


SHAPES = {
    "1x1": Shape(1, 1, 1, 5, (0.05, 0.25)),
    "20x30": Shape(20, 30, 3, 5, (0.1, 0.5)),
    "20x30 S100": Shape(20, 30, 3, 100, (0.25,)),
    "60x120": Shape(60, 120, 3, 5, (0.25,)),
    "60x120 S100": Shape(60, 120, 3, 100, (0.5,)),
    "60x120 deadlines": Shape(60, 120, 3, 5, (0.5,), with_deadlines),
    "1000x1": Shape(1000, 1, 3, 5, (0.1, 0.25)),
    "900x2": Shape(900, 2, 3, 5, (0.25,)),
    "1000x1 K64 S100": Shape(1000, 1, 64, 100, (0.5,)),
    "1x2000": Shape(1, 2000, 3, 5, (0.1, 0.5)),
    "1x2000 K64 S100": Shape(1, 2000, 64, 100, (0.5,)),
    "4x2000": Shape(4, 2000, 3, 5, (0.25,)),
    "300x300": Shape(300, 300, 3, 5, (0.25,)),
    "100x300 S100": Shape(100, 300, 3, 100, (1.0,)),
    "300x600 identical UAVs": Shape(300, 600, 3, 5, (1.0,), of_identical_uavs),
    "300x600 one place": Shape(300, 600, 3, 5, (1.0,), in_one_place),
    "300x600 all the same S100": Shape(300, 600, 3, 100, (1.0,), all_the_same),
    "1000x2000 one place": Shape(1000, 2000, 3, 5, (2.0,), in_one_place, ("dqn",)),
    "1000x2000 S100": Shape(1000, 2000, 3, 100, (2.0,), None, ("dqn",)),
    "1000x2000 K64 S100 long": Shape(1000, 2000, 64, 100, (2.0,), flying(10.0), ("dqn",)),
    "1000x2000 K64 S100 short": Shape(1000, 2000, 64, 100, (2.0,), flying(0.3), ("dqn",)),
    "1000x2000 K64 the same": Shape(1000, 2000, 64, 5, (2.0,), all_the_same, ("dqn", "qmix", "ga")),
}


def main() -> int:
    """Print a row for each shape; 1 where more is late than asked, or a plan is missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shapes", default="", help="with commas; all of them where none is named")
    parser.add_argument("--algorithms", default="", help="the same")
    parser.add_argument("--quick", action="store_true", help="three small shapes")
    given = parser.parse_args()
    names = given.shapes.split(",") if given.shapes else list(QUICK if given.quick else SHAPES)
    algorithms = given.algorithms.split(",") if given.algorithms else list(ALGORITHMS)
    total = late = lacking = 0
    latest = 0.0
    print(f"{'shape':<26} {'requests':>8} {'late':>5} {'no plan':>8} {'latest ms':>10}  which")
    with tempfile.TemporaryDirectory() as folder:
        service = LiveService(Path(folder), workers=2).start().await_ready(workers=2)
        try:
            for name in names:
                found: list[tuple[float, str]] = []
                missing = 0
                for what, request in _requests(SHAPES[name], algorithms):
                    answered = ask(service.port, request)
                    if answered.refused:
                        continue
                    missing += "assignment" not in answered.answer
                    found.append((answered.late_s, what))
                worst, which = max(found, default=(0.0, "-"))
                over = sum(seconds > ASKED_S for seconds, _ in found)
                print(
                    f"{name:<26} {len(found):>8} {over:>5} {missing:>8} {1000 * worst:>10.0f}  {which}",
                    flush=True,
                )
                total, late, lacking = total + len(found), late + over, lacking + missing
                latest = max(latest, worst)
        finally:
            service.stop()
    print(
        f"{total} requests: {late} more than 100 ms late, the latest {latest:.3f} s, {lacking} without a plan"
    )
    return int(late > ASKED_TIMES or latest > ASKED_AT_MOST_S or lacking > 0)


def _requests(shape: Shape, algorithms: list[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    problem = generate("uniform", shape.m, shape.n, shape.k, np.random.default_rng(1))
    problem = replace(problem, max_steps=shape.steps)
    if shape.change is not None:
        problem = shape.change(problem)
    record = problem_to_record(problem)
    for limit_s in shape.limits_s:
        for algorithm in algorithms:
            if algorithm in shape.without:
                continue
            for unloading in ("greedy", "planned"):
                for bound in (False, True):
                    yield (
                        f"{algorithm} {unloading}{' bound' if bound else ''}, limit {limit_s:g} s",
                        {
                            **record,
                            "objective": {**record["objective"], "unloading": unloading},
                            "algorithm": algorithm,
                            "time_limit_s": limit_s,
                            "bound": bound,
                        },
                    )


if __name__ == "__main__":
    sys.exit(main())
