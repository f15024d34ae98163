"""Jobs whose time limit ends while all workers are busy: answered beside them, once, whatever dies."""

import asyncio
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from harness import KINDS, eventually, finished, running

from app.jobs.local import LocalExecutor
from app.jobs.model import BEST_KNOWN, JobKind, JobStatus
from app.jobs.reserve import Pace, Wait, due, latest_start

HASTY = (
    *KINDS,
    JobKind("hasty", "job_work:until_file", "interactive", at_once="job_work:echo"),
    JobKind("held", "job_work:held", "interactive", at_once="job_work:echo"),
    JobKind("stubborn", "job_work:deaf", "interactive", at_once="job_work:echo"),
    JobKind("fragile", "job_work:until_file", "interactive", at_once="job_work:die"),
)


# Long enough for an answer at once on a machine that is busy with other tests.
GRACE_S = 0.5


def paced(seconds, effort=1.0, times=5):
    pace = Pace()
    for _ in range(times):
        pace.took(effort, seconds)
    return pace


def test_the_last_of_those_that_end_together_is_in_time_too():
    # Each is expected to take half as long again, and the way there and back is taken once.
    pace = paced(0.2)
    assert latest_start([Wait(100.0)], pace) == pytest.approx(100.0 - 0.3 - 0.03)
    assert latest_start([Wait(100.0)] * 3, pace) == pytest.approx(100.0 - 3 * 0.3 - 0.03)
    assert latest_start([Wait(110.0), Wait(100.0)], pace) == pytest.approx(100.0 - 0.3 - 0.03)
    assert latest_start([Wait(100.2), Wait(100.0)], pace) == pytest.approx(100.2 - 2 * 0.3 - 0.03)
    assert latest_start([Wait(100.0)], Pace()) < 100.0


def test_one_slow_answer_does_not_make_the_next_ones_early_and_many_do():
    pace = paced(0.01)
    before = pace.expected(1.0)
    pace.took(1.0, 5.0)
    assert pace.expected(1.0) == before
    for _ in range(10):
        pace.took(1.0, 5.0)
    assert pace.expected(1.0) == 5.0


def test_a_large_one_takes_longer_than_a_small_one_and_says_nothing_of_it():
    pace = paced(0.01)
    assert pace.expected(20.0) == pytest.approx(0.2)
    pace.took(20.0, 1.0)
    assert pace.expected(20.0) == pytest.approx(1.0)
    assert pace.expected(1.0) == pytest.approx(0.01)
    assert pace.expected(500.0) > 1.0


def test_those_whose_turn_comes_meanwhile_are_answered_together_and_no_others():
    pace = paced(0.01)
    together = {f"job-{n}": Wait(100.0 + n / 1000) for n in range(40)}
    now = latest_start(together.values(), pace)
    first = due(together, pace, now)
    assert 1 < len(first) <= 16
    assert first == list(together)[: len(first)]
    # One that has time may still get a worker.
    apart = {"later": Wait(200.0), "now": Wait(100.0)}
    assert due(apart, pace, 100.0) == ["now"]
    # Large ones are taken one by one.
    assert len(due({"a": Wait(100.0, 64.0), "b": Wait(100.0, 64.0)}, pace, 99.0)) == 1


@asynccontextmanager
async def busy(tmp_path, **settings):
    """Run a service whose worker and reserve are both warm: a cold reserve leaves what is due to workers."""
    reserve = LocalExecutor(1)
    async with running(tmp_path, kinds=HASTY, reserve=reserve, **settings) as service:
        await eventually(lambda: reserve.ready == 1)
        yield service


def gate(tmp_path) -> dict[str, str]:
    return {"path": str(tmp_path / "gate")}


def test_a_waiting_job_is_answered_when_its_time_is_up(tmp_path):
    async def scenario():
        async with busy(tmp_path) as service:
            holder, _ = await service.submit("until_file", gate(tmp_path))
            jobs = [(await service.submit("hasty", {"n": n}, time_limit_s=0.2))[0] for n in range(5)]
            patient, _ = await service.submit("echo", {}, time_limit_s=0.2)
            for job in jobs:
                done = await finished(service, job)
                assert (done.status, done.attempt) == (JobStatus.SUCCEEDED, 1)
                assert done.result["echo"] == job.payload
            # The worker was busy all the while, and a kind with nothing to answer at once waits for it.
            assert (await service.get(holder.id)).status is JobStatus.RUNNING
            assert (await service.get(patient.id)).status is JobStatus.QUEUED
            assert service.waiting()["interactive"] == 1
            Path(gate(tmp_path)["path"]).touch()
            assert (await finished(service, patient)).result
            assert sum(service.load().running.values()) == 0

    asyncio.run(scenario())


def test_a_job_that_gets_a_worker_in_time_is_done_by_it(tmp_path):
    async def scenario():
        async with busy(tmp_path) as service:
            holder, _ = await service.submit("until_file", gate(tmp_path))
            job, _ = await service.submit("hasty", gate(tmp_path), time_limit_s=3600.0)
            Path(gate(tmp_path)["path"]).touch()
            done = await finished(service, job)
            assert "echo" not in done.result
            assert done.result["pid"] == (await finished(service, holder)).result["pid"]

    asyncio.run(scenario())


def test_one_that_is_cancelled_first_is_not_answered(tmp_path):
    async def scenario():
        async with busy(tmp_path) as service:
            await service.submit("until_file", gate(tmp_path))
            job, _ = await service.submit("hasty", {}, time_limit_s=3600.0)
            await service.cancel(job.id)
            after, _ = await service.submit("hasty", {}, time_limit_s=0.0)
            await finished(service, after)
            done = await service.get(job.id)
            assert (done.status, done.attempt) == (JobStatus.CANCELLED, 0)
            Path(gate(tmp_path)["path"]).touch()

    asyncio.run(scenario())


def test_one_whose_process_dies_is_tried_again_and_fails_after_three(tmp_path):
    async def scenario():
        async with busy(tmp_path) as service:
            holder, _ = await service.submit("until_file", gate(tmp_path))
            twice = {"log": str(tmp_path / "twice"), "deaths": 2}
            often = {"log": str(tmp_path / "often"), "deaths": 99}
            job, _ = await service.submit("fragile", twice, time_limit_s=0.0)
            done = await finished(service, job)
            assert (done.status, done.attempt, done.result) == (JobStatus.SUCCEEDED, 3, {"deaths": 2})
            killer, _ = await service.submit("fragile", often, time_limit_s=0.0)
            failed = await finished(service, killer)
            assert (failed.status, failed.error["code"]) == (JobStatus.FAILED, "worker-lost")
            after, _ = await service.submit("hasty", {}, time_limit_s=0.0)
            assert (await finished(service, after)).status is JobStatus.SUCCEEDED
            assert (await service.get(holder.id)).attempt == 1
            assert service.load().restarts == 5
            Path(gate(tmp_path)["path"]).touch()

    asyncio.run(scenario())


def test_work_that_does_not_end_with_its_time_is_ended_and_the_job_answered(tmp_path):
    async def scenario():
        async with busy(tmp_path, overrun_grace_s=GRACE_S) as service:
            job, _ = await service.submit("stubborn", {}, time_limit_s=0.2)
            done = await finished(service, job)
            assert (done.status, done.attempt) == (JobStatus.SUCCEEDED, 2)
            # What answers it gets the best plan that was reported, and by whom.
            known = done.result["echo"][BEST_KNOWN]
            assert (known["best_reward"], known["assignment"]) == (7.0, [[1, 0]])
            assert known["answered_by"] == "deaf"

    asyncio.run(scenario())


def test_work_that_is_held_by_what_ends_by_itself_is_given_the_time(tmp_path):
    async def scenario():
        async with busy(tmp_path, overrun_grace_s=GRACE_S) as service:
            job, _ = await service.submit("held", {"seconds": 1.0}, time_limit_s=0.1)
            done = await finished(service, job)
            assert (done.status, done.attempt) == (JobStatus.SUCCEEDED, 1)
            assert service.load().restarts == 0
            # Held no more, it is ended as any other.
            job, _ = await service.submit("held", {"seconds": 0.8, "then_deaf": True}, time_limit_s=0.1)
            assert (await finished(service, job)).attempt == 2
            await eventually(lambda: service.load().restarts == 1)

    asyncio.run(scenario())


def test_those_behind_one_whose_process_dies_wait_for_whatever_is_free_first(tmp_path):
    warm, free = tmp_path / "warm", Path(gate(tmp_path)["path"])
    reserve = LocalExecutor(1, warm_up="job_work:until_gate", environment={"GATE": str(warm)})

    async def scenario():
        warm.touch()
        async with running(tmp_path, kinds=HASTY, reserve=reserve, overrun_grace_s=GRACE_S) as service:
            await eventually(lambda: reserve.ready == 1)
            await service.submit("until_file", gate(tmp_path))
            # The process that replaces the first one does not become warm before the end.
            warm.unlink()
            deadly = {"log": str(tmp_path / "log"), "deaths": 1, **gate(tmp_path)}
            jobs = [(await service.submit("fragile", deadly, time_limit_s=0.3))[0]]
            jobs += [(await service.submit("hasty", gate(tmp_path), time_limit_s=0.3))[0] for _ in range(5)]
            await eventually(lambda: reserve.restarts == 1)
            free.touch()
            for job in jobs:
                done = await finished(service, job)
                assert (done.status, done.error) == (JobStatus.SUCCEEDED, None)
            warm.touch()

    asyncio.run(scenario())


def test_one_that_an_earlier_process_took_in_is_answered_too(tmp_path):
    async def scenario():
        # Without a reserve it waits, and is still there at the next start.
        async with running(tmp_path, kinds=HASTY) as service:
            holder, _ = await service.submit("until_file", gate(tmp_path))
            job, _ = await service.submit("hasty", {}, time_limit_s=0.0)
            await eventually(lambda: service.waiting()["interactive"] == 1)
        async with busy(tmp_path) as service:
            done = await finished(service, job)
            assert done.result == {"echo": {}, "pid": done.result["pid"]}
            assert not (await service.get(holder.id)).status.finished
            Path(gate(tmp_path)["path"]).touch()

    asyncio.run(scenario())


def test_what_waits_is_not_taken_before_something_can_answer_it(tmp_path):
    async def scenario():
        cold = LocalExecutor(1, warm_up="job_work:until_gate", environment={"GATE": gate(tmp_path)["path"]})
        async with running(tmp_path, kinds=HASTY, reserve=cold) as service:
            holder, _ = await service.submit("until_file", gate(tmp_path))
            job, _ = await service.submit("hasty", gate(tmp_path), time_limit_s=0.0)
            other, _ = await service.submit("hasty", {}, time_limit_s=0.0)
            await service.cancel(other.id)
            assert (await service.get(job.id)).status is JobStatus.QUEUED
            assert (await service.get(other.id)).attempt == 0
            Path(gate(tmp_path)["path"]).touch()
            assert (await finished(service, job)).result
            assert (await finished(service, holder)).result

    asyncio.run(scenario())
