"""What a second machine brings, and what a job costs: 500 allocations of 10x20 on workers here and on Ray.

    python tests/benchmarks/bench_cluster.py [--jobs 500] [--rounds 2] [--database postgresql|sqlite]
        [--algorithm transfer_qmix|local_search|ga] [--rows "1 node" "2 nodes"] [--quick]

The nodes are Ray's own on this machine, with one core each; the head runs no work. A row is one service, or
two, with one job table: submit everything, wait for the last. The rows take turns, a share of the jobs each,
so that a machine that slows down slows all of them. Asked: with two nodes at least 1.8 times the throughput
of one, and at most 10 ms a job more on Ray than on the local executor, measured one job after the other with
work that does nothing. PostgreSQL is Debian's, started for this with every commit on its disk.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import statistics
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests/support"), str(ROOT / "tests/jobs"), str(ROOT)]

import numpy as np  # noqa: E402
from library_on_trial import library_of, policies_for_every_size  # noqa: E402
from postgresql_server import PostgresqlServer  # noqa: E402
from ray_nodes import RayNodes  # noqa: E402

from app.domain.records import problem_to_record  # noqa: E402
from app.jobs import stored_json  # noqa: E402
from app.jobs.executor import SINGLE_THREADED, Executor  # noqa: E402
from app.jobs.local import LocalExecutor  # noqa: E402
from app.jobs.model import Job, JobKind, JobStatus  # noqa: E402
from app.jobs.ray_cluster import RayExecutor  # noqa: E402
from app.jobs.service import JobService  # noqa: E402
from app.simulation.generator import generate  # noqa: E402
from app.solvers.registry import parse_parameters  # noqa: E402
from policy_store.database import Database  # noqa: E402

ASKED_SPEED_UP, ASKED_OVERHEAD_MS = 1.8, 10.0
KINDS = (
    JobKind("allocate", "app.allocation.tasks:allocate", "batch"),
    JobKind("nothing", "job_work:nothing", "interactive"),
)
WARM_UP = "app.allocation.warm_up:warm_up"
ROWS = ("1 worker here", "2 workers here", "1 node", "2 nodes", "2 nodes, 2 services")
NOTHING_TIMES = 300
PARAMETERS: dict[str, dict[str, Any]] = {
    "transfer_qmix": {},
    "local_search": {"moves": 500_000},
    "ga": {},
}
"""What POST /allocate does by default, about a second; some tenths of one; about ten milliseconds.

Of the last the service's own core is the limit. Where service and database have no core of their own, as on a
machine of two, they take theirs from the nodes: the shorter the jobs, the more of it.
"""


def main() -> int:
    """Measure and print a row each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=500)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--algorithm", choices=list(PARAMETERS), default="transfer_qmix")
    parser.add_argument("--database", choices=("postgresql", "sqlite"), default="postgresql")
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=ROWS)
    parser.add_argument("--quick", action="store_true", help="60 jobs")
    given = parser.parse_args()
    jobs = 60 if given.quick else given.jobs
    with tempfile.TemporaryDirectory() as folder, library_of(policies_for_every_size(None)) as library_url:
        payloads = _payloads(jobs, given.algorithm, library_url)
        server = PostgresqlServer(durable=True) if given.database == "postgresql" else None
        nodes = RayNodes(2, watchful=False)
        try:
            return asyncio.run(_measure(given.rows, payloads, given.rounds, nodes, server, Path(folder)))
        finally:
            nodes.close()
            if server is not None:
                server.close()


async def _measure(
    names: Sequence[str],
    payloads: list[dict[str, Any]],
    rounds: int,
    nodes: RayNodes,
    server: PostgresqlServer | None,
    folder: Path,
) -> int:
    def new_url(name: str) -> str:
        return f"sqlite:///{folder / name}.db" if server is None else server.new_database()

    made: dict[str, Callable[[], list[Executor]]] = {
        "1 worker here": lambda: [_here(1)],
        "2 workers here": lambda: [_here(2)],
        "1 node": lambda: [_on_ray(nodes, 1)],
        "2 nodes": lambda: [_on_ray(nodes, 2)],
        "2 nodes, 2 services": lambda: [_on_ray(nodes, 1), _on_ray(nodes, 1)],
    }
    # One service at a time works on an SQLite file.
    rows = {name: made[name] for name in names if server is not None or "services" not in name}
    seconds, nothing_ms = dict.fromkeys(rows, 0.0), {name: list[float]() for name in rows}
    for turn in range(rounds):
        for name, executors in rows.items():
            took_s, walls_ms = await _row(executors(), new_url(f"{name} {turn}"), payloads[turn::rounds])
            print(f"{name}: {len(payloads[turn::rounds]) / took_s:.2f} jobs/s", file=sys.stderr)
            seconds[name] += took_s
            nothing_ms[name] += walls_ms
    kept_in = "SQLite" if server is None else "PostgreSQL"
    print(f"{len(payloads)} allocations of 10x20 by {payloads[0]['algorithm']}; jobs are kept in {kept_in}")
    print(f"{'':<22} {'jobs/s':>8} {'ms a job that does nothing':>28}")
    for name in rows:
        median_ms = statistics.median(nothing_ms[name])
        print(f"{name:<22} {len(payloads) / seconds[name]:>8.2f} {median_ms:>28.2f}")
    met = True
    if {"1 node", "2 nodes"} <= rows.keys():
        speed_up = seconds["1 node"] / seconds["2 nodes"]
        met = speed_up >= ASKED_SPEED_UP
        print(f"\n2 nodes over 1: {speed_up:.2f}, asked: at least {ASKED_SPEED_UP:g}")
    if {"1 node", "1 worker here"} <= rows.keys():
        overhead = statistics.median(nothing_ms["1 node"]) - statistics.median(nothing_ms["1 worker here"])
        met = met and overhead <= ASKED_OVERHEAD_MS
        print(f"a job on Ray over one here: {overhead:.2f} ms, asked: at most {ASKED_OVERHEAD_MS:g} ms")
    return 0 if met else 1


async def _row(
    executors: list[Executor], url: str, payloads: list[dict[str, Any]]
) -> tuple[float, list[float]]:
    """Return the seconds of all, and the milliseconds of jobs that do nothing."""
    async with _services(executors, url) as services:
        begun = time.perf_counter()
        jobs = [
            (await services[number % len(services)].submit("allocate", payload))[0]
            for number, payload in enumerate(payloads)
        ]
        await asyncio.gather(
            *(_ended(services[number % len(services)], job) for number, job in enumerate(jobs))
        )
        took_s = time.perf_counter() - begun
        walls_ms = []
        for _ in range(NOTHING_TIMES):
            begun = time.perf_counter()
            await _ended(services[0], (await services[0].submit("nothing", {}))[0])
            walls_ms.append(1000 * (time.perf_counter() - begun))
    return took_s, walls_ms


async def _ended(service: JobService, job: Job) -> None:
    ended = await service.wait(job.id, None)
    if ended.status is not JobStatus.SUCCEEDED:
        raise SystemExit(f"job {ended.id} is {ended.status}: {ended.error}")


@asynccontextmanager
async def _services(executors: list[Executor], url: str) -> AsyncIterator[list[JobService]]:
    databases = [Database(url, stored_json.write, stored_json.read) for _ in executors]
    services = [
        JobService(database, KINDS, executor, max_queued={"batch": 100_000})
        for database, executor in zip(databases, executors, strict=True)
    ]
    for service in services:
        await service.start()
    while any(service.load().ready < service.load().capacity for service in services):
        await asyncio.sleep(0.05)
    try:
        yield services
    finally:
        for service in reversed(services):
            await service.stop(0)
        for database in databases:
            database.dispose()


def _here(workers: int) -> LocalExecutor:
    return LocalExecutor(workers, warm_up=WARM_UP, environment=_environment())


def _on_ray(nodes: RayNodes, workers: int) -> RayExecutor:
    return RayExecutor(workers, address=nodes.address, warm_up=WARM_UP, environment=_environment())


def _environment() -> dict[str, str]:
    return {**SINGLE_THREADED, "PYTHONPATH": os.pathsep.join(sys.path)}


def _payloads(count: int, algorithm: str, library_url: str) -> list[dict[str, Any]]:
    """Return problems of 10 UAVs and 20 areas, each another one."""
    parameters = parse_parameters(algorithm, PARAMETERS[algorithm]).model_dump(mode="json")
    return [
        {
            "problem": problem_to_record(generate("uniform", 10, 20, 3, np.random.default_rng(seed))),
            "algorithm": algorithm,
            "parameters": parameters,
            "seed": seed,
            "library_url": library_url,
        }
        for seed in range(count)
    ]


if __name__ == "__main__":
    sys.exit(main())
