"""Workers and services that are killed, by SIGKILL and in the midst of work."""

import asyncio
import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import sqlalchemy as sa
from harness import (
    GATED,
    KINDS,
    PATIENCE_S,
    database_of,
    eventually,
    finished,
    make_service,
    reports,
    running,
    url_of,
)
from live_service import has_exited, workers_of

from app.jobs.local import LocalExecutor
from app.jobs.model import JobStatus
from app.jobs.service import JobService

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def test_a_job_survives_the_death_of_its_worker(tmp_path):
    async def scenario():
        async with running(tmp_path, slots=2) as service:
            log = tmp_path / "deaths"
            bystander, _ = await service.submit("until_file", {"path": str(tmp_path / "gate")})
            job, _ = await service.submit("die", {"log": str(log), "deaths": 2})
            done = await finished(service, job)
            assert (done.status, done.attempt, done.result) == (JobStatus.SUCCEEDED, 3, {"deaths": 2})
            assert len(set(log.read_text().split())) == 2
            (tmp_path / "gate").touch()
            assert (await finished(service, bystander)).attempt == 1

    asyncio.run(scenario())


def test_a_job_that_kills_three_workers_has_failed_and_the_others_go_on(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            job, _ = await service.submit("die", {"log": str(tmp_path / "deaths"), "deaths": 99})
            others = [(await service.submit("echo", {"n": n}))[0] for n in range(3)]
            done = await finished(service, job)
            assert (done.status, done.attempt) == (JobStatus.FAILED, 3)
            assert done.error["code"] == "worker-lost"
            assert "3 attempts" in done.error["detail"]
            for other in others:
                assert (await finished(service, other)).status is JobStatus.SUCCEEDED

    asyncio.run(scenario())


def test_an_idle_worker_that_dies_is_replaced_and_costs_no_attempt(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            pid = (await finished(service, (await service.submit("echo", {}))[0])).result["pid"]
            os.kill(pid, signal.SIGKILL)
            await eventually(lambda: service.load().ready == 0)
            await eventually(lambda: service.load().ready == 1)
            done = await finished(service, (await service.submit("echo", {}))[0])
            assert (done.status, done.attempt) == (JobStatus.SUCCEEDED, 1)
            assert done.result["pid"] != pid

    asyncio.run(scenario())


def test_every_accepted_job_of_a_killed_service_is_finished_once(tmp_path):
    gate = tmp_path / "gate"
    process = subprocess.Popen(
        [sys.executable, str(HERE / "service_process.py"), url_of(tmp_path), str(gate), "6"],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{HERE}"},
    )
    accepted, workers = [], []
    assert process.stdout is not None
    for line in process.stdout:
        what, *words = line.split()
        if what == "working":
            workers = [int(word) for word in words]
            break
        accepted += words
    process.kill()
    process.wait()
    process.stdout.close()
    assert len(accepted) == 6
    assert len(workers) == 2

    async def scenario():
        await eventually(lambda: all(has_exited(pid) for pid in workers))
        gate.touch()
        async with running(tmp_path, kinds=(GATED,), slots=2) as service:
            attempts = []
            for job_id in accepted:
                done = await service.wait(job_id, PATIENCE_S)
                assert done.status is JobStatus.SUCCEEDED
                assert done.result["registered"]
                attempts.append(done.attempt)
            assert attempts == [2, 2, 1, 1, 1, 1]

    asyncio.run(scenario())
    database = database_of(url_of(tmp_path))
    with database.read() as connection:
        completions = connection.scalars(sa.text("SELECT job_id FROM completions")).all()
    database.dispose()
    assert sorted(completions) == sorted(accepted)


def test_progress_of_a_long_job_survives_a_crash(tmp_path):
    async def scenario():
        database = database_of(url_of(tmp_path))
        service = make_service(database)
        await service.start()
        job, _ = await service.submit("until_file", {"path": str(tmp_path / "gate")})
        await reports(service, job)
        shown = (await service.get(job.id)).progress

        def stored() -> bool:
            with database.read() as connection:
                progress = connection.scalar(sa.text("SELECT progress FROM jobs"))
            return json.loads(progress)["epoch"] == shown.epoch

        await eventually(stored)
        (tmp_path / "gate").touch()
        await service.stop(PATIENCE_S)
        database.dispose()

    asyncio.run(scenario())


def test_workers_are_single_threaded_warm_and_light(tmp_path):
    async def scenario():
        database = database_of(url_of(tmp_path))
        before = dict(os.environ)
        executor = LocalExecutor(1, warm_up="job_work:warm_up")
        service = JobService(database, KINDS, executor)
        await service.start()
        done = await finished(service, (await service.submit("surroundings", {}))[0])
        assert done.result == {"threads": ["1", "1", "1"], "warm": True, "heavy": []}
        assert dict(os.environ) == before
        await service.stop(0)
        database.dispose()

    asyncio.run(scenario())


def test_a_worker_whose_warm_up_fails_is_not_ready_and_tried_again(tmp_path):
    async def scenario():
        marker = tmp_path / "marker"
        executor = LocalExecutor(
            1,
            warm_up="job_work:warm_up_at_second_try",
            environment={"WARM_UP_MARKER": str(marker)},
        )
        warm = asyncio.Event()
        await executor.start(warm.set)
        await eventually(marker.exists)
        assert executor.ready == 0
        await asyncio.wait_for(warm.wait(), PATIENCE_S)
        assert executor.ready == 1
        await executor.close()
        assert executor.ready == 0

    asyncio.run(scenario())


def test_workers_that_warm_up_hold_no_thread_that_requests_need(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(1))
        executor = LocalExecutor(3, warm_up="job_work:until_gate", environment={"GATE": str(gate)})
        await executor.start(lambda: None)
        await eventually(lambda: len(workers_of(os.getpid())) == 3)
        # All three are warming up, and the only thread is free.
        assert await asyncio.wait_for(asyncio.to_thread(lambda: 1), PATIENCE_S) == 1
        assert executor.ready == 0
        gate.touch()
        await eventually(lambda: executor.ready == 3)
        await executor.close()

    asyncio.run(scenario())


def test_closing_does_not_wait_for_a_worker_that_is_starting(tmp_path):
    async def scenario():
        executor = LocalExecutor(2)
        await executor.start(lambda: None)
        await asyncio.wait_for(executor.close(), PATIENCE_S)
        assert executor.ready == 0

    asyncio.run(scenario())


def test_the_web_side_imports_neither_torch_nor_numba_and_the_worker_no_database():
    for module, heavy in (
        ("app.jobs.service, app.jobs.local", "{'torch', 'numba', 'numpy'}"),
        ("app.jobs.worker", "{'torch', 'numba', 'numpy', 'sqlalchemy', 'alembic'}"),
    ):
        program = f"import sys, {module}; print(sorted({heavy} & set(sys.modules)))"
        answer = subprocess.run(
            [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
        )
        assert answer.stdout.strip() == "[]"
