"""Several services on one PostgreSQL database: jobs are done by all, and none is done twice."""

import asyncio
import json
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

from harness import (
    KINDS,
    database_of,
    finished,
    make_service,
    reports,
    running,
    two_services,
)
from structlog.contextvars import bound_contextvars

from app.jobs.clock import Clock
from app.jobs.errors import QueueFull
from app.jobs.local import LocalExecutor
from app.jobs.model import Idempotency, JobKind, JobStatus, Progress, WorkResult
from app.jobs.store import JobStore


def test_a_service_works_on_what_another_has_taken_in_and_its_callers_are_told(shared_url, tmp_path):
    async def scenario():
        async with two_services(shared_url) as (one, other):
            gate = tmp_path / "gate"
            mine, _ = await one.submit("until_file", {"path": str(gate)})
            theirs, _ = await one.submit("until_file", {"path": str(gate)})
            await reports(one, mine)
            # Seen in the table, where the other stores it.
            await reports(one, theirs)
            waiting = [asyncio.ensure_future(finished(one, job)) for job in (mine, theirs)]
            events = asyncio.ensure_future(anext(one.events(theirs.id)))
            assert (await events).data["fraction"] == 0.25
            gate.touch()
            pids = {(await ended).result["pid"] for ended in waiting}
            assert len(pids) == 2
            assert (await other.get(mine.id)).status is JobStatus.SUCCEEDED

    asyncio.run(scenario())


def test_two_dispatchers_never_do_a_job_twice(shared_url, tmp_path):
    async def scenario():
        log = tmp_path / "log"
        async with two_services(shared_url, slots=2) as services:
            taken = await asyncio.gather(
                *(
                    services[number % 2].submit("note", {"log": str(log), "number": number})
                    for number in range(200)
                )
            )
            done = [await finished(services[(number + 1) % 2], job) for number, (job, _) in enumerate(taken)]
        assert {job.status for job in done} == {JobStatus.SUCCEEDED}
        assert {job.attempt for job in done} == {1}
        assert Counter(log.read_text().split()) == Counter(map(str, range(200)))

    asyncio.run(scenario())


def test_a_job_is_cancelled_from_another_service(shared_url):
    async def scenario():
        async with two_services(shared_url) as (one, other):
            job, _ = await one.submit("until_stopped", {})
            await reports(one, job)
            assert (await other.cancel(job.id)).status is JobStatus.RUNNING
            ended = await finished(other, job)
            assert (ended.status, ended.result["cancelled"]) == (JobStatus.CANCELLED, True)
            assert await one.get(job.id) == ended

    asyncio.run(scenario())


def test_one_key_makes_one_job_and_the_queue_has_one_limit_for_all(shared_url, tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        async with two_services(shared_url, max_queued=3) as services:
            for service in services:
                job, _ = await service.submit("until_file", {"path": str(gate)})
                await reports(service, job)
            keyed = await asyncio.gather(
                *(
                    services[number % 2].submit("echo", {}, idempotency=Idempotency("me", "key", "hash"))
                    for number in range(8)
                )
            )
            assert len({job.id for job, _ in keyed}) == 1
            assert [created for _, created in keyed].count(True) == 1
            answers = await asyncio.gather(
                *(services[number % 2].submit("echo", {}) for number in range(10)), return_exceptions=True
            )
            assert sum(isinstance(answer, QueueFull) for answer in answers) == 8
            gate.touch()
            for answer in answers:
                if not isinstance(answer, QueueFull):
                    assert (await finished(services[0], answer[0])).status is JobStatus.SUCCEEDED

    asyncio.run(scenario())


def test_of_those_who_take_a_job_out_of_its_turn_at_once_one_gets_it(shared_url):
    stores = [JobStore(database_of(shared_url), name, 3) for name in ("one", "other")]
    stores[0].migrate()
    hasty = JobKind("hasty", "job_work:until_file", "interactive", at_once="job_work:note")
    with ThreadPoolExecutor(2) as threads:
        for _ in range(50):
            taken_in, _ = stores[0].insert(hasty, {}, run_now=False, places=100)
            claims = threads.map(lambda store, job_id=taken_in.id: store.claim_these([job_id]), stores)
            [claim] = [claim for taken in claims for claim in taken]
            assert (claim.id, claim.attempt) == (taken_in.id, 1)
    for store in stores:
        store.database.dispose()


def test_one_whose_time_is_up_is_answered_once_though_several_watch_over_it(shared_url, tmp_path):
    log, gate = tmp_path / "log", tmp_path / "gate"
    hasty = (*KINDS, JobKind("hasty", "job_work:until_file", "interactive", at_once="job_work:note"))

    async def scenario():
        options = {"kinds": hasty, "max_queued": 1000}
        async with running(shared_url, **options) as busy:
            await busy.submit("until_file", {"path": str(gate)})
            jobs = [
                (
                    await busy.submit(
                        "hasty", {"log": str(log), "number": number, "path": str(gate)}, time_limit_s=0.0
                    )
                )[0]
                for number in range(40)
            ]

            # Neither has a worker that becomes free, so all is answered beside those, by both at a time.
            def slow():
                cold = LocalExecutor(1, warm_up="job_work:never")
                return {**options, "reserve": LocalExecutor(1), "executor": cold}

            databases = [database_of(shared_url) for _ in range(2)]
            services = [make_service(database, **slow()) for database in databases]
            await asyncio.gather(*(service.start() for service in services))
            done = [await finished(busy, job) for job in jobs]
            await asyncio.gather(*(service.stop(0.0) for service in services))
            for database in databases:
                database.dispose()
            gate.touch()
        assert {(job.status, job.attempt) for job in done} == {(JobStatus.SUCCEEDED, 1)}
        assert Counter(log.read_text().split()) == Counter(map(str, range(40)))

    asyncio.run(scenario())


def test_the_id_of_a_request_reaches_the_worker_of_another_service(shared_url, capfd):
    async def scenario():
        loud = LocalExecutor(1, log_level="info")
        async with running(shared_url, executor=loud, max_queued=1000) as other:
            database = database_of(shared_url)
            cold = LocalExecutor(1, warm_up="job_work:never")
            one = make_service(database, executor=cold, max_queued=1000)
            await one.start()
            with bound_contextvars(request_id="r-1", key_id="k-1"):
                job, _ = await one.submit("speak", {"said": ""})
            assert (await finished(one, job)).attempt == 1
            assert (await other.get(job.id)).key_id == "k-1"
            await one.stop(0.0)
            database.dispose()
        return job.id

    job_id = asyncio.run(scenario())
    lines = [json.loads(line) for line in capfd.readouterr().err.splitlines() if line.startswith("{")]
    [said] = [line for line in lines if line["event"] == "said"]
    assert (said["request_id"], said["key_id"], said["job_id"]) == ("r-1", "k-1", job_id)


def test_times_are_those_of_the_database_whatever_a_machine_thinks(shared_url):
    hours = 3600.0
    database = database_of(shared_url)
    astray = JobStore(database, "astray", 3, clock=Clock(lambda: time.time() + 10 * hours))
    right = JobStore(database, "right", 3, KINDS)
    astray.migrate()
    before = time.time() - 60.0
    taken_in, _ = astray.insert(KINDS[0], {}, run_now=False, places=9, time_limit_s=hours)
    assert before < taken_in.created_at.timestamp() < time.time() + 60.0
    for store in (astray, right):
        [deadline] = store.deadlines([KINDS[0].name]).values()
        assert hours - 60.0 < deadline - store.clock.now() <= hours
    claim = astray.claim(["interactive"])
    assert hours - 60.0 < claim.deadline - astray.clock.now() <= hours
    done = right.succeed(claim.id, 1, WorkResult({}), Progress())
    assert before < done.created_at.timestamp() <= done.started_at.timestamp()
    assert done.started_at <= done.finished_at
    assert done.finished_at.timestamp() < time.time() + 60.0
    database.dispose()
