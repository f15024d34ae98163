"""Many clients for minutes: is anything lost, is any error unexplained, and does memory stay flat?

    python tests/benchmarks/bench_load.py [--minutes 10] [--clients 32] [--seed 1] [--quick]

Clients mix allocations of every algorithm from 3x5 to 100x300, waiting and not, with and without idempotency
keys, event streams that are read to the end or left, cancellations, connections dropped at any moment,
nonsense, and all of the library. Explained are 429 with `Retry-After`, and refusals that the client asked for
(a job that learned nothing, a policy that another client deleted). At the end every acknowledged job has to
have ended, as succeeded or cancelled. The exit status is 1 otherwise. Memory is resident, after a warm-up of
a tenth of the time, each minute, and at the end.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import httpx

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from live_service import LiveService  # noqa: E402
from mixed_load import MixedLoad  # noqa: E402

WARM_UP = 0.1
FINAL = frozenset({"succeeded", "failed", "cancelled"})
SETTLES_WITHIN_S = 600.0


def main() -> int:
    """Run the load and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--clients", type=int, default=32)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="half a minute")
    given = parser.parse_args()
    seconds = 30.0 if given.quick else 60 * given.minutes
    with tempfile.TemporaryDirectory() as folder:
        service = LiveService(Path(folder), workers=2).start().await_ready(workers=2)
        try:
            listed = httpx.get(f"{service.url}/algorithms", timeout=60).json()["algorithms"]
            load = MixedLoad(service.url, [each["name"] for each in listed], given.seed)
            print(f"{'':>14} {'server MB':>10} {'workers MB':>11} {'jobs':>8}")
            _tell("idle", service, load)
            begun = time.monotonic()
            load.start(given.clients)
            for name, at in _moments(seconds):
                time.sleep(max(0.0, begun + at - time.monotonic()))
                _tell(name, service, load)
            load.stop()
            ends = settled(service.url, load)
            _tell("settled", service, load)
            metrics = service.metrics()
        finally:
            service.stop()
        defects = service.log.read_text().count('"level": "error"')
    print("\nanswers")
    for name, count in sorted(load.answers.items()):
        print(f"  {name:<60} {count:>8}")
    print("\nacknowledged jobs by how they ended")
    for name, count in sorted(ends.items()):
        print(f"  {name:<60} {count:>8}")
    lost = len(load.promised) - ends["succeeded"] - ends["cancelled"]
    restarts = metrics["allocator_worker_restarts_total"]
    print(
        f"\nacknowledged {len(load.promised)}, lost {lost}; unexplained answers {len(load.unexplained)}; "
        f"workers replaced {restarts:.0f}; errors in the log {defects}"
    )
    for line in load.unexplained[:30]:
        print(" ", line)
    return 1 if lost or load.unexplained else 0


def _moments(seconds: float) -> list[tuple[str, float]]:
    """List when memory is looked at: after the warm-up, each minute, at the end."""
    minutes = [(f"minute {each}", 60.0 * each) for each in range(1, int(seconds // 60) + 1)]
    return sorted([("warm", WARM_UP * seconds), *minutes, ("end", seconds)], key=lambda moment: moment[1])


def _tell(name: str, service: LiveService, load: MixedLoad) -> None:
    server, workers = service.memory_mb()
    print(f"{name:>14} {server:>10.0f} {workers:>11.0f} {len(load.promised):>8}", flush=True)


def settled(url: str, load: MixedLoad) -> Counter[str]:
    """Wait for the acknowledged jobs, and count how they ended."""
    ends: Counter[str] = Counter()
    patience = time.monotonic() + SETTLES_WITHIN_S
    with httpx.Client(base_url=url, timeout=60) as http:
        for job_id in sorted(load.promised):
            while True:
                response = http.get(f"/jobs/{job_id}")
                status = (
                    response.json()["status"] if response.is_success else f"answers {response.status_code}"
                )
                if status in FINAL or not response.is_success or time.monotonic() > patience:
                    break
                time.sleep(0.05)
            error = response.json().get("error") if response.is_success else None
            ends[status if error is None else f"failed: {error['type']}"] += 1
    return ends


if __name__ == "__main__":
    sys.exit(main())
