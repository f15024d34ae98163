"""What is done now and then: one chore never keeps another from being done."""

import asyncio
import time
from contextlib import asynccontextmanager

import pytest
import sqlalchemy as sa
from harness import running

from app.jobs.attempts import Attempts
from app.jobs.capacity import QueueLimit
from app.jobs.maintenance import Maintenance
from app.jobs.model import JobKind, Progress, WorkResult
from app.jobs.peers import NoPeers
from app.jobs.tables import jobs

DAY_S = 86_400.0
KIND = JobKind("echo", "nowhere:echo", "interactive")


class Beats(NoPeers):
    """Counts the heartbeats, which are always due."""

    beat_s = 0.0
    count = 0

    def beat(self):
        self.count += 1
        return {}


@pytest.fixture
def maintained(tmp_path):
    @asynccontextmanager
    async def make():
        async with running(tmp_path) as service:
            dispatcher = service._dispatcher
            store, peers = dispatcher._store, Beats("me")
            chores = Maintenance(store, dispatcher._writer, Attempts(), peers, dispatcher, DAY_S)
            yield chores, store, peers

    return make


def add_ended(store, count):
    """Add jobs that ended two days ago."""
    for _ in range(count):
        claim, _ = store.insert(KIND, {}, run_now=True, limit=QueueLimit(count, 1.0), idempotency=None)
        store.succeed(claim.job.id, 1, WorkResult({}), Progress())
    with store.database.write() as connection:
        connection.execute(sa.update(jobs).values(finished_at=time.time() - 2 * DAY_S))


def test_heartbeats_come_between_when_many_jobs_are_old(maintained):
    async def scenario():
        async with maintained() as (chores, store, peers):
            add_ended(store, 120)
            left = []
            for _ in range(3):
                left.append(len(store.page(200, None).jobs))
                assert await chores._do_what_is_due() == 0.0
            assert left == [120, 70, 20]
            assert not store.page(200, None).jobs
            assert peers.count == 3

    asyncio.run(scenario())


def test_a_chore_that_fails_is_tried_again_and_the_others_are_done(maintained, monkeypatch, caplog):
    async def scenario():
        async with maintained() as (chores, store, peers):
            add_ended(store, 1)

            def fail(_is_alive):
                raise RuntimeError("no")

            with monkeypatch.context() as broken:
                broken.setattr(store, "recover", fail)
                await chores._do_what_is_due()
            assert peers.count == 1
            assert not store.page(10, None).jobs
            assert "there will be another try" in caplog.text
            assert chores._due_at[chores.recover] < time.monotonic() + 2.0

    asyncio.run(scenario())
