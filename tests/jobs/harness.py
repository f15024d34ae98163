"""A service on a real database with real workers, and waiting for what must come true."""

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sa

from app.jobs import stored_json
from app.jobs.executor import Executor
from app.jobs.local import LocalExecutor
from app.jobs.model import Job, JobKind, JobStatus, WorkResult
from app.jobs.service import JobService
from policy_store.database import Database

PATIENCE_S = 120.0
# Of services that share a database: short, because tests wait for it where one was killed.
LEASE_S = 1.5


def count_completion(connection: sa.Connection, job: Job, work: WorkResult) -> dict[str, Any]:
    """Count in the transaction that marks a job succeeded how often that happens."""
    connection.execute(sa.text("CREATE TABLE IF NOT EXISTS completions (job_id TEXT)"))
    connection.execute(sa.text("INSERT INTO completions VALUES (:id)"), {"id": job.id})
    return {**work.result, "registered": True}


def kind(name: str, lane: str = "interactive") -> JobKind:
    return JobKind(name, f"job_work:{name}", lane)  # type: ignore[arg-type]


GATED = JobKind("gated", "job_work:until_file", "interactive", count_completion)
KINDS = (
    *(kind(name) for name in ("echo", "until_file", "until_stopped", "deaf", "chatter", "epochs", "die")),
    *(kind(name) for name in ("refuse", "defect", "leave", "not_json", "surroundings", "speak")),
    kind("note"),
    JobKind("train", "job_work:until_file", "training"),
    GATED,
)


def make_service(
    database: Database,
    *,
    kinds: Sequence[JobKind] = KINDS,
    slots: int = 1,
    executor: Executor | None = None,
    **settings: Any,
) -> JobService:
    return JobService(database, kinds, executor or LocalExecutor(slots), **settings)


def url_of(folder: Path) -> str:
    return f"sqlite:///{folder / 'jobs.db'}"


def database_of(url: str) -> Database:
    """Open a database as the service does."""
    return Database(url, stored_json.write, stored_json.read)


@asynccontextmanager
async def running(where: Path | str, *, grace_s: float = 0.0, **settings: Any) -> AsyncIterator[JobService]:
    """Run a service on the database of a folder, or of a URL, with all workers warm."""
    database = database_of(where if isinstance(where, str) else url_of(where))
    service = make_service(database, **settings)
    await service.start()
    try:
        await eventually(lambda: service.load().ready == service.load().capacity)
        yield service
    finally:
        await service.stop(grace_s)
        database.dispose()


@asynccontextmanager
async def two_services(url: str, **settings: Any) -> AsyncIterator[tuple[JobService, JobService]]:
    """Run two services on one database, whose queue hardly ends."""
    options = {"max_queued": 1000, **settings}
    async with running(url, **options) as one, running(url, **options) as other:
        yield one, other


def make_completions(url: str) -> None:
    """Make the table in which completions are counted, before several services would at once."""
    database = database_of(url)
    with database.write() as connection:
        connection.execute(sa.text("CREATE TABLE completions (job_id TEXT)"))
    database.dispose()


def completions_of(url: str) -> Sequence[str]:
    """Return the jobs that were completed, one as often as it was."""
    database = database_of(url)
    with database.read() as connection:
        found = connection.scalars(sa.text("SELECT job_id FROM completions")).all()
    database.dispose()
    return found


async def eventually(condition: Callable[[], bool | Awaitable[bool]]) -> None:
    """Look until a condition holds; that it does not is an error, after a patience no test comes near."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        holds = condition()
        if not isinstance(holds, bool):
            holds = await holds
        if holds:
            return
        assert time.monotonic() < deadline, "what was waited for did not come"
        await asyncio.sleep(0.002)


async def finished(service: JobService, job: Job) -> Job:
    """Wait for a job's end."""
    ended = await service.wait(job.id, PATIENCE_S)
    assert ended.status.finished
    return ended


async def reports(service: JobService, job: Job) -> None:
    """Wait until a job runs and has told of progress."""

    async def has_progress() -> bool:
        now = await service.get(job.id)
        return now.status is JobStatus.RUNNING and now.progress.fraction > 0

    await eventually(has_progress)
