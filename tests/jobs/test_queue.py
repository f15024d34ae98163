"""Who is refused and when to come back, and which of those that wait come first."""

import asyncio

import pytest
from harness import KINDS, finished, running

from app.jobs.attempts import Attempts
from app.jobs.errors import QueueFull
from app.jobs.model import JobKind, JobStatus


def test_a_full_queue_refuses_and_says_when_to_come_back(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        async with running(tmp_path, max_queued=2) as service:
            jobs = [(await service.submit("until_file", {"path": str(gate)}))[0] for _ in range(3)]
            assert [job.status.value for job in jobs] == ["running", "queued", "queued"]
            with pytest.raises(QueueFull) as refusal:
                await service.submit("echo", {})
            assert refusal.value.retry_after_s >= 1
            assert service.waiting() == {"interactive": 2, "batch": 0, "training": 0}
            await service.submit("train", {"path": str(gate)})  # the other lane has places of its own
            gate.touch()
            for job in jobs:
                assert (await finished(service, job)).status is JobStatus.SUCCEEDED
            await finished(service, (await service.submit("echo", {}))[0])

    asyncio.run(scenario())


def test_retry_after_is_the_time_until_one_place_is_free():
    lanes = Attempts(3)
    assert lanes.time_to_a_place("interactive", []) == 1.0
    lanes.ran("interactive", [4.0, 8.0])
    lanes.ran("training", [100.0])
    # A worker is free, or will be when it is warm: one of three takes a job every 2 s, of two every 50 s.
    assert lanes.time_to_a_place("interactive", []) == 6.0 / 3
    assert lanes.time_to_a_place("training", []) == 100.0 / 2
    # Of three that run the first has 2 s left of its 6, however many wait.
    busy = [("interactive", 4.0, None), ("interactive", 1.0, None), ("interactive", 1.0, None)]
    assert lanes.time_to_a_place("interactive", busy) == 2.0
    # Those of other lanes hold workers too, and a lane waits for its own where it may have no more workers.
    assert lanes.time_to_a_place("interactive", [("training", 99.0, None), *busy[1:]]) == 1.0
    trainings = [("training", 30.0, None), ("training", 60.0, None)]
    assert lanes.time_to_a_place("training", [*trainings, ("interactive", 5.0, None)]) == 40.0


def test_retry_after_believes_what_runs_longer_than_what_ran():
    lanes = Attempts(1)
    lanes.ran("interactive", [0.1, 0.1])
    # It goes on for as long again, unless its time limit ends it.
    assert lanes.time_to_a_place("interactive", [("interactive", 60.0, None)]) == 60.0
    assert lanes.time_to_a_place("interactive", [("interactive", 60.0, 5.0)]) == 5.0


def test_those_who_are_refused_together_do_not_all_come_back_together(tmp_path):
    async def scenario():
        async with running(tmp_path, max_queued=0) as service:
            await service.submit("until_file", {"path": str(tmp_path / "gate")})
            told = set()
            for _ in range(20):
                with pytest.raises(QueueFull) as refusal:
                    await service.submit("echo", {})
                told.add(refusal.value.retry_after_s)
            assert len(told) > 10
            assert min(told) >= 1.0
            assert max(told) < 10.0

    asyncio.run(scenario())


def test_trainings_leave_a_worker_to_what_somebody_waits_for(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        async with running(tmp_path, slots=2) as service:
            trainings = [(await service.submit("train", {"path": str(gate)}))[0] for _ in range(3)]
            for _ in range(3):
                short = await finished(service, (await service.submit("echo", {}))[0])
                assert short.status is JobStatus.SUCCEEDED
            states = [(await service.get(job.id)).status.value for job in trainings]
            assert states == ["running", "queued", "queued"]
            gate.touch()
            for job in trainings:
                assert (await finished(service, job)).status is JobStatus.SUCCEEDED

    asyncio.run(scenario())


def test_batches_leave_a_worker_to_what_somebody_waits_for(tmp_path):
    batch = (*KINDS, JobKind("batch", "job_work:until_file", "batch"))

    async def scenario():
        gate = tmp_path / "gate"
        async with running(tmp_path, slots=2, kinds=batch) as service:
            jobs = [(await service.submit("batch", {"path": str(gate)}))[0] for _ in range(3)]
            for _ in range(3):
                short = await finished(service, (await service.submit("echo", {}))[0])
                assert short.status is JobStatus.SUCCEEDED
            states = [(await service.get(job.id)).status.value for job in jobs]
            assert states == ["running", "queued", "queued"]
            gate.touch()
            for job in jobs:
                assert (await finished(service, job)).status is JobStatus.SUCCEEDED

    asyncio.run(scenario())


def test_on_a_single_worker_what_somebody_waits_for_comes_first(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        async with running(tmp_path, slots=1) as service:
            first, second = [(await service.submit("train", {"path": str(gate)}))[0] for _ in range(2)]
            short, _ = await service.submit("echo", {})
            assert first.status is JobStatus.RUNNING
            gate.touch()
            first, second, short = [await finished(service, job) for job in (first, second, short)]
            assert first.finished_at <= short.started_at
            assert short.finished_at <= second.started_at

    asyncio.run(scenario())
