"""How many of the reasons for unmet needs are verified under a time limit, and how late the answers come.

    python tests/benchmarks/bench_reasons.py [--quick]

112 requests, one at a time, on warm workers: `auto`, `local_search`, `transfer_qmix` and `exact`; Cyclone
Idai and six other problems; limits of 0.5, 1, 2 and 5 s. Asked: at least 95 % of the unmet areas verified,
and no answer more than 100 ms late.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from lateness import ask  # noqa: E402
from live_service import SMALL, LiveService  # noqa: E402

from app.api.openapi_examples import example_problem  # noqa: E402
from app.domain.records import problem_to_record  # noqa: E402
from app.simulation.generator import generate  # noqa: E402

ALGORITHMS = "auto", "local_search", "transfer_qmix", "exact"
LIMITS_S, QUICK_LIMITS_S = (0.5, 1.0, 2.0, 5.0), (0.5, 1.0)
ASKED_SHARE, ASKED_S = 0.95, 0.1


def problems() -> dict[str, dict[str, Any]]:
    """Return the problems by name."""
    rng = np.random.default_rng(20)
    made = {
        f"{family} {m}x{n}": problem_to_record(generate(family, m, n, k, rng))
        for family, m, n, k in (
            ("uniform", 2, 3, 1),
            ("uniform", 5, 10, 2),
            ("clustered", 8, 16, 3),
            ("uniform", 20, 30, 3),
            ("clustered", 40, 80, 2),
        )
    }
    return {name: example_problem(name) for name in ("cyclone-idai", "paper-5x10")} | made


def main() -> int:
    """Print a row for each algorithm and problem; 1 where less is verified, or one is later, than asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two limits, two problems")
    given = parser.parse_args()
    limits_s = QUICK_LIMITS_S if given.quick else LIMITS_S
    chosen = dict(list(problems().items())[: 2 if given.quick else None])
    verified = unmet = late = requests = 0
    print(f"{'algorithm':<14} {'problem':<18} {'verified':>8} {'unmet':>6} {'pending':>8} {'latest ms':>10}")
    with tempfile.TemporaryDirectory() as folder:
        service = LiveService(Path(folder), workers=2, **SMALL).start().await_ready(workers=2)
        try:
            for algorithm in ALGORITHMS:
                for name, problem in chosen.items():
                    row = [
                        ask(service.port, problem | {"algorithm": algorithm, "time_limit_s": limit_s})
                        for limit_s in limits_s
                    ]
                    areas = [area for each in row for area in each.answer["unmet"]]
                    some = sum(area["verified"] for area in areas)
                    pending = sum(each.answer["reasons"] != "complete" for each in row)
                    latest = max(each.late_s for each in row)
                    print(
                        f"{algorithm:<14} {name:<18} {some:>8} {len(areas):>6} {pending:>8} "
                        f"{1000 * latest:>10.1f}",
                        flush=True,
                    )
                    verified, unmet, requests = verified + some, unmet + len(areas), requests + len(row)
                    late += sum(each.late_s > ASKED_S for each in row)
        finally:
            service.stop()
    share = verified / unmet if unmet else 1.0
    print(
        f"{requests} requests: {100 * share:.1f} % of {unmet} unmet areas verified, {late} over 100 ms late"
    )
    return int(share < ASKED_SHARE or late > 0)


if __name__ == "__main__":
    sys.exit(main())
