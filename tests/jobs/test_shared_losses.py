"""Several services on one PostgreSQL database, where one is lost, or the database: no job is."""

import asyncio
import subprocess
import sys
from pathlib import Path
from signal import SIGINT, SIGKILL, SIGQUIT

import pytest
import sqlalchemy as sa
from harness import (
    GATED,
    KINDS,
    LEASE_S,
    PATIENCE_S,
    completions_of,
    database_of,
    eventually,
    finished,
    make_completions,
    reports,
    running,
    two_services,
)
from postgresql_server import PostgresqlServer
from sqlalchemy.exc import OperationalError

from app.jobs.model import Idempotency, JobKind, JobStatus
from app.jobs.peers import Peers
from app.jobs.store import JobStore

HERE = Path(__file__).parent


def test_what_a_killed_service_ran_is_done_by_the_others(shared_url, tmp_path):
    make_completions(shared_url)
    gate = tmp_path / "gate"
    process = subprocess.Popen(
        [sys.executable, str(HERE / "service_process.py"), shared_url, str(gate), "6"],
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
        async with running(shared_url, kinds=(GATED,), lease_s=LEASE_S) as service:
            done = [await service.wait(job_id, PATIENCE_S) for job_id in accepted]
        assert {job.status for job in done} == {JobStatus.SUCCEEDED}
        assert sorted(job.attempt for job in done) == [1, 1, 1, 1, 2, 2]

    asyncio.run(scenario())
    assert sorted(completions_of(shared_url)) == sorted(accepted)


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


def test_nobody_is_judged_before_all_had_the_time_to_show_themselves(shared_url):
    now = [1000.0]
    database = database_of(shared_url)
    stores = [JobStore(database, name, 3) for name in ("judge", "other")]
    stores[0].migrate()
    judge, other = (Peers(store, 10.0, clock=lambda: now[0]) for store in stores)

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


def test_a_job_of_which_a_cut_connection_left_no_word_is_not_forgotten(any_database_url):
    async def scenario():
        async with running(any_database_url, lease_s=LEASE_S) as service:
            # As if the commit of a job that begins as running had been made and its confirmation lost.
            store = service._store
            kind = next(kind for kind in KINDS if kind.name == "echo")
            claim, _ = await asyncio.to_thread(store.insert, kind, {"n": 1}, run_now=True, places=1)
            done = await finished(service, claim)
            assert (done.status, done.attempt) == (JobStatus.SUCCEEDED, 2)

    asyncio.run(scenario())


def test_a_service_that_takes_its_own_job_again_loses_no_worker(shared_url, tmp_path):
    async def scenario():
        async with running(shared_url, slots=2, lease_s=LEASE_S) as one:
            database = database_of(shared_url)
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
            await eventually(lambda: not list(one._attempts))
            assert sum(one.load().running.values()) == 0
            await eventually(lambda: one.load().ready == 2)
            both = [(await one.submit("echo", {}))[0] for _ in range(2)]
            assert {(await finished(one, each)).status for each in both} == {JobStatus.SUCCEEDED}
            database.dispose()

    asyncio.run(scenario())


def test_a_service_that_was_taken_for_dead_gives_up_its_work(shared_url, tmp_path):
    async def scenario():
        async with two_services(shared_url, lease_s=LEASE_S) as (one, other):
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
