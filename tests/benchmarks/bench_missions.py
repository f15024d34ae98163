"""Days of missions with `kill -9` in between, how fast positions are taken, how soon a plan is proposed.

    python tests/benchmarks/bench_missions.py days [--days 100] [--events 200] [--kills 1] [--seed 1]
    python tests/benchmarks/bench_missions.py positions [--seconds 60] [--rate 1000] [--listeners 20]
    python tests/benchmarks/bench_missions.py proposals [--events 40] [--limit 0.5]

`days`: every day is a random problem with all that a problem may have, and random events; the server is
killed while an event is told. After each day no acknowledged event is lost or there twice, every state is the
one that the events make without a kill, and every plan in force is legal by the referee. The exit status is 1
otherwise.

`positions`: batches of twenty positions of one mission, from one client, with listeners to its stream.

`proposals`: events of a mission of 20 UAVs and 30 areas, and how long after each a proposal is there, or the
search has found nothing better.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path

import httpx
import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "support"), str(Path(__file__).parents[2])]

from live_service import SMALL, LiveService  # noqa: E402
from mission_trial import Reckoning, Trial  # noqa: E402

from app.domain.records import problem_to_record  # noqa: E402
from app.simulation.generator import generate  # noqa: E402

BATCH = 20


def main() -> int:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("days", "positions", "proposals"))
    parser.add_argument("--days", type=int, default=100)
    parser.add_argument("--events", type=int, default=None)
    parser.add_argument("--kills", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--listeners", type=int, default=20)
    parser.add_argument("--limit", type=float, default=0.5)
    parser.add_argument("--quick", action="store_true", help="two days of twenty events; ten seconds")
    given = parser.parse_args()
    if given.quick:
        given.days, given.events, given.seconds = 2, 20, 10.0
    with tempfile.TemporaryDirectory() as folder:
        service = LiveService(Path(folder), workers=1, **SMALL).start().await_ready()
        try:
            return {"days": days, "positions": positions, "proposals": proposals}[given.what](service, given)
        finally:
            service.stop()


def days(service: LiveService, given: argparse.Namespace) -> int:
    """Let days happen, and print what they came to."""
    reckoning, begun = Reckoning(), time.monotonic()
    for day in range(given.days):
        Trial(service, given.seed + day, reckoning).run(given.events or 200, given.kills)
        took = time.monotonic() - begun
        print(f"  day {day + 1}, {reckoning.plans} plans, {took:.0f} s", flush=True)
    print(f"\ndays {given.days}, kills {reckoning.kills}, plans by the referee {reckoning.plans}")
    for name, counts in (("told", reckoning.told), ("refused", reckoning.refused)):
        print(f"{name}: {', '.join(f'{each} {count}' for each, count in sorted(counts.items()))}")
    print(f"broken: {len(reckoning.broken)}")
    for line in reckoning.broken[:50]:
        print(" ", line)
    return 1 if reckoning.broken else 0


def _mission(http: httpx.Client, limit_s: float = 1.0) -> tuple[str, dict]:
    problem = problem_to_record(generate("uniform", 20, 30, 3, np.random.default_rng(0)))
    body = {"problem": problem, "algorithm": "auto", "time_limit_s": limit_s, "plans": "automatic"}
    mission = http.post("/missions", json=body).raise_for_status().json()
    path = f"/missions/{mission['id']}"
    _settle(http, path)
    return path, problem


def _settle(http: httpx.Client, path: str) -> None:
    while http.get(path).json()["searching"]:
        time.sleep(0.01)


def positions(service: LiveService, given: argparse.Namespace) -> int:
    """Send positions at a rate, and print how long each batch took, and what memory that needs."""
    with httpx.Client(base_url=service.url, timeout=60) as http:
        path, problem = _mission(http)
        heard, stop = [0] * given.listeners, threading.Event()
        listeners = [
            threading.Thread(target=_listen, args=(service.url, path, heard, k, stop), daemon=True)
            for k in range(given.listeners)
        ]
        for listener in listeners:
            listener.start()
        batches = int(given.seconds * given.rate / BATCH)
        took, memory, begun, errors = [], [service.memory_mb()[0]], time.monotonic(), 0
        for number in range(batches):
            due = begun + number * BATCH / given.rate
            time.sleep(max(0.0, due - time.monotonic()))
            seen = [
                {"uav_id": uav["id"], "time": 1e-6 * (number + 1), "x": uav["x_s"], "y": uav["y_s"]}
                for uav in problem["uavs"]
            ]
            sent = time.monotonic()
            answer = http.post(
                f"{path}/events", json={"type": "telemetry", "id": f"b-{number}", "positions": seen}
            )
            took.append(time.monotonic() - sent)
            errors += not answer.is_success
            if number % 100 == 0:
                memory.append(service.memory_mb()[0])
        lasted = time.monotonic() - begun
        time.sleep(2.0)
        stop.set()
    took.sort()
    sent, middle, last = batches * BATCH, memory[len(memory) // 2], memory[-1]
    print(f"{sent} positions in {lasted:.1f} s, {sent / lasted:.0f} a second, {errors} errors")
    worst = took[int(0.99 * batches)]
    print(f"a batch: median {1e3 * statistics.median(took):.1f} ms, 99 % {1e3 * worst:.1f} ms")
    print(f"heard by listeners: least {min(heard, default=0)} of {batches} events")
    print(f"server: {memory[0]:.0f} MB at first, {middle:.0f} in the middle, {last:.0f} at the end")
    return 1 if errors else 0


def _listen(url: str, path: str, heard: list[int], which: int, stop: threading.Event) -> None:
    with httpx.Client(base_url=url, timeout=None) as http, http.stream("GET", f"{path}/stream") as stream:
        for line in stream.iter_lines():
            heard[which] += line == "event: telemetry"
            if stop.is_set():
                return


def proposals(service: LiveService, given: argparse.Namespace) -> int:
    """Tell events, and print how long it takes until a plan was looked for after each."""
    rng = np.random.default_rng(given.seed)
    with httpx.Client(base_url=service.url, timeout=60) as http:
        path, problem = _mission(http, given.limit)
        answered, settled = [], []
        for number in range(given.events or 40):
            target = problem["targets"][int(rng.integers(30))]["id"]
            event = {"type": "level_changed", "target_id": target, "level": float(rng.uniform(0.1, 3.0))}
            sent = time.monotonic()
            http.post(f"{path}/events", json={**event, "id": f"e-{number}"}).raise_for_status()
            answered.append(time.monotonic() - sent)
            _settle(http, path)
            settled.append(time.monotonic() - sent)
    for name, times in (("answer", sorted(answered)), ("plan", sorted(settled))):
        print(f"{name}: median {statistics.median(times):.3f} s, 95 % {times[int(0.95 * len(times))]:.3f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
