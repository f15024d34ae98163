"""What is done now and then: one chore never keeps another from being done."""

import asyncio
import time

import sqlalchemy as sa
from harness import database_of, eventually, make_service, url_of

from app.jobs import dispatcher
from app.jobs.model import JobKind, Progress, WorkResult
from app.jobs.store import JobStore
from app.jobs.tables import jobs

DAY_S = 86_400.0
KIND = JobKind("echo", "nowhere:echo", "interactive")


def add_ended(database, count):
    """Add jobs that ended two days ago."""
    store = JobStore(database, "earlier", 3, [KIND])
    store.migrate()
    for _ in range(count):
        job, _ = store.insert(KIND, {}, run_now=True, places=count)
        store.succeed(job.id, 1, WorkResult({}), Progress())
    with store.database.write() as connection:
        connection.execute(sa.update(jobs).values(finished_at=time.time() - 2 * DAY_S))
    return store


def maintained(tmp_path, ended, scenario):
    """Run a scenario with a service that deletes jobs after a day, and shows all the time that it lives."""
    database = database_of(url_of(tmp_path))
    store = add_ended(database, ended)

    async def run():
        service = make_service(database, retention_s=DAY_S)
        peers = service._dispatcher._peers
        left = []

        def beat():
            left.append(len(store.page(200, None).jobs))
            return {}

        peers.beat_s, peers.beat = 0.0, beat
        await service.start()
        try:
            await scenario(service, left)
        finally:
            await service.stop(0)
            database.dispose()

    asyncio.run(run())


def test_heartbeats_come_between_when_many_jobs_are_old(tmp_path):
    async def scenario(service, left):
        await eventually(lambda: bool(left) and left[-1] == 0)
        # Fifty are deleted at once, and no heartbeat waits for two such deletions.
        assert {70, 20} <= set(left)

    maintained(tmp_path, 120, scenario)


def test_a_chore_that_fails_is_tried_again_and_the_others_are_done(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(dispatcher, "_AGAIN_S", 0.01)
    monkeypatch.setattr(dispatcher, "_LOOK_INTERVAL_S", 0.01)

    async def scenario(service, left):
        tries = []

        def fail(_is_alive):
            tries.append(len(left))
            raise RuntimeError("no")

        with monkeypatch.context() as broken:
            broken.setattr(service._store, "recover", fail)
            await eventually(lambda: len(tries) > 2 and left[-1] == 0)
            assert tries[-1] > tries[0]
        assert "there will be another try" in caplog.text

    maintained(tmp_path, 1, scenario)
