"""A job's way through the service: taken in, worked on, stored, told."""

import asyncio
import json
import os
from datetime import UTC, datetime
from typing import Any

import pytest
import sqlalchemy as sa
from harness import PATIENCE_S, database_of, finished, make_service, reports, running, url_of
from sqlalchemy.exc import OperationalError
from structlog.contextvars import bound_contextvars

from app.domain.errors import InvalidCheckpoint
from app.jobs import attempts, dispatcher, queries, stored_json
from app.jobs.errors import Draining, IdempotencyMismatch, JobNotFound, UnknownJobKind
from app.jobs.model import Idempotency, JobKind, JobStatus
from policy_store.database import Database
from policy_store.errors import DatabaseOccupied


def test_a_job_goes_round(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            before = datetime.now(UTC)
            job, created = await service.submit("echo", {"a": [1, "ü"], "artifact": "weights"})
            assert created
            assert (job.kind, job.lane, job.attempt, job.result) == ("echo", "interactive", 1, None)
            done = await finished(service, job)
            assert done.status is JobStatus.SUCCEEDED
            assert done.result["echo"] == {"a": [1, "ü"], "artifact": "weights"}
            assert done.progress.fraction == 1.0
            assert before <= done.created_at <= done.started_at <= done.finished_at <= datetime.now(UTC)
            assert done == await service.get(job.id)
            assert done.has_artifact
            assert await service.artifact(job.id) == b"weights"
            plain = await finished(service, (await service.submit("echo", {}))[0])
            assert not plain.has_artifact
            assert await service.artifact(plain.id) is None

    asyncio.run(scenario())


def test_unknown_jobs_and_kinds_are_refused(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            with pytest.raises(UnknownJobKind, match="sing"):
                await service.submit("sing", {})
            for ask in (service.get, service.cancel, service.artifact, lambda each: service.wait(each, 1)):
                with pytest.raises(JobNotFound, match="nobody"):
                    await ask("nobody")
            with pytest.raises(JobNotFound):
                await anext(aiter(service.events("nobody")))

    asyncio.run(scenario())


def test_a_short_job_takes_two_commits(tmp_path):
    async def scenario():
        database = database_of(url_of(tmp_path))
        service = make_service(database)
        await service.start()
        await finished(service, (await service.submit("echo", {}))[0])
        commits = []
        sa.event.listen(database.write_engine, "commit", commits.append)
        job, _ = await service.submit("echo", {})
        assert job.status is JobStatus.RUNNING
        await finished(service, job)
        await service.stop(0)
        assert len(commits) == 2
        database.dispose()

    asyncio.run(scenario())


def test_reasons_of_failure_are_stored(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            refused = await finished(service, (await service.submit("refuse", {}))[0])
            assert refused.status is JobStatus.FAILED
            assert refused.error == {
                "code": "invalid-problem",
                "detail": "uav 'uav-1': speed is 0",
                "violations": [{"pointer": "/uavs/0/speed", "detail": "speed is 0, must be > 0"}],
                "details": {"limit": 3},
            }
            for name, reason in (
                ("defect", "ZeroDivisionError: no targets"),
                ("leave", "SystemExit: 3"),
                ("not_json", "ValueError"),
            ):
                failed = await finished(service, (await service.submit(name, {}))[0])
                assert failed.error["code"] == "internal-error"
                assert reason in failed.error["detail"]
                assert (failed.status, failed.attempt) == (JobStatus.FAILED, 1)
            assert service.load().ready == 1

    asyncio.run(scenario())


def test_what_on_success_returns_is_the_result_and_what_it_raises_the_reason(tmp_path):
    async def scenario():
        def register(connection: sa.Connection, job: Any, work: Any) -> dict[str, Any]:
            connection.execute(sa.text("CREATE TABLE registered (id TEXT)"))
            if "bad" in job.payload:
                raise InvalidCheckpoint("weights are not finite")
            return {"registered": work.artifact.decode(), "status": job.status.value}

        kinds = (JobKind("echo", "job_work:echo", "training", register),)
        async with running(tmp_path, kinds=kinds) as service:
            bad = await finished(service, (await service.submit("echo", {"bad": 1, "artifact": "w"}))[0])
            assert (bad.status, bad.error["code"]) == (JobStatus.FAILED, "invalid-checkpoint")
            assert not bad.has_artifact
            # The table can only be created again because the transaction before was rolled back.
            good = await finished(service, (await service.submit("echo", {"artifact": "w"}))[0])
            assert good.result == {"registered": "w", "status": "running"}

    asyncio.run(scenario())


def test_a_key_makes_a_retry_safe(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        key = Idempotency("client", "k1", "hash-1")
        async with running(tmp_path, max_queued=0) as service:
            submissions = [
                service.submit("until_file", {"path": str(gate)}, idempotency=key) for _ in range(5)
            ]
            answers = await asyncio.gather(*submissions)
            assert sum(created for _, created in answers) == 1
            assert len({job.id for job, _ in answers}) == 1
            first = answers[0][0]
            with pytest.raises(IdempotencyMismatch, match="k1"):
                await service.submit("echo", {}, idempotency=Idempotency("client", "k1", "hash-2"))
            gate.touch()
            done = await finished(service, first)
            other, created = await service.submit(
                "echo", {}, idempotency=Idempotency("another client", "k1", "hash-2")
            )
            assert created
            await finished(service, other)
        async with running(tmp_path, max_queued=0) as service:
            again, created = await service.submit("until_file", {"path": str(gate)}, idempotency=key)
            assert not created
            assert again == done
            # A known key reserves no worker for good.
            assert (await finished(service, (await service.submit("echo", {}))[0])).result

    asyncio.run(scenario())


def test_a_list_reads_neither_payloads_nor_results(tmp_path, monkeypatch):
    def read(text):
        assert "large" not in str(text)
        return text

    async def scenario():
        async with running(tmp_path) as service:
            ended = [
                await finished(service, (await service.submit("echo", {"large": n}))[0]) for n in range(3)
            ]
            monkeypatch.setattr(queries, "read_later", read)
            page = await service.list(10, None, JobStatus.SUCCEEDED)
            assert [job.id for job in page.jobs] == [job.id for job in reversed(ended)]
            assert (await service.list(10, None, JobStatus.FAILED)).jobs == ()
            assert (await service.look(ended[0].id)).id == ended[0].id
            with pytest.raises(AssertionError):
                await service.get(ended[0].id)
            assert json.loads(await service.result_text(ended[0].id))["echo"] == {"large": 0}

    asyncio.run(scenario())


def test_a_job_knows_the_request_and_the_key_that_asked_for_it(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            with bound_contextvars(request_id="r-1", key_id="k-1"):
                job, _ = await service.submit("echo", {})
            nobodys, _ = await service.submit("echo", {})
        async with running(tmp_path) as service:
            asked = [await finished(service, each) for each in (job, nobodys)]
        assert [(each.request_id, each.key_id) for each in asked] == [("r-1", "k-1"), (None, None)]
        assert asked[0].labels == {"request_id": "r-1", "key_id": "k-1", "job_id": job.id}

    asyncio.run(scenario())


def test_a_second_service_on_the_file_is_refused_and_changes_nothing(tmp_path):
    async def scenario():
        gate = {"path": str(tmp_path / "gate")}
        async with running(tmp_path) as first:
            job, _ = await first.submit("until_file", gate)
            await reports(first, job)
            database = database_of(url_of(tmp_path))
            with pytest.raises(DatabaseOccupied, match=str(os.getpid())):
                await make_service(database).start()
            database.dispose()
            (tmp_path / "gate").touch()
            assert (await finished(first, job)).attempt == 1
        async with running(tmp_path) as after:
            assert (await after.get(job.id)).status is JobStatus.SUCCEEDED

    asyncio.run(scenario())


def test_pages_are_newest_first_and_stay_put(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        async with running(tmp_path) as service:
            ids = [(await service.submit("until_file", {"path": str(gate)}))[0].id for _ in range(7)]
            seen, cursor = [], None
            while True:
                page = await service.list(3, cursor)
                seen.append([job.id for job in page.jobs])
                await service.submit("until_file", {"path": str(gate)})
                cursor = page.next_cursor
                if cursor is None:
                    break
            assert seen == [ids[:3:-1], ids[3:0:-1], ids[0:1]]
            assert (await service.list(100)).next_cursor is None
            gate.touch()

    asyncio.run(scenario())


def test_stopping_lets_running_work_end_and_takes_no_more(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        database = database_of(url_of(tmp_path))
        service = make_service(database)
        with pytest.raises(Draining):
            await service.submit("echo", {})
        await service.start()
        job, _ = await service.submit("until_file", {"path": str(gate)})
        queued, _ = await service.submit("echo", {})
        await reports(service, job)
        waiter = asyncio.create_task(service.wait(job.id, None))
        patient = asyncio.create_task(service.wait(queued.id, None))
        stream = service.events(queued.id)
        listener = asyncio.create_task(anext(stream, None))
        stopping = asyncio.create_task(service.stop(PATIENCE_S))
        assert await listener is None  # the stream ends although the job does not
        # Who waits for what does not run is told at once, and nothing is given up for their sake.
        assert (await asyncio.wait_for(patient, PATIENCE_S)).status is JobStatus.QUEUED
        await service.abandon(job.id)
        with pytest.raises(Draining):
            await service.submit("echo", {})
        gate.touch()
        await stopping
        assert (await waiter).status is JobStatus.SUCCEEDED
        assert (await patient).status is JobStatus.QUEUED
        database.dispose()

    asyncio.run(scenario())


def test_what_outlasts_the_grace_goes_on_after_the_next_start(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        for _ in range(4):  # more often than a job may be lost
            async with running(tmp_path, max_attempts=3) as service:
                if not (await service.list(1)).jobs:
                    await service.submit("gated", {"path": str(gate)})
                job = (await service.list(1)).jobs[0]
                await reports(service, job)
        gate.touch()
        async with running(tmp_path) as service:
            done = await finished(service, job)
            assert (done.status, done.attempt) == (JobStatus.SUCCEEDED, 5)
            assert done.result["registered"]

    asyncio.run(scenario())


def test_a_caller_that_goes_away_leaves_its_job_whole(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            caller = asyncio.create_task(service.submit("echo", {}))
            await asyncio.sleep(0)
            await asyncio.sleep(0)
            caller.cancel()
            with pytest.raises(asyncio.CancelledError):
                await caller
            after, _ = await service.submit("echo", {})
            assert (await finished(service, after)).status is JobStatus.SUCCEEDED
            for job in (await service.list(10)).jobs:
                assert (await finished(service, job)).status is JobStatus.SUCCEEDED
            assert service.load().running == {"interactive": 0, "batch": 0, "training": 0}

    asyncio.run(scenario())


class FailingDatabase(Database):
    """A database that cannot be written for a number of transactions, as when the disk is full."""

    failures = 0

    def write(self):
        if self.failures:
            self.failures -= 1
            raise OperationalError("COMMIT", {}, Exception("database or disk is full"))
        return super().write()


def test_a_result_survives_a_database_that_cannot_be_written_for_a_while(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        database = FailingDatabase(url_of(tmp_path), stored_json.write, stored_json.read)
        service = make_service(database)
        await service.start()
        job, _ = await service.submit("gated", {"path": str(gate)})
        waiting, _ = await service.submit("echo", {})
        await reports(service, job)
        database.failures = 3
        gate.touch()
        done = await finished(service, job)
        assert (done.status, done.attempt, database.failures) == (JobStatus.SUCCEEDED, 1, 0)
        assert (await finished(service, waiting)).status is JobStatus.SUCCEEDED
        await service.stop(0)
        database.dispose()

    asyncio.run(scenario())


def test_a_result_that_could_not_be_stored_for_long_costs_an_attempt_and_not_the_job(tmp_path, monkeypatch):
    monkeypatch.setattr(attempts, "_FIRST_PAUSE_S", 0.0)
    monkeypatch.setattr(dispatcher, "_SAVE_INTERVAL_S", 0.01)
    monkeypatch.setattr(dispatcher, "_LOOK_INTERVAL_S", 0.01)
    monkeypatch.setattr(dispatcher, "_AGAIN_S", 0.01)

    async def scenario():
        gate = tmp_path / "gate"
        database = FailingDatabase(url_of(tmp_path), stored_json.write, stored_json.read)
        service = make_service(database)
        await service.start()
        job, _ = await service.submit("gated", {"path": str(gate)})
        await reports(service, job)
        database.failures = 100
        gate.touch()
        done = await finished(service, job)
        assert (done.status, done.attempt, database.failures) == (JobStatus.SUCCEEDED, 2, 0)
        await service.stop(0)
        database.dispose()

    asyncio.run(scenario())
