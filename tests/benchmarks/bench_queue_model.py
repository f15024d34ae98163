"""The model of .deploy/MODEL.md held against measurements: how long jobs wait, and what the table carries.

    python tests/benchmarks/bench_queue_model.py [--seconds 30] [--quick]

The workers are timers: a job occupies one for a time drawn from an exponential distribution and costs no
processor time there, so that a thousand of them fit into one machine; submitting, claiming, committing and
ending are the service's own. Each service is a process of its own with its share of the arrivals, which are a
Poisson process. First the ceiling (jobs that take no time, as fast as they go), then mean waits below it
beside Erlang's C formula. PostgreSQL is Debian's, with every commit on its disk.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import fmean
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests/support"), str(ROOT)]

import numpy as np  # noqa: E402
from postgresql_server import PostgresqlServer  # noqa: E402

from app.jobs import stored_json  # noqa: E402
from app.jobs.executor import Lost, Outcome, Returned  # noqa: E402
from app.jobs.model import JobKind, Progress, WorkResult  # noqa: E402
from app.jobs.service import JobService  # noqa: E402
from policy_store.database import Database  # noqa: E402

KIND = JobKind("timed", "nowhere:timed", "batch")
PLACES = 1_000_000


class TimedExecutor:
    """Workers that do nothing for as long as a job says.

    Parameters
    ----------
    capacity
        How many there are.
    """

    restarts = 0

    def __init__(self, capacity: int) -> None:
        self.capacity = self.ready = capacity

    async def start(self, on_ready: Callable[[], None]) -> None:
        on_ready()

    def submit(
        self,
        work: str,
        payload: dict[str, Any],
        *,
        time_left_s: float | None,
        on_progress: Callable[[Progress], None],
        labels: Mapping[str, str],
    ) -> TimedExecution:
        return TimedExecution(payload["seconds"])

    async def close(self) -> None:
        return None


class TimedExecution:
    """A job on such a worker."""

    def __init__(self, seconds: float) -> None:
        self._sleep = asyncio.ensure_future(asyncio.sleep(seconds))

    async def outcome(self) -> Outcome:
        try:
            await self._sleep
        except asyncio.CancelledError:
            return Lost("it was ended")
        return Returned(WorkResult({}))

    def cancel(self) -> None:
        return None

    def kill(self) -> None:
        self._sleep.cancel()


def main() -> int:
    """Measure and print the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0, help="of each row")
    parser.add_argument("--quick", action="store_true", help="8 seconds a row")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        print(json.dumps(asyncio.run(_serve(**json.loads(given.serve)))))
        return 0
    seconds = 8.0 if given.quick else given.seconds
    server = PostgresqlServer(durable=True)
    try:
        with tempfile.TemporaryDirectory() as folder:
            _ceilings(server, Path(folder), seconds)
        _waits(server, seconds)
    finally:
        server.close()
    return 0


def _ceilings(server: PostgresqlServer, folder: Path, seconds: float) -> None:
    print(f"{'jobs that take no time':<34} {'jobs/s':>8}")
    for name, services, url in (
        ("SQLite, 1 service", 1, f"sqlite:///{folder}/jobs.db"),
        ("PostgreSQL, 1 service", 1, server.new_database()),
        ("PostgreSQL, 2 services", 2, server.new_database()),
        ("PostgreSQL, 4 services", 4, server.new_database()),
    ):
        answers = _run(url, services, capacity=1000, rate=None, mean_s=0.0, seconds=seconds)
        print(f"{name:<34} {sum(each['ended'] for each in answers) / seconds:>8.0f}")


def _waits(server: PostgresqlServer, seconds: float) -> None:
    print(f"\n{'workers':>8} {'services':>8} {'load':>6} {'jobs/s':>8} {'Erlang C, ms':>13} {'measured':>9}")
    for workers, services, load, mean_s in (
        (1, 1, 0.5, 0.1),
        (2, 1, 0.7, 0.1),
        (2, 2, 0.7, 0.1),
        (1000, 1, 0.9, 20.0),
        (1000, 2, 0.9, 20.0),
    ):
        rate = load * workers / mean_s
        answers = _run(
            server.new_database(),
            services,
            capacity=workers // services,
            rate=rate / services,
            mean_s=mean_s,
            seconds=max(seconds, 4 * mean_s) if workers == 1000 else seconds,
        )
        waits = [wait for each in answers for wait in each["waits"]]
        expected = erlang_c(workers, rate * mean_s) * mean_s / (workers * (1 - load))
        measured = fmean(waits)
        row = f"{workers:>8} {services:>8} {load:>6.2f} {rate:>8.1f}"
        print(f"{row} {1000 * expected:>13.1f} {1000 * measured:>9.1f}")


def erlang_c(workers: int, offered: float) -> float:
    """Return the share of jobs that wait: Poisson arrivals, exponential times, ``offered`` workers' worth."""
    blocked = 1.0
    for count in range(1, workers + 1):
        blocked = offered * blocked / (count + offered * blocked)
    return blocked / (1 - offered / workers * (1 - blocked))


def _run(url: str, services: int, **options: Any) -> list[dict[str, Any]]:
    processes = [
        subprocess.Popen(
            [sys.executable, __file__, "--serve", json.dumps({"url": url, "seed": seed, **options})],
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        )
        for seed in range(services)
    ]
    return [json.loads(process.communicate()[0]) for process in processes]


async def _serve(
    url: str, seed: int, capacity: int, rate: float | None, mean_s: float, seconds: float
) -> dict[str, Any]:
    """Be a service: submit, and tell how many jobs ended in time and how long the later half waited."""
    rng = np.random.default_rng(seed)
    database = Database(url, stored_json.write, stored_json.read)
    service = JobService(database, [KIND], TimedExecutor(capacity), max_queued={"batch": PLACES})
    await service.start()
    begun = time.monotonic()
    taken: list[str] = []
    ended = 0

    async def follow(job_id: str) -> None:
        nonlocal ended
        await service.wait(job_id, None)
        ended += time.monotonic() - begun <= seconds

    following: set[asyncio.Task[None]] = set()

    async def submit() -> None:
        occupied = float(rng.exponential(mean_s)) if mean_s else 0.0
        job, _ = await service.submit("timed", {"seconds": occupied})
        taken.append(job.id)
        task = asyncio.create_task(follow(job.id))
        following.add(task)
        task.add_done_callback(following.discard)

    if rate is None:

        async def client() -> None:
            while time.monotonic() - begun < seconds:
                await submit()

        await asyncio.gather(*(client() for _ in range(32)))
        waits = []
    else:
        due = begun
        submissions: set[asyncio.Task[None]] = set()
        while due - begun < seconds:
            due += float(rng.exponential(1 / rate))
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            task = asyncio.create_task(submit())
            submissions.add(task)
            task.add_done_callback(submissions.discard)
        await asyncio.gather(*submissions)
        await asyncio.gather(*following)
        waits = await asyncio.to_thread(_waits_of, database, taken[len(taken) // 2 :])
    await service.stop(5.0)
    database.dispose()
    return {"ended": ended, "waits": waits}


def _waits_of(database: Database, ids: list[str]) -> list[float]:
    from app.jobs.tables import jobs  # noqa: PLC0415 - of the table, not of the service

    with database.read() as connection:
        rows = connection.execute(
            jobs.select().with_only_columns(jobs.c.id, jobs.c.started_at - jobs.c.created_at)
        )
        found = {row[0]: float(row[1]) for row in rows if row[1] is not None}
    return [found[job_id] for job_id in ids if not math.isnan(found[job_id])]


if __name__ == "__main__":
    sys.exit(main())
