"""Mutated bodies against everything that takes a body: is each answered with its 4xx, and does nothing die?

    python tests/benchmarks/bench_mutations.py [--bodies 100000] [--connections 24] [--seed 1] [--quick]

Sound bodies are changed in structure (wrong types, missing and added fields, deep nesting, long lists), in
their text (NaN, 1e999, numbers of 5000 digits, lone surrogates, names twice) and in their bytes (cut,
flipped, in other encodings, under other content types). A body that is still sound is worked on for
milliseconds. The exit status is 1 if there is an answer of 5xx, a refusal that is no problem details or names
no field where it could, a lost connection, or a worker that died. A mutant is made again from the seed and
its number.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import httpx

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from live_service import LiveService  # noqa: E402
from mutation_trial import MutationTrial  # noqa: E402


def main() -> int:
    """Send the bodies and print the answers."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, default=100_000)
    parser.add_argument("--connections", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="2000 bodies")
    given = parser.parse_args()
    bodies = 2000 if given.quick else given.bodies
    with tempfile.TemporaryDirectory() as folder:
        service = LiveService(Path(folder), workers=2).start().await_ready(workers=2)
        try:
            paths = paths_with_bodies(service.url)
            trial = MutationTrial("127.0.0.1", service.port, given.seed, paths)
            begun, sent = time.monotonic(), 0
            while sent < bodies:
                batch = min(5000, bodies - sent)
                trial.run(batch, given.connections)
                sent += batch
                print(f"  {sent} bodies, {time.monotonic() - begun:.0f} s", flush=True)
            restarts = service.metrics()["allocator_worker_restarts_total"]
            ready = httpx.get(f"{service.url}/readyz", timeout=30).status_code
        finally:
            service.stop()
        defects = service.log.read_text().count('"level": "error"')
    print(f"\n{'path, status, problem':<60} {'answers':>8}")
    for name, count in sorted(trial.answers.items()):
        print(f"{name:<60} {count:>8}")
    print(f"\nworkers that died: {restarts:.0f}; errors in the log: {defects}; /readyz afterwards: {ready}")
    print(f"faults: {len(trial.faults)}")
    for line in trial.faults[:30]:
        print(" ", line[:300])
    return 1 if trial.faults or restarts or ready != 200 else 0


def paths_with_bodies(url: str) -> list[str]:
    """List the paths that take a body, as the service describes itself."""
    described = httpx.get(f"{url}/openapi.json", timeout=60).json()["paths"]
    return sorted(path for path, methods in described.items() if "requestBody" in methods.get("post", {}))


if __name__ == "__main__":
    sys.exit(main())
