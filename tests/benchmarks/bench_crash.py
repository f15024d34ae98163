"""Rounds of `kill -9` under load: is every promise kept?

    python tests/benchmarks/bench_crash.py [--rounds 200] [--clients 6] [--seed 1] [--quick]

Clients allocate (waiting, with `Prefer`, with idempotency keys), train, register, cancel and look, and write
down every job they were told of. Meanwhile the server, a worker, or the server with all workers is killed at
random moments, also while they start, and brought back on the same database. At the end every promised job
has to be in a final state with a plan or a reason, unchanged since it was read first; a key has one job, a
promised cancellation is one, no training is registered twice, and SQLite's integrity check is clean. The exit
status is 1 otherwise. A round takes about as long as workers take to start.
"""

from __future__ import annotations

import argparse
import random
import re
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from crash_trial import KINDS, Ledger, crash, load, reckon  # noqa: E402
from live_service import LiveService  # noqa: E402

LONGEST_PAUSE_S = 3.0


def main() -> int:
    """Run the rounds and print the reckoning."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--clients", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="six rounds")
    given = parser.parse_args()
    rounds = 6 if given.quick else given.rounds
    rng, ledger, kills = random.Random(given.seed), Ledger(), Counter[str]()
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        service = LiveService(Path(folder), workers=2).start().await_ready(workers=2)
        try:
            with load(service, ledger, given.clients, given.seed):
                for number in range(1, rounds + 1):
                    kind = KINDS[number % 3] if given.quick else rng.choice(KINDS)
                    crash(service, kind, rng, LONGEST_PAUSE_S)
                    kills[kind] += 1
                    if number % 10 == 0:
                        took = time.monotonic() - begun
                        print(f"  round {number}, {len(ledger.promised)} jobs, {took:.0f} s", flush=True)
            service.await_ready()
            ends = reckon(service, ledger)
        finally:
            service.stop()
        # Not read as JSON: what was being written at a kill is half a line.
        logged = [line for line in service.log.read_text().splitlines() if '"level": "error"' in line]
        errors = Counter(re.search(r'"event": "([^"]*)', line)[1] for line in logged)
    _print("killed", kills)
    _print("answers", ledger.answered)
    _print("promised jobs by how they were asked for", Counter(ledger.promised.values()))
    _print("promised jobs by how they ended", ends)
    _print("errors in the log", errors)
    print(f"\n{rounds} rounds in {time.monotonic() - begun:.0f} s")
    print(f"promises: {len(ledger.promised)}, broken: {len(ledger.broken)}")
    for line in ledger.broken[:50]:
        print(" ", line)
    return 1 if ledger.broken else 0


def _print(title: str, counts: Counter[str]) -> None:
    print(f"\n{title}")
    for name, count in sorted(counts.items()):
        print(f"  {name:<44} {count:>7}")


if __name__ == "__main__":
    sys.exit(main())
