"""Where a service looks for jobs, and which of those that wait it answers, where others take them too."""

import asyncio

import pytest
from harness import database_of

from app.jobs.capacity import Capacity, QueueLimit
from app.jobs.model import LANES, JobKind
from app.jobs.overdue import OverdueJobs
from app.jobs.store import JobStore


@pytest.fixture
def capacity():
    return Capacity(2)


def test_jobs_are_looked_for_where_something_is_told_of(capacity):
    assert capacity.begin_look(2) == ()
    capacity.hint(["batch"])
    assert capacity.begin_look(2) == ("batch",)


def test_a_lane_of_which_something_is_heard_while_it_is_looked_at_is_looked_at_again(capacity):
    capacity.hint(["interactive"])
    capacity.begin_look(2)
    capacity.end_look(None)
    assert capacity.begin_look(2) == ()
    capacity.hint(["interactive"])
    capacity.begin_look(2)
    capacity.hint(["interactive"])
    capacity.end_look(None)
    assert capacity.begin_look(2) == ("interactive",)


def test_a_worker_is_kept_for_what_is_being_looked_for(capacity):
    capacity.hint(LANES)
    assert capacity.begin_look(2) == LANES
    # It may be a training, of which there is one at a time.
    assert capacity.may_start("interactive", 2)
    assert not capacity.may_start("training", 2)
    assert not capacity.may_start("interactive", 1)
    capacity.end_look("training")
    assert capacity.running == {"interactive": 0, "batch": 0, "training": 1}
    # What else waits for training waits on, and is looked for once there is a worker for it.
    capacity.hint(LANES)
    assert capacity.begin_look(2) == ("interactive", "batch")
    capacity.end_look(None)
    assert capacity.begin_look(2) == ()
    capacity.running["training"] -= 1
    assert capacity.begin_look(2) == ("training",)


def test_lanes_go_before_one_another_and_the_oldest_of_a_lane_first(any_database_url):
    database = database_of(any_database_url)
    store = JobStore(database, "host:1:1:me", 3)
    store.migrate()
    ids = {}
    for name, lane in (("t1", "training"), ("b1", "batch"), ("i1", "interactive"), ("i2", "interactive")):
        kind = JobKind(name, "nowhere:work", lane)
        claim, _ = store.insert(kind, {}, run_now=False, limit=QueueLimit(9, 1.0))
        ids[claim.job.id] = name
    # One that could begin at once waits behind those that come before it.
    late, _ = store.insert(
        JobKind("t2", "nowhere:work", "training"), {}, run_now=True, limit=QueueLimit(9, 1)
    )
    ids[late.job.id] = "t2"
    assert store.waiting() == {"interactive": 2, "batch": 1, "training": 2}
    claims = [store.claim(lanes) for lanes in (LANES, LANES, ("training",), LANES, LANES, LANES)]
    names = [claim and ids[claim.job.id] for claim in claims]
    assert names == ["i1", "i2", "t1", "b1", "t2", None]
    # The last one of the lanes in which it was looked for says that there is no more.
    assert [claim and claim.more_wait for claim in claims] == [True, True, True, True, False, None]
    database.dispose()


def test_only_jobs_that_can_be_answered_at_once_are_watched(any_database_url):
    database = database_of(any_database_url)
    store = JobStore(database, "host:1:1:me", 3)
    store.migrate()
    taken_in = [
        store.insert(
            JobKind(name, "nowhere:work", "interactive"),
            {},
            run_now=False,
            limit=QueueLimit(9, 1.0),
            time_limit_s=limit_s,
        )[0].job.id
        for name, limit_s in (("hasty", 5.0), ("hasty", None), ("patient", 5.0))
    ]
    assert list(store.deadlines(["hasty", "unknown"])) == taken_in[:1]
    database.dispose()


def test_what_others_have_answered_is_not_answered_here():
    answered = []

    async def answer(job_ids):
        answered.extend(job_ids)
        if "last" in job_ids:
            overdue.loop.end()
        return dict.fromkeys(job_ids, 0.0)

    async def scenario():
        for job_id in ("ended here", "of before"):
            overdue.watch(job_id, 0.0)
        overdue.watch_only({"ended elsewhere": 0.0, "first": 1.0, "last": 2.0})
        overdue.forget("ended elsewhere")
        await overdue.loop.run()

    overdue = OverdueJobs(answer)
    asyncio.run(scenario())
    assert answered == ["first", "last"]
