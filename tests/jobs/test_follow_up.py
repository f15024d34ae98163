"""Results that are completed after the job's end: once, after restarts too, and in nobody's way."""

import asyncio
import time
from pathlib import Path

import pytest
from harness import KINDS, database_of, eventually, finished, running

from app.jobs.local import LocalExecutor
from app.jobs.model import FollowUp, JobKind, JobStatus, Progress, WorkResult
from app.jobs.store import JobStore

GIVEN_UP = {"rest": "never"}
OTHER_HALF = FollowUp("job_work:other_half", GIVEN_UP)
LATER = (
    *KINDS,
    JobKind("later", "job_work:half", "interactive", follow_up=OTHER_HALF),
    JobKind("never", "job_work:half", "interactive", follow_up=FollowUp("job_work:die", GIVEN_UP)),
    JobKind(
        "interrupted", "job_work:half", "interactive", follow_up=FollowUp("job_work:until_cancelled", {})
    ),
    JobKind("hasty", "job_work:until_file", "interactive", at_once="job_work:echo"),
)
HALF = {"half": 1, "rest": None}


def service(tmp_path, **settings):
    return running(tmp_path, kinds=LATER, reserve=LocalExecutor(1), **settings)


async def completed(service, job):
    await finished(service, job)

    async def is_so() -> bool:
        return not (await service.get(job.id)).unfinished

    await eventually(is_so)
    return await service.get(job.id)


def test_a_result_is_completed_after_the_answer(tmp_path):
    async def scenario():
        async with service(tmp_path) as jobs:
            job, _ = await jobs.submit("later", {"n": 7})
            answered = await finished(jobs, job)
            assert (answered.result, answered.unfinished) == (HALF, True)
            done = await completed(jobs, job)
            assert done.status is JobStatus.SUCCEEDED
            assert done.result == {"half": 1, "rest": [7, HALF]}
            assert done.attempt == 1

    asyncio.run(scenario())


def test_a_restart_completes_what_was_left(tmp_path):
    async def scenario():
        # Nothing completes it here.
        async with running(tmp_path, kinds=LATER) as jobs:
            job, _ = await jobs.submit("later", {"n": 7})
            assert (await finished(jobs, job)).unfinished
        async with service(tmp_path) as jobs:
            assert (await completed(jobs, job)).result["rest"] == [7, HALF]

    asyncio.run(scenario())


def test_what_cannot_be_completed_stays_as_it_is_and_holds_up_no_other(tmp_path):
    async def scenario():
        async with service(tmp_path) as jobs:
            bad, _ = await jobs.submit("never", {"log": str(tmp_path / "deaths"), "deaths": 99})
            good, _ = await jobs.submit("later", {"n": 1})
            assert (await completed(jobs, good)).result["rest"] == [1, HALF]
            assert (await completed(jobs, bad)).result == HALF | GIVEN_UP
            assert len((tmp_path / "deaths").read_text().splitlines()) == 3
            assert (await jobs.get(bad.id)).status is JobStatus.SUCCEEDED

    asyncio.run(scenario())


def test_it_makes_way_for_an_answer_and_is_begun_anew(tmp_path):
    async def scenario():
        gate, begun = str(tmp_path / "gate"), Path(tmp_path / "begun")
        async with service(tmp_path) as jobs:
            slow, _ = await jobs.submit("interrupted", {"begun": str(begun), "path": gate})
            assert (await finished(jobs, slow)).unfinished
            await eventually(begun.exists)
            # Both have no worker: the one that runs waits for the gate.
            await jobs.submit("until_file", {"path": gate})
            hasty, _ = await jobs.submit("hasty", {"path": gate}, time_limit_s=0.0)
            assert (await finished(jobs, hasty)).result["echo"] == hasty.payload
            assert (await jobs.get(slow.id)).unfinished
            Path(gate).touch()
            assert (await completed(jobs, slow)).result["rest"] == "all"

    asyncio.run(scenario())


TABLED = JobKind("later", "nowhere:later", "interactive", follow_up=OTHER_HALF)


@pytest.fixture
def store(any_database_url):
    database = database_of(any_database_url)
    store = JobStore(database, "host:1:1:me", 3, [TABLED])
    store.migrate()
    yield store
    database.dispose()


def ended(store, *, cancel=False, unfinished=True):
    claim, _ = store.insert(TABLED, {}, run_now=True, places=1)
    if cancel:
        store.cancel(claim.id)
    return store.succeed(claim.id, 1, WorkResult(HALF, unfinished=unfinished), Progress())


def test_only_results_that_wait_for_it_are_completed(store):
    whole, cancelled, half = (
        ended(store, unfinished=False),
        ended(store, cancel=True),
        ended(store),
    )
    assert (whole.unfinished, cancelled.unfinished, half.unfinished) == (False, False, True)
    assert store.next_unfinished(store.owner).id == half.id
    for job, result in ((whole, HALF), (cancelled, HALF | GIVEN_UP)):
        assert not store.complete_result(job.id, 1, {"rest": 2})
        assert store.get(job.id).result == result
    assert not store.complete_result(half.id, 2, {"rest": 2})
    assert store.complete_result(half.id, 1, {"rest": 2})
    assert store.get(half.id).result == {"half": 1, "rest": 2}
    # The second to come changes nothing.
    assert not store.complete_result(half.id, 1, {"rest": 3})
    assert store.get(half.id).result == {"half": 1, "rest": 2}
    assert store.next_unfinished(store.owner) is None


def test_a_deleted_job_is_not_completed(store):
    job = ended(store)
    store.expire(time.time() + 1.0, 10)
    assert not store.complete_result(job.id, 1, {"rest": 2})
    store.complete_result(job.id, 1, GIVEN_UP, failed=True)
    assert store.next_unfinished(store.owner) is None


def test_those_that_failed_come_last_and_then_no_more(store):
    first, second = ended(store), ended(store)
    store.complete_result(first.id, 1, GIVEN_UP, failed=True)
    assert store.next_unfinished(store.owner).id == second.id
    store.complete_result(first.id, 1, GIVEN_UP, failed=True)
    assert store.get(first.id).result == HALF
    store.complete_result(first.id, 1, GIVEN_UP, failed=True)
    assert not store.get(first.id).unfinished
    assert store.get(first.id).result == HALF | GIVEN_UP
    assert store.complete_result(second.id, 1, {})
    assert store.next_unfinished(store.owner) is None


def test_no_more_wait_than_there_are_places_for(store, monkeypatch):
    monkeypatch.setattr("app.jobs.queries._MOST_UNFINISHED", 2)
    first, second, third = ended(store), ended(store), ended(store)
    assert [each.unfinished for each in (first, second, third)] == [True, True, False]
    assert third.result == HALF | GIVEN_UP
    assert store.complete_result(store.next_unfinished(store.owner).id, 1, {})
    assert ended(store).unfinished


def test_services_that_share_a_database_complete_their_own_first(postgresql, monkeypatch):
    database = database_of(postgresql.new_database())
    store = JobStore(database, "host:1:1:me", 3, [TABLED])
    store.migrate()
    job = ended(store)
    assert store.next_unfinished("host:2:2:other") is None
    assert store.next_unfinished(store.owner).id == job.id
    monkeypatch.setattr("app.jobs.queries._LEFT_ALONE_S", 0.0)
    assert store.next_unfinished("host:2:2:other").id == job.id
    database.dispose()
