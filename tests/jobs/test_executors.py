"""What the dispatcher may rely on, of every executor: on this machine, and on a Ray cluster of two nodes."""

import asyncio
import os
import signal
import sys
from collections import Counter
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from harness import KINDS, database_of, eventually, finished, running, url_of
from ray_nodes import RayNodes, ray_is_installed

from app.jobs.executor import SINGLE_THREADED, Lost, Raised, Returned
from app.jobs.local import LocalExecutor
from app.jobs.model import JobStatus, Progress
from app.jobs.ray_cluster import RayExecutor
from app.jobs.service import JobService
from app.learning.train_library import source_tasks, train_library
from app.learning.universal.training import production
from app.learning.universal.training.production import Production, UniversalTrainingParameters
from app.simulation.generator import FAMILIES

HERE = Path(__file__).parent
TINY = UniversalTrainingParameters(
    plans=1,
    rounds=1,
    corrections=1,
    size=2,
    first_updates=2,
    round_updates=1,
    width=8,
    layers=1,
    metric_problems=1,
    search=0.01,
)
HOW_TO_GET_IT = "no Ray: pip install '.[ray]' (REQUIRE_RAY=1 makes this a failure)"

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")


@pytest.fixture(scope="module")
def nodes():
    if not ray_is_installed() and os.environ.get("REQUIRE_RAY") != "1":
        pytest.skip(HOW_TO_GET_IT)
    cluster = RayNodes(2)
    yield cluster
    cluster.close()


@pytest.fixture(params=["local", "ray"])
def new_executor(request):
    """Makes executors with two workers."""
    if request.param == "local":
        return LocalExecutor
    return ray_executors(request.getfixturevalue("nodes"))


def ray_executors(nodes):
    path = os.pathsep.join([str(HERE.parents[1]), str(HERE), *sys.path])

    def make(slots, **options):
        environment = {**SINGLE_THREADED, "PYTHONPATH": path}
        return RayExecutor(slots, address=nodes.address, environment=environment, **options)

    return make


@asynccontextmanager
async def started(new_executor, **options):
    executor = new_executor(2, **options)
    heard = []
    await executor.start(lambda: heard.append(executor.ready))
    try:
        await eventually(lambda: executor.ready == executor.capacity == 2)
        assert heard == [1, 2]
        yield executor
    finally:
        await executor.close()


def submit(executor, work, payload=None, time_left_s=None):
    """Submit work, and return it with the list of its progresses."""
    told = []
    execution = executor.submit(
        f"job_work:{work}", payload or {}, time_left_s=time_left_s, on_progress=told.append, labels={}
    )
    return execution, told


def test_results_errors_and_time_come_through(new_executor):
    async def scenario():
        async with started(new_executor, warm_up="job_work:warm_up") as executor:
            done = await submit(executor, "echo", {"n": 1, "artifact": "bytes"})[0].outcome()
            assert isinstance(done, Returned)
            assert (done.work.result["echo"]["n"], done.work.artifact) == (1, b"bytes")

            refused = await submit(executor, "refuse")[0].outcome()
            assert isinstance(refused, Raised)
            assert refused.error["code"] == "invalid-problem"
            assert refused.error["violations"] == [
                {"pointer": "/uavs/0/speed", "detail": "speed is 0, must be > 0"}
            ]
            for work, name in (("defect", "ZeroDivisionError"), ("leave", "SystemExit"), ("not_json", "Val")):
                failed = await submit(executor, work)[0].outcome()
                assert isinstance(failed, Raised), work
                assert name in failed.error["detail"]
                assert work in failed.traceback or work == "not_json"

            surroundings = await submit(executor, "surroundings")[0].outcome()
            assert surroundings.work.result["threads"] == ["1", "1", "1"]
            assert surroundings.work.result["warm"]

            late = await submit(executor, "until_stopped", time_left_s=-1.0)[0].outcome()
            assert late.work.result["best"] == 0
            assert late.work.result["time_left"] <= 0
            soon = await submit(executor, "until_stopped", time_left_s=0.2)[0].outcome()
            assert not soon.work.result["cancelled"]
            assert soon.work.result["time_left"] <= 0
            assert executor.restarts == 0

    asyncio.run(scenario())


async def progress_comes_while_work_goes_on_and_the_last_before_the_outcome(executor, folder):
    execution, told = submit(executor, "epochs", {"folder": str(folder), "epochs": 3})
    for epoch in (1, 2, 3):
        (folder / str(epoch)).touch()
        await eventually(lambda epoch=epoch: bool(told) and told[-1].epoch == epoch)
    (folder / "end").touch()
    assert isinstance(await execution.outcome(), Returned)
    assert told == [Progress(epoch / 3, epoch=epoch) for epoch in (1, 2, 3)]

    execution, told = submit(executor, "until_stopped", time_left_s=0.0)
    await execution.outcome()
    assert told == []
    execution, told = submit(executor, "chatter", {"seconds": 0.5})
    ended = await execution.outcome()
    assert told[-1].epoch == ended.work.result["reports"]
    assert told[-1].fraction == 1.0


async def work_is_cancelled_wherever_it_is(executor):
    running_ones = [submit(executor, "until_stopped") for _ in range(2)]
    waiting, _ = submit(executor, "until_stopped")
    for _, told in running_ones:
        await eventually(lambda told=told: bool(told))
    waiting.cancel()
    for execution, told in running_ones:
        execution.cancel()
        ended = await execution.outcome()
        assert ended.work.result["cancelled"]
        assert told[-1].epoch == ended.work.result["best"] > 0
    assert (await waiting.outcome()).work.result == {"best": 0, "cancelled": True, "time_left": None}
    # The flag was that work's, not the worker's.
    soon = await submit(executor, "until_stopped", time_left_s=0.1)[0].outcome()
    assert not soon.work.result["cancelled"]


def test_progress_comes_work_is_cancelled_and_closing_ends_what_runs(new_executor, tmp_path):
    """In one executor: on a cluster its workers take seconds to start."""

    async def scenario():
        async with started(new_executor) as executor:
            await progress_comes_while_work_goes_on_and_the_last_before_the_outcome(executor, tmp_path)
            await work_is_cancelled_wherever_it_is(executor)
            deaf, told = submit(executor, "deaf")
            await eventually(lambda: bool(told))
        assert isinstance(await deaf.outcome(), Lost)
        assert executor.ready == 0

    asyncio.run(scenario())


def test_work_may_use_the_cores_of_workers_that_do_nothing(tmp_path):
    async def scenario():
        executor = LocalExecutor(3)
        await executor.start(lambda: None)
        try:
            await eventually(lambda: executor.ready == 3)
            first, told = submit(executor, "share_until_file", {"path": str(tmp_path / "first")})
            await eventually(lambda: bool(told) and told[-1].epoch == 3)
            second, told_too = submit(executor, "share_until_file", {"path": str(tmp_path / "second")})
            await eventually(lambda: bool(told_too) and told[-1].epoch == told_too[-1].epoch == 1)
            (tmp_path / "first").touch()
            await first.outcome()
            await eventually(lambda: told_too[-1].epoch == 3)
            (tmp_path / "second").touch()
            await second.outcome()
        finally:
            await executor.close()

    asyncio.run(scenario())


def test_a_dead_worker_loses_its_own_work_and_is_replaced(new_executor, tmp_path):
    async def scenario():
        async with started(new_executor) as executor:
            gate = tmp_path / "gate"
            bystander, _ = submit(executor, "until_file", {"path": str(gate)})
            log = tmp_path / "deaths"
            lost = await submit(executor, "die", {"log": str(log), "deaths": 1})[0].outcome()
            assert isinstance(lost, Lost)
            deaf, told = submit(executor, "deaf")
            await eventually(lambda: bool(told))
            waiting, _ = submit(executor, "echo")
            given_up, _ = submit(executor, "echo")
            given_up.kill()
            assert isinstance(await given_up.outcome(), Lost)
            deaf.kill()
            assert isinstance(await deaf.outcome(), Lost)
            assert isinstance(await waiting.outcome(), Returned)
            await eventually(lambda: executor.ready == 2)
            assert executor.restarts == 2
            gate.touch()
            assert isinstance(await bystander.outcome(), Returned)

    asyncio.run(scenario())


def test_work_that_is_ended_on_its_way_to_a_worker_is_lost_and_not_done_by_another(tmp_path):
    async def scenario():
        executor, log = LocalExecutor(1), tmp_path / "log"
        await executor.start(lambda: None)
        await eventually(lambda: executor.ready == 1)
        # It takes nothing more out of its pipe, which does not hold all of the payload.
        pid = (await submit(executor, "echo")[0].outcome()).work.result["pid"]
        os.kill(pid, signal.SIGSTOP)
        stuck, _ = submit(executor, "note", {"log": str(log), "number": 1, "much": "x" * 10_000_000})
        await eventually(lambda: stuck.worker is not None)
        stuck.kill()
        assert isinstance(await stuck.outcome(), Lost)
        await eventually(lambda: executor.ready == 1 and executor.restarts == 1)
        await submit(executor, "note", {"log": str(log), "number": 2})[0].outcome()
        assert log.read_text().split() == ["2"]
        await executor.close()

    asyncio.run(scenario())


def test_a_killed_node_loses_no_job(nodes, tmp_path):
    async def scenario():
        log = tmp_path / "log"
        database = database_of(url_of(tmp_path))
        service = JobService(database, KINDS, ray_executors(nodes)(2), max_queued=1000)
        await service.start()
        await eventually(lambda: service.load().ready == 2)
        held = [(await service.submit("until_file", {"path": str(tmp_path / "gate")}))[0] for _ in range(1)]
        jobs = [
            (await service.submit("note", {"log": str(log), "number": number}))[0] for number in range(200)
        ]
        await eventually(lambda: log.exists() and len(log.read_text().split()) >= 50)
        nodes.kill_one()
        (tmp_path / "gate").touch()
        done = [await finished(service, job) for job in (*held, *jobs)]
        assert {job.status for job in done} == {JobStatus.SUCCEEDED}
        # Who was lost in the midst of it may have written its line already.
        lines = Counter(map(int, log.read_text().split()))
        assert lines.keys() == set(range(200))
        assert all(lines[number] <= job.attempt for number, job in enumerate(done[1:]))
        nodes.add()
        await eventually(lambda: service.load().ready == 2)
        await service.stop(0)
        database.dispose()

    asyncio.run(scenario())


def test_two_services_share_a_cluster_and_do_no_job_twice(nodes, postgresql, tmp_path):
    async def scenario():
        log = tmp_path / "log"
        url = postgresql.new_database()
        make = ray_executors(nodes)
        # One worker each, on a node each.
        async with (
            running(url, max_queued=1000, executor=make(1)) as one,
            running(url, max_queued=1000, executor=make(1)) as other,
        ):
            services = (one, other)
            jobs = [
                (await services[n % 2].submit("note", {"log": str(log), "number": n}))[0] for n in range(100)
            ]
            done = [await finished(services[(n + 1) % 2], job) for n, job in enumerate(jobs)]
        assert {(job.status, job.attempt) for job in done} == {(JobStatus.SUCCEEDED, 1)}
        assert sorted(map(int, log.read_text().split())) == list(range(100))
        assert len({job.result["pid"] for job in done}) == 2

    asyncio.run(scenario())


def test_a_library_is_the_same_wherever_it_was_trained(nodes, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(HERE.parents[1]))
    tasks = source_tasks([(2, 2, 1), (1, 3, 2)], families=("uniform",))
    told = list(train_library(tasks, tmp_path / "there", n_epochs=6, workers=1, cluster=nodes.address))
    assert {event.task.id for event in told if event.finished} == {task.id for task in tasks}
    list(train_library(tasks, tmp_path / "here", n_epochs=6, workers=1))
    trained = [
        {file.name: file.read_bytes() for file in (tmp_path / where).iterdir()} for where in ("here", "there")
    ]
    assert trained[0] == trained[1]
    # What is there is kept, whoever trained it.
    again = train_library(tasks, tmp_path / "here", n_epochs=6, workers=1, cluster=nodes.address)
    assert [event.kept for event in again] == [True, True]


def test_policy_for_every_size_is_the_same_wherever_its_parts_were_made(nodes, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(HERE.parents[1]))
    monkeypatch.setattr(production, "FAMILIES", {"uniform": FAMILIES["uniform"]})
    made = []
    for where, cluster in (("here", None), ("there", nodes.address)):
        folder = tmp_path / where
        making = Production(folder / "work", TINY, 1, lambda *said: None, cluster)
        made.append(making.run(folder / "library", "all").read_bytes())
    assert made[0] == made[1]
