"""Old jobs go with all they left, unfinished ones never, and payloads lose what nobody needs any more."""

import asyncio
import time

import pytest
import sqlalchemy as sa
from harness import database_of, eventually, finished, running, url_of

from app.jobs.errors import JobNotFound, failure
from app.jobs.model import Idempotency, JobKind, JobStatus, Progress, WorkResult
from app.jobs.store import JobStore
from app.jobs.tables import artifacts, idempotency_keys, jobs

KIND = JobKind("solve", "nowhere:solve", "interactive", dropped_fields=frozenset({"weights"}))
DAY_S = 86_400.0


@pytest.fixture
def database(tmp_path):
    database = database_of(url_of(tmp_path))
    yield database
    database.dispose()


@pytest.fixture
def store(database):
    store = JobStore(database, "host:1:1:me", 3, [KIND])
    store.migrate()
    return store


def add(store, key=None, **payload):
    idempotency = None if key is None else Idempotency("client", key, "hash")
    job, _ = store.insert(KIND, payload, run_now=True, places=100, idempotency=idempotency)
    return job


def succeed(store, job):
    return store.succeed(job.id, job.attempt, WorkResult({"ok": 1}, b"bytes"), Progress())


def age(database, job, days):
    with database.write() as connection:
        connection.execute(
            sa.update(jobs).where(jobs.c.id == job.id).values(finished_at=time.time() - days * DAY_S)
        )


def rows(database, table):
    with database.read() as connection:
        return connection.scalar(sa.select(sa.func.count()).select_from(table))


def test_what_is_old_goes_with_what_it_left(store, database):
    old, young = add(store, "old"), add(store, "young")
    for job in (old, young):
        succeed(store, job)
    age(database, old, 31)
    age(database, young, 29)

    assert store.expire(time.time() - 30 * DAY_S, 50) == 1

    with pytest.raises(JobNotFound):
        store.get(old.id)
    assert store.artifact(young.id) == b"bytes"
    assert (rows(database, artifacts), rows(database, idempotency_keys)) == (1, 1)
    # The key is free again, the other one is not.
    assert add(store, "old").id != old.id
    assert add(store, "young").id == young.id


def test_unfinished_jobs_stay_however_old(store, database):
    running_job, waiting = add(store), add(store)
    store.requeue(waiting.id, 1, Progress())
    with database.write() as connection:
        connection.execute(sa.update(jobs).values(created_at=0.0, started_at=0.0))

    assert store.expire(time.time() + DAY_S, 50) == 0
    assert store.get(running_job.id).status is JobStatus.RUNNING
    assert store.get(waiting.id).status is JobStatus.QUEUED


def test_the_oldest_go_first_and_few_at_a_time(store, database):
    ended = [succeed(store, add(store)) for _ in range(5)]
    for number, job in enumerate(ended):
        age(database, job, 40 - number)

    assert store.expire(time.time(), 3) == 3
    assert [job.id for job in store.page(10, None).jobs] == [ended[4].id, ended[3].id]


def test_others_are_not_read_to_find_what_is_old(store, database):
    statements = []
    sa.event.listen(
        database.write_engine, "before_cursor_execute", lambda *given: statements.append(given[2:4])
    )
    store.expire(time.time(), 50)
    [(statement, parameters)] = [each for each in statements if each[0].startswith("DELETE")]
    with database.read() as connection:
        plan = connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}", parameters).all()
    assert "ix_jobs_finished_at" in str(plan)
    assert "SCAN" not in str(plan)


@pytest.mark.parametrize("end", ["succeeded", "failed", "cancelled"])
def test_large_fields_go_with_the_end(store, end):
    job = add(store, name="x", weights="A" * 1000)
    if end == "succeeded":
        ended = succeed(store, job)
    elif end == "failed":
        ended = store.fail(job.id, 1, failure("invalid-checkpoint", "no"), Progress())
    else:
        assert store.requeue(job.id, 1, Progress()).payload["weights"] == "A" * 1000
        ended, _ = store.cancel(job.id)

    assert ended.status == end
    assert ended.payload == {"name": "x"} == store.get(job.id).payload


def test_the_service_forgets_by_itself_and_keeps_what_runs(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            old, _ = await service.submit("echo", {"artifact": "w"})
            await finished(service, old)
        database = database_of(url_of(tmp_path))
        age(database, old, 2)
        async with running(tmp_path, retention_s=DAY_S) as service:

            async def gone():
                try:
                    await service.get(old.id)
                except JobNotFound:
                    return True
                return False

            await eventually(gone)
        assert rows(database, artifacts) == 0
        database.dispose()

    asyncio.run(scenario())


def test_without_a_retention_nothing_is_forgotten(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            old, _ = await service.submit("echo", {})
            await finished(service, old)
        database = database_of(url_of(tmp_path))
        age(database, old, 10_000)
        async with running(tmp_path) as service:
            job, _ = await service.submit("until_stopped", {})

            def stored():
                with database.read() as connection:
                    query = sa.select(jobs.c.progress).where(jobs.c.id == job.id)
                    return connection.scalar(query)["epoch"] or 0

            # Progress is stored by housekeeping: its second round comes after the end of its first.
            await eventually(lambda: stored() > 0)
            first = stored()
            await eventually(lambda: stored() > first)
            assert (await service.get(old.id)).status is JobStatus.SUCCEEDED
        database.dispose()

    asyncio.run(scenario())


def test_a_kinds_large_fields_reach_its_work_and_its_registration(tmp_path):
    async def scenario():
        seen = []

        def register(connection, job, work):
            seen.append(job.payload)
            return work.result

        echo = JobKind("echo", "job_work:echo", "interactive", register, frozenset({"weights"}))
        async with running(tmp_path, kinds=(echo,)) as service:
            job, _ = await service.submit("echo", {"weights": "A"})
            done = await finished(service, job)
            assert seen == [{"weights": "A"}]
            assert done.result["echo"] == {"weights": "A"}
            assert (await service.get(job.id)).payload == {}

    asyncio.run(scenario())
