"""How late answers come: every algorithm, time limits from 0.05 to 5 s, from 3x5 to 1000x2000.

    python tests/benchmarks/bench_lateness.py [--repeats 20] [--sizes 5x10,20x30] [--algorithms ga] [--quick]

Lateness is from the moment the client begins to send to the last byte of the answer, less `time_limit_s`; so
it has the transfer and the reading of the request in it, and not the client's own work of writing the JSON,
which is printed apart. One request at a time, generated problems (family `uniform`, 3 materials). Asked: at
most 100 ms at the 99th percentile of each row. An algorithm that refuses a size is left out of it.
"""

from __future__ import annotations

import argparse
import http.client
import json
import statistics
import sys
import tempfile
import time
from pathlib import Path

import httpx
import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from live_service import LiveService  # noqa: E402

from app.domain.records import problem_to_record  # noqa: E402
from app.simulation.generator import generate  # noqa: E402

LIMITS_S = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0)
SIZES = "3x5,5x10,20x30,100x300,1000x2000"
QUICK_LIMITS_S, QUICK_REPEATS = (0.05, 0.5), 2
ASKED_MS = 100.0
LONGER = {"qmix": {"n_epochs": 10_000_000}, "dqn": {"n_epochs": 10_000_000}, "ga": {"iteration": 1_000_000}}
"""Parameters without which an algorithm would be done before its limit."""


def main() -> int:
    """Print a row for each algorithm, size and limit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--sizes", default=SIZES)
    parser.add_argument("--algorithms", default="", help="with commas; all of them where none is named")
    parser.add_argument("--quick", action="store_true", help="two limits, two requests each")
    given = parser.parse_args()
    limits_s = QUICK_LIMITS_S if given.quick else LIMITS_S
    repeats = QUICK_REPEATS if given.quick else given.repeats
    late = 0
    heads = " ".join(f"{head:>8}" for head in ("limit s", "p50 ms", "p99 ms", "max ms"))
    print(f"{'algorithm':<14} {'size':>9} {heads} {'writing ms':>11}")
    with tempfile.TemporaryDirectory() as folder:
        service = LiveService(Path(folder), workers=2).start().await_ready(workers=2)
        try:
            listed = httpx.get(f"{service.url}/algorithms", timeout=60).json()["algorithms"]
            names = given.algorithms.split(",") if given.algorithms else [each["name"] for each in listed]
            connection = http.client.HTTPConnection("127.0.0.1", service.port, timeout=120)
            for size in given.sizes.split(","):
                m, n = map(int, size.split("x"))
                problem = problem_to_record(generate("uniform", m, n, 3, np.random.default_rng(1)))
                for name in names:
                    late += _rows(connection, name, size, problem, limits_s, repeats)
        finally:
            service.stop()
    print(f"\nrows over {ASKED_MS:g} ms at the 99th percentile: {late}")
    return 1 if late else 0


def _rows(
    connection: http.client.HTTPConnection,
    name: str,
    size: str,
    problem: dict[str, object],
    limits_s: tuple[float, ...],
    repeats: int,
) -> int:
    """Print the rows of an algorithm at a size, and return how many are late."""
    late = 0
    for limit_s in limits_s:
        lateness, writing = [], []
        for seed in range(repeats):
            begun = time.perf_counter()
            request = {**problem, "algorithm": name, "parameters": LONGER.get(name, {}), "seed": seed}
            body = json.dumps({**request, "time_limit_s": limit_s}).encode()
            sent = time.perf_counter()
            connection.request("POST", "/allocate", body, {"Content-Type": "application/json"})
            response = connection.getresponse()
            answer = response.read()
            lateness.append(1000 * (time.perf_counter() - sent - limit_s))
            writing.append(1000 * (sent - begun))
            if response.status != 200:
                told = json.loads(answer)
                print(
                    f"{name:<14} {size:>9} {limit_s:>8g} {response.status} {told['type']}: {told['detail']}"
                )
                if told["type"] == "/docs/errors#problem-too-large":
                    return late
                return late + 1
        cuts = statistics.quantiles(lateness, n=100, method="inclusive")
        late += cuts[98] > ASKED_MS
        print(
            f"{name:<14} {size:>9} {limit_s:>8g} {cuts[49]:>8.1f} {cuts[98]:>8.1f} {max(lateness):>8.1f} "
            f"{statistics.median(writing):>11.1f}{'  late' if cuts[98] > ASKED_MS else ''}",
            flush=True,
        )
    return late


if __name__ == "__main__":
    sys.exit(main())
