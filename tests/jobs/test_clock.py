"""Limits and durations while the system's clock is set, and what is done again and again."""

import asyncio
import time

import pytest
from harness import KINDS, finished, reports, running

from app.jobs import service
from app.jobs.clock import Clock, Loop
from app.jobs.local import LocalExecutor
from app.jobs.model import JobKind, JobStatus

HOUR_S = 3600.0
HASTY = (*KINDS, JobKind("hasty", "job_work:until_file", "interactive", at_once="job_work:echo"))


def test_time_passes_evenly_until_the_systems_is_taken_over():
    system, steady = [1000.0], [5.0]
    clock = Clock(lambda: system[0], lambda: steady[0])
    steady[0] += 2.0
    system[0] -= 600.0
    assert clock.now() == 1002.0
    clock.follow()
    assert clock.now() == 400.0
    steady[0] += 1.0
    assert clock.now() == 401.0


def test_a_loop_that_is_woken_while_it_works_works_once_more_and_outlives_a_failure():
    steps = []

    async def step():
        steps.append(len(steps))
        if len(steps) == 1:
            loop.wake()
        elif len(steps) == 2:
            raise OSError("not now")
        else:
            loop.end()

    loop = Loop(step, "a step failed")
    asyncio.run(loop.run())
    assert steps == [0, 1, 2]


@pytest.fixture
def shift(monkeypatch):
    """How far the system's clock is set forward."""
    seconds = [0.0]
    monkeypatch.setattr(service, "Clock", lambda: Clock(lambda: time.time() + seconds[0]))
    return seconds


@pytest.mark.parametrize("by_s", [-HOUR_S, HOUR_S])
def test_a_job_that_waits_or_runs_while_the_clock_is_set_keeps_its_limit(tmp_path, shift, by_s):
    gate = {"path": str(tmp_path / "gate")}

    async def scenario():
        async with running(tmp_path, kinds=HASTY, reserve=LocalExecutor(1)) as jobs:
            holder, _ = await jobs.submit("until_file", gate)
            waits, _ = await jobs.submit("hasty", {"n": 1}, time_limit_s=0.3)
            patient, _ = await jobs.submit("hasty", gate, time_limit_s=HOUR_S / 2)
            shift[0] = by_s
            # Answered when its time is up, and not an hour later; the other's time is not up.
            answered = await finished(jobs, waits)
            assert answered.result["echo"] == {"n": 1}
            await reports(jobs, holder)
            (tmp_path / "gate").touch()
            for job in (answered, await finished(jobs, holder), await finished(jobs, patient)):
                assert 0.0 <= (job.finished_at - job.created_at).total_seconds() < HOUR_S / 2
                assert job.created_at <= job.started_at <= job.finished_at
            assert "echo" not in (await jobs.get(patient.id)).result
            # Nothing waits or runs: the next one has the time as it was set.
            later, _ = await jobs.submit("echo", {})
            assert abs(later.created_at.timestamp() - time.time() - by_s) < HOUR_S / 2
            assert (await finished(jobs, later)).status is JobStatus.SUCCEEDED

    asyncio.run(scenario())


def test_a_job_of_a_time_that_is_still_to_come_does_not_end_before_it_began(tmp_path, shift):
    shift[0] = HOUR_S

    async def scenario():
        gate = {"path": str(tmp_path / "gate")}
        async with running(tmp_path) as jobs:
            job, _ = await jobs.submit("until_file", gate)
            await reports(jobs, job)
        shift[0] = 0.0
        (tmp_path / "gate").touch()
        async with running(tmp_path) as jobs:
            done = await finished(jobs, job)
        assert done.created_at <= done.started_at <= done.finished_at

    asyncio.run(scenario())
