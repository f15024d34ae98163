"""How late answers come when many requests with a time limit come at once, more than there are workers.

    python tests/benchmarks/bench_busy.py [--rounds 3] [--workers 2] [--quick]

A row for each case and round: how late the answers were at the median and at the latest, how many there were
without a plan, and whose plans they were. Generated problems (family `uniform`, 3 materials). Asked of the
first case: the latest 0.3 s late, each with `answered_by`.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from lateness import ask_at_once  # noqa: E402
from live_service import SMALL, LiveService  # noqa: E402

from app.domain.records import problem_to_record  # noqa: E402
from app.simulation.generator import generate  # noqa: E402

ASKED_S = 0.3


class Case(NamedTuple):
    """So many requests of a size at once."""

    requests: int
    uavs: int
    areas: int
    limit_s: float
    everything: bool = False
    """Planned unloading and a bound too."""


CASES = (
    Case(60, 5, 10, 1.0),
    Case(60, 5, 10, 1.0, everything=True),
    Case(30, 100, 300, 1.0),
    Case(30, 100, 300, 1.0, everything=True),
    Case(12, 1000, 2000, 2.0),
)
QUICK = CASES[:2]


def main() -> int:
    """Print a row for each case and round; 1 where the first is later than asked, or a plan is missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="the small problems, once")
    given = parser.parse_args()
    failures = 0
    print(f"{'case':<26} {'limit s':>7} {'median s':>9} {'latest s':>9} {'no plan':>8}  answered by")
    with tempfile.TemporaryDirectory() as folder:
        settings = {"workers": given.workers, "queue_limit": 64, **(SMALL if given.quick else {})}
        service = LiveService(Path(folder), **settings).start().await_ready(workers=given.workers)
        try:
            for case in QUICK if given.quick else CASES:
                for _ in range(1 if given.quick else given.rounds):
                    failures += _row(service.port, case)
        finally:
            service.stop()
    return 1 if failures else 0


def _row(port: int, case: Case) -> int:
    requests = []
    for seed in range(case.requests):
        problem = generate("uniform", case.uavs, case.areas, 3, np.random.default_rng(seed))
        if case.everything:
            problem = replace(problem, objective=replace(problem.objective, unloading="planned"))
        requests.append(
            problem_to_record(problem)
            | {"algorithm": "auto", "seed": seed, "time_limit_s": case.limit_s, "bound": case.everything}
        )
    answers = ask_at_once(port, requests)
    late = [each.late_s for each in answers]
    lacking = sum(each.status != 200 or not each.answer.get("answered_by") for each in answers)
    by = Counter(each.answer.get("answered_by", each.answer.get("type")) for each in answers)
    name = f"{case.requests} x {case.uavs}x{case.areas}{' planned, bound' if case.everything else ''}"
    print(
        f"{name:<26} {case.limit_s:>7g} {statistics.median(late):>9.3f} {max(late):>9.3f} {lacking:>8}  "
        + ", ".join(f"{algorithm} {count}" for algorithm, count in by.most_common()),
        flush=True,
    )
    return int(lacking > 0 or (case == CASES[0] and max(late) > ASKED_S))


if __name__ == "__main__":
    sys.exit(main())
