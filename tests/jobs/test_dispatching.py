"""Which jobs may start, and which of those that wait a service answers, where others take them too."""

import asyncio
import threading
from types import SimpleNamespace

from harness import database_of, eventually, finished, running

from app.jobs.attempts import Attempts, Writer
from app.jobs.model import LANES, JobKind, JobStatus
from app.jobs.reserve import Reserve
from app.jobs.store import JobStore


def test_no_lane_but_the_first_takes_the_last_worker():
    attempts = Attempts(2)
    assert attempts.may_start(0) == ()
    assert attempts.may_start(1) == LANES
    attempts.reserved["training"] = 1
    # There is one training at a time, and one worker that is warm has it.
    assert attempts.may_start(1) == ()
    assert attempts.may_start(2) == ("interactive", "batch")
    attempts.reserved["batch"] = 1
    assert attempts.may_start(2) == ()
    attempts.reserved["training"] = 0
    assert attempts.may_start(2) == ("interactive", "training")
    assert Attempts(1).may_start(1) == LANES


def test_a_worker_is_kept_for_what_is_being_looked_for_and_what_is_told_of_meanwhile_is_found(tmp_path):
    async def scenario():
        async with running(tmp_path, slots=2) as service:
            gate = {"path": str(tmp_path / "gate")}
            holder, _ = await service.submit("until_file", gate)
            claim, looking, go_on = service._store.claim, threading.Event(), threading.Event()

            def slow(lanes):
                looking.set()
                go_on.wait()
                return claim(lanes)

            service._store.claim = slow
            service._dispatcher._look()
            await eventually(looking.is_set)
            # Taken in while the look for others, which finds none, keeps the free worker.
            coming = asyncio.create_task(service.submit("until_file", gate))
            await asyncio.sleep(0)
            more = [asyncio.create_task(service.submit("echo", {})) for _ in range(3)]
            go_on.set()
            job, _ = await coming
            rest = [(await each)[0] for each in more]
            assert job.status is JobStatus.RUNNING
            assert {each.status for each in rest} == {JobStatus.QUEUED}
            (tmp_path / "gate").touch()
            for each in (holder, job, *rest):
                done = await finished(service, each)
                assert (done.status, done.attempt) == (JobStatus.SUCCEEDED, 1)
            assert sum(service.load().running.values()) == 0

    asyncio.run(scenario())


def test_lanes_go_before_one_another_and_the_oldest_of_a_lane_first(any_database_url):
    database = database_of(any_database_url)
    store = JobStore(database, "host:1:1:me", 3)
    store.migrate()
    ids = {}
    for name, lane in (("t1", "training"), ("b1", "batch"), ("i1", "interactive"), ("i2", "interactive")):
        kind = JobKind(name, "nowhere:work", lane)
        claim, _ = store.insert(kind, {}, run_now=False, places=9)
        ids[claim.id] = name
    # One that could begin at once waits behind those that come before it.
    late, _ = store.insert(JobKind("t2", "nowhere:work", "training"), {}, run_now=True, places=9)
    ids[late.id] = "t2"
    assert store.waiting() == {"interactive": 2, "batch": 1, "training": 2}
    claims = [store.claim(lanes) for lanes in (LANES, LANES, ("training",), LANES, LANES, LANES)]
    names = [claim and ids[claim.id] for claim in claims]
    assert names == ["i1", "i2", "t1", "b1", "t2", None]
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
            places=9,
            time_limit_s=limit_s,
        )[0].id
        for name, limit_s in (("hasty", 5.0), ("hasty", None), ("patient", 5.0))
    ]
    assert list(store.deadlines(["hasty", "unknown"])) == taken_in[:1]
    database.dispose()


def test_what_others_have_answered_is_not_answered_here(any_database_url):
    database = database_of(any_database_url)
    kinds = [JobKind("hasty", "nowhere:work", "interactive", at_once="nowhere:answer")]
    here, elsewhere = (JobStore(database, name, 3, kinds) for name in ("here", "elsewhere"))
    here.migrate()
    waits = {"run_now": False, "places": 9}
    answered_elsewhere, cancelled, first, last = (
        here.insert(kinds[0], {}, time_limit_s=n / 1000, **waits)[0] for n in range(4)
    )
    answered = []

    async def answer(job_ids):
        answered.extend(job_ids)
        if last.id in job_ids:
            reserve.end()
        return dict.fromkeys([job.id for job in here.claim_these(job_ids)], 0.0)

    async def scenario():
        for job in (answered_elsewhere, cancelled, first):
            reserve.watch(job)
        # What is known here of those that wait is only how long an answer takes.
        elsewhere.claim_these([answered_elsewhere.id])
        elsewhere.cancel(cancelled.id)
        await reserve.answering.run()

    ready = SimpleNamespace(ready=1)
    reserve = Reserve(here, Writer(), ready, answer, lambda: True)
    asyncio.run(scenario())
    assert answered == [first.id, last.id]
    database.dispose()
