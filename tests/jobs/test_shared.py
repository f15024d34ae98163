"""Several services on one PostgreSQL database: jobs are done by all, and none is done twice or lost."""

import asyncio
import json
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from pathlib import Path
from signal import SIGINT, SIGKILL, SIGQUIT

import pytest
import sqlalchemy as sa
from harness import (
    GATED,
    KINDS,
    LEASE_S,
    PATIENCE_S,
    database_of,
    eventually,
    finished,
    make_service,
    reports,
    running,
)
from postgresql_server import PostgresqlServer
from sqlalchemy.exc import OperationalError
from structlog.contextvars import bound_contextvars

from app.jobs.capacity import QueueLimit
from app.jobs.clock import Clock
from app.jobs.errors import QueueFull
from app.jobs.local import LocalExecutor
from app.jobs.model import Idempotency, JobKind, JobStatus, Progress, WorkResult
from app.jobs.peers import PostgresPeers
from app.jobs.store import JobStore

HERE = Path(__file__).parent


@pytest.fixture
def url(postgresql):
    return postgresql.new_database()


@asynccontextmanager
async def two_services(url, **settings):
    options = {"max_queued": 1000, **settings}
    async with running(url, **options) as one, running(url, **options) as other:
        yield one, other


def make_completions(url):
    """Make the table in which the harness counts completions, before several services would at once."""
    database = database_of(url)
    with database.write() as connection:
        connection.execute(sa.text("CREATE TABLE completions (job_id TEXT)"))
    database.dispose()


def completions_of(url):
    database = database_of(url)
    with database.read() as connection:
        found = connection.scalars(sa.text("SELECT job_id FROM completions")).all()
    database.dispose()
    return found


def test_a_service_works_on_what_another_has_taken_in_and_its_callers_are_told(url, tmp_path):
    async def scenario():
        async with two_services(url) as (one, other):
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


def test_two_dispatchers_never_do_a_job_twice(url, tmp_path):
    async def scenario():
        log = tmp_path / "log"
        async with two_services(url, slots=2) as services:
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


def test_a_job_is_cancelled_from_another_service(url):
    async def scenario():
        async with two_services(url) as (one, other):
            job, _ = await one.submit("until_stopped", {})
            await reports(one, job)
            assert (await other.cancel(job.id)).status is JobStatus.RUNNING
            ended = await finished(other, job)
            assert (ended.status, ended.result["cancelled"]) == (JobStatus.CANCELLED, True)
            assert await one.get(job.id) == ended

    asyncio.run(scenario())


def test_one_key_makes_one_job_and_the_queue_has_one_limit_for_all(url, tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        async with two_services(url, max_queued=3) as services:
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


def test_of_those_who_take_a_job_out_of_its_turn_at_once_one_gets_it(url):
    stores = [JobStore(database_of(url), name, 3) for name in ("one", "other")]
    stores[0].migrate()
    hasty = JobKind("hasty", "job_work:until_file", "interactive", at_once="job_work:note")
    with ThreadPoolExecutor(2) as threads:
        for _ in range(50):
            taken_in, _ = stores[0].insert(hasty, {}, run_now=False, limit=QueueLimit(100, 1.0))
            claims = threads.map(lambda store, job_id=taken_in.job.id: store.claim_these([job_id]), stores)
            [claim] = [claim for taken in claims for claim in taken]
            assert (claim.job.id, claim.job.attempt) == (taken_in.job.id, 1)
    for store in stores:
        store.database.dispose()


def test_one_whose_time_is_up_is_answered_once_though_several_watch_over_it(url, tmp_path):
    log, gate = tmp_path / "log", tmp_path / "gate"
    hasty = (*KINDS, JobKind("hasty", "job_work:until_file", "interactive", at_once="job_work:note"))

    async def scenario():
        options = {"kinds": hasty, "max_queued": 1000}
        async with running(url, **options) as busy:
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

            databases = [database_of(url) for _ in range(2)]
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


def test_what_a_killed_service_ran_is_done_by_the_others(url, tmp_path):
    make_completions(url)
    gate = tmp_path / "gate"
    process = subprocess.Popen(
        [sys.executable, str(HERE / "service_process.py"), url, str(gate), "6"],
        stdout=subprocess.PIPE,
        text=True,
        cwd=HERE.parents[1],
        env={"PYTHONPATH": f"{HERE.parents[1]}:{HERE}"},
    )
    lines = [process.stdout.readline().split() for _ in range(7)]
    accepted = [line[1] for line in lines if line[0] == "accepted"]
    assert len(accepted) == 6
    process.send_signal(SIGKILL)
    process.wait()
    process.stdout.close()
    gate.touch()

    async def scenario():
        async with running(url, kinds=(GATED,), lease_s=LEASE_S) as service:
            done = [await service.wait(job_id, PATIENCE_S) for job_id in accepted]
        assert {job.status for job in done} == {JobStatus.SUCCEEDED}
        assert sorted(job.attempt for job in done) == [1, 1, 1, 1, 2, 2]

    asyncio.run(scenario())
    assert sorted(completions_of(url)) == sorted(accepted)


@pytest.mark.parametrize("how", [SIGINT, SIGQUIT])
def test_a_restart_of_the_database_loses_nothing(how, tmp_path):
    server = PostgresqlServer()
    try:
        url = server.new_database()
        make_completions(url)
        counted = JobKind("counted", "job_work:note", "interactive", GATED.on_success)

        async def submit(service, number):
            """Submit as a client does that comes again with its key while the service cannot store."""
            while True:
                try:
                    return await service.submit(
                        "counted",
                        {"log": str(tmp_path / "log"), "number": number},
                        idempotency=Idempotency("client", str(number), ""),
                    )
                except OperationalError:
                    await asyncio.sleep(0.05)

        async def scenario():
            async with two_services(url, kinds=(*KINDS, counted), lease_s=LEASE_S) as services:
                gate = asyncio.Event()

                async def client(number):
                    if number >= 40:
                        await gate.wait()
                    return await submit(services[number % 2], number)

                clients = [asyncio.ensure_future(client(number)) for number in range(100)]
                await eventually(lambda: len(completions_of(url)) >= 20)
                gate.set()
                await asyncio.to_thread(server.restart, how)
                jobs = [(await each)[0] for each in clients]
                for number, job in enumerate(jobs):
                    assert (await wait(services[(number + 1) % 2], job)).status is JobStatus.SUCCEEDED
                return jobs

        async def wait(service, job):
            while True:
                try:
                    return await finished(service, job)
                except OperationalError:
                    await asyncio.sleep(0.05)

        jobs = asyncio.run(scenario())
        assert sorted(completions_of(url)) == sorted(job.id for job in jobs)
    finally:
        server.close()


def test_nobody_is_judged_before_all_had_the_time_to_show_themselves(url):
    now = [1000.0]
    database = database_of(url)
    JobStore(database, "a", 3).migrate()
    judge, other = (PostgresPeers(database, name, 10.0, clock=lambda: now[0]) for name in ("judge", "other"))

    def pass_time(seconds):
        now[0] += seconds
        with database.write() as connection:
            connection.execute(sa.text(f"UPDATE job_owners SET seen_at = seen_at - {seconds}"))

    assert other.beat() == {}
    judge.beat()
    # A newcomer does not know for how long the others could not show themselves.
    assert judge.is_alive("other")
    assert judge.is_alive("never seen")
    for _ in range(3):
        pass_time(4.0)
        judge.beat()
    assert not judge.is_alive("other")
    assert not judge.is_alive("never seen")
    other.beat()
    assert judge.is_alive("other")
    # The database was away for long: all look dead, and all get a lease's time.
    pass_time(60.0)
    judge.beat()
    assert judge.is_alive("other")
    other.beat()
    for _ in range(3):
        pass_time(4.0)
        judge.beat()
        other.beat()
    assert judge.is_alive("other")
    other.forget()
    assert not judge.is_alive("other")
    database.dispose()


def test_a_job_of_which_a_cut_connection_left_no_word_is_not_forgotten(url):
    async def scenario():
        async with running(url, lease_s=LEASE_S) as service:
            # As if the commit of a job that begins as running had been made and its confirmation lost.
            store = service._store
            kind = next(kind for kind in KINDS if kind.name == "echo")
            claim, _ = await asyncio.to_thread(
                store.insert, kind, {"n": 1}, run_now=True, limit=QueueLimit(1, 1.0)
            )
            done = await finished(service, claim.job)
            assert (done.status, done.attempt) == (JobStatus.SUCCEEDED, 2)

    asyncio.run(scenario())


def test_a_service_that_takes_its_own_job_again_loses_no_worker(url, tmp_path):
    async def scenario():
        async with running(url, slots=2, lease_s=LEASE_S) as one:
            database = database_of(url)
            judge = JobStore(database, "judge", 3, KINDS)
            job, _ = await one.submit("until_file", {"path": str(tmp_path / "gate")})
            await reports(one, job)
            [lost] = await asyncio.to_thread(judge.recover, lambda owner: False)
            assert (lost.id, lost.status) == (job.id, JobStatus.QUEUED)
            # The other worker of the same service takes it, while the first still works on it.
            one._dispatcher._hear("waiting", "interactive")
            await eventually(lambda: one._attempts.of(job.id).job.attempt == 2)
            assert (await one.cancel(job.id)).status is JobStatus.RUNNING
            (tmp_path / "gate").touch()
            ended = await finished(one, job)
            assert (ended.status, ended.attempt) == (JobStatus.CANCELLED, 2)
            await eventually(lambda: not one._attempts)
            assert sum(one.load().running.values()) == 0
            await eventually(lambda: one.load().ready == 2)
            both = [(await one.submit("echo", {}))[0] for _ in range(2)]
            assert {(await finished(one, each)).status for each in both} == {JobStatus.SUCCEEDED}
            database.dispose()

    asyncio.run(scenario())


def test_the_id_of_a_request_reaches_the_worker_of_another_service(url, capfd):
    async def scenario():
        loud = LocalExecutor(1, log_level="info")
        async with running(url, executor=loud, max_queued=1000) as other:
            database = database_of(url)
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


def test_times_are_those_of_the_database_whatever_a_machine_thinks(url):
    hours = 3600.0
    database = database_of(url)
    astray = JobStore(database, "astray", 3, clock=Clock(lambda: time.time() + 10 * hours))
    right = JobStore(database, "right", 3, KINDS)
    astray.migrate()
    before = time.time() - 60.0
    taken_in, _ = astray.insert(KINDS[0], {}, run_now=False, limit=QueueLimit(9, 1.0), time_limit_s=hours)
    assert before < taken_in.job.created_at.timestamp() < time.time() + 60.0
    for store in (astray, right):
        [deadline] = store.deadlines([KINDS[0].name]).values()
        assert hours - 60.0 < deadline - store.clock.now() <= hours
    claim = astray.claim(["interactive"])
    assert hours - 60.0 < claim.deadline - astray.clock.now() <= hours
    done = right.succeed(claim.job.id, 1, WorkResult({}), Progress())
    assert before < done.created_at.timestamp() <= done.started_at.timestamp()
    assert done.started_at <= done.finished_at
    assert done.finished_at.timestamp() < time.time() + 60.0
    database.dispose()


def test_a_service_that_was_taken_for_dead_gives_up_its_work(url, tmp_path):
    async def scenario():
        async with two_services(url, lease_s=LEASE_S) as (one, other):
            job, _ = await one.submit("until_file", {"path": str(tmp_path / "gate")})
            await reports(one, job)
            # As another service does that has not seen this one for too long.
            lost = await asyncio.to_thread(other._store.recover, lambda owner: False)
            assert [each.id for each in lost] == [job.id]
            await eventually(lambda: one.load().restarts == 1)
            (tmp_path / "gate").touch()
            done = await finished(one, job)
            assert (done.status, done.attempt) == (JobStatus.SUCCEEDED, 2)

    asyncio.run(scenario())
