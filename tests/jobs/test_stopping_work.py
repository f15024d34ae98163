"""Cancelling, time limits, progress and its stream."""

import asyncio
import time

from harness import PATIENCE_S, eventually, finished, reports, running

from app.jobs.model import JobEvent, JobKind, JobStatus


def test_a_cancelled_job_keeps_the_best_it_found(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            job, _ = await service.submit("until_stopped", {})
            await reports(service, job)
            asked = await service.cancel(job.id)
            assert asked.status is JobStatus.RUNNING
            done = await finished(service, job)
            assert done.status is JobStatus.CANCELLED
            best = done.result["best"]
            assert best > 0
            assert done.result["cancelled"]
            # The last report of the work, although it came right before its end.
            assert (done.progress.epoch, done.progress.assignment) == (best, [[0, best]])
            assert await service.cancel(job.id) == done
            # The flag was that job's, not the worker's.
            assert (await finished(service, (await service.submit("echo", {}))[0])).result

    asyncio.run(scenario())


def test_a_waiting_job_is_cancelled_at_once_and_never_runs(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        async with running(tmp_path) as service:
            first, _ = await service.submit("until_file", {"path": str(gate)})
            waiting, _ = await service.submit("gated", {"path": str(gate)})
            last, _ = await service.submit("echo", {})
            waiter = asyncio.create_task(finished(service, waiting))
            assert (await service.cancel(waiting.id)).status is JobStatus.CANCELLED
            assert (await waiter).status is JobStatus.CANCELLED
            gate.touch()
            await finished(service, first)
            await finished(service, last)
            never = await service.get(waiting.id)
            assert (never.attempt, never.started_at, never.result) == (0, None, None)

    asyncio.run(scenario())


def test_work_that_ignores_its_cancellation_is_killed_and_its_progress_stays(tmp_path):
    async def scenario():
        async with running(tmp_path, overrun_grace_s=0.1) as service:
            job, _ = await service.submit("deaf", {})
            await reports(service, job)
            await service.cancel(job.id)
            done = await finished(service, job)
            assert (done.status, done.attempt, done.result) == (JobStatus.CANCELLED, 1, None)
            assert (done.progress.best_reward, done.progress.assignment) == (7.0, [[1, 0]])
            assert (await finished(service, (await service.submit("echo", {}))[0])).result

    asyncio.run(scenario())


def test_work_that_takes_longer_than_its_kind_may_ends_with_the_best_it_has(tmp_path):
    kinds = (
        JobKind("until_stopped", "job_work:until_stopped", "interactive", max_run_s=0.3),
        # Answered when its own time is up, but that is not.
        JobKind("deaf", "job_work:deaf", "interactive", at_once="job_work:echo", max_run_s=0.3),
    )

    async def scenario():
        async with running(tmp_path, kinds=kinds, overrun_grace_s=1.0) as service:
            for limit_s in (None, 3600.0):
                job, _ = await service.submit("until_stopped", {}, time_limit_s=limit_s)
                done = await finished(service, job)
                assert (done.status, done.attempt) == (JobStatus.SUCCEEDED, 1)
                # The search does not know of it: it does what it does without a limit.
                assert (done.result["time_left"] is None) == (limit_s is None)
            stubborn, _ = await service.submit("deaf", {}, time_limit_s=3600.0)
            done = await finished(service, stubborn)
            assert (done.status, done.attempt) == (JobStatus.FAILED, 1)
            assert done.error["code"] == "time-limit-exceeded"

    asyncio.run(scenario())


def test_work_stops_by_itself_when_its_time_is_up(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            job, _ = await service.submit("until_stopped", {}, time_limit_s=0.3)
            done = await finished(service, job)
            assert done.status is JobStatus.SUCCEEDED
            assert done.result["best"] > 0
            # It looked up once more after its time, long before it would have been ended.
            assert -5.0 < done.result["time_left"] <= 0
            unlimited, _ = await service.submit("until_stopped", {})
            await reports(service, unlimited)
            await service.cancel(unlimited.id)
            assert (await finished(service, unlimited)).result["time_left"] is None

    asyncio.run(scenario())


def test_waiting_counts_towards_the_time_limit(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        async with running(tmp_path) as service:
            await service.submit("until_file", {"path": str(gate)})
            job, _ = await service.submit("until_stopped", {}, time_limit_s=0.05)
            over = time.monotonic() + 0.1
            await eventually(lambda: time.monotonic() > over)
            gate.touch()
            done = await finished(service, job)
            assert done.status is JobStatus.SUCCEEDED
            assert done.result["best"] == 0
            assert done.result["time_left"] <= -0.05

    asyncio.run(scenario())


def test_work_that_ignores_its_time_limit_is_killed_and_has_failed(tmp_path):
    async def scenario():
        async with running(tmp_path, overrun_grace_s=0.5) as service:
            job, _ = await service.submit("deaf", {}, time_limit_s=0.2)
            done = await finished(service, job)
            assert (done.status, done.attempt) == (JobStatus.FAILED, 1)
            assert done.error["code"] == "time-limit-exceeded"
            assert done.progress.assignment == [[1, 0]]
            assert (await finished(service, (await service.submit("echo", {}))[0])).result

    asyncio.run(scenario())


def test_progress_is_throttled_clean_and_the_last_is_delivered(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            job, _ = await service.submit("chatter", {"seconds": 0.6})
            events = [event async for event in service.events(job.id)]
            done = await service.get(job.id)
            told = [event.data for event in events if event.name == "progress"]
            assert 2 <= len(told) <= 20 * done.result["seconds"] + 3
            assert done.result["reports"] > 10 * len(told)
            assert told[-1]["epoch"] == done.result["reports"] == done.progress.epoch
            assert all(each["fraction"] <= 1.0 and each["best_reward"] is None for each in told)

    asyncio.run(scenario())


def test_events_come_in_order_live_and_replayed(tmp_path):
    async def scenario():
        async with running(tmp_path) as service:
            job, _ = await service.submit("epochs", {"folder": str(tmp_path), "epochs": 3})
            live = service.events(job.id)
            seen = []
            for epoch in (1, 2, 3):
                (tmp_path / str(epoch)).touch()
                async with asyncio.timeout(PATIENCE_S):
                    seen.append(await anext(live))
                assert seen[-1].data["epoch"] == epoch
                assert (await service.get(job.id)).progress.epoch == epoch
            late = service.events(job.id, after=seen[0].id)
            assert [await anext(late), await anext(late)] == seen[1:]
            (tmp_path / "end").touch()
            end = await anext(live)
            assert (end.name, end.data["status"], end.data["epoch"]) == ("end", "succeeded", 3)
            assert [event async for event in live] == []
            # As long as somebody listens, all that is remembered is told to those who come later.
            seen.append(end)
            assert [event async for event in service.events(job.id)] == seen
            assert [event async for event in late] == [end]
            assert [event.id for event in seen] == sorted({event.id for event in seen})
            assert [event async for event in service.events(job.id, after=end.id)] == []
        async with running(tmp_path) as service:
            replayed = [event async for event in service.events(job.id)]
            assert [event.name for event in replayed] == ["progress", "end"]
            assert replayed[1].data == end.data
            assert [event async for event in service.events(job.id, after=seen[2].id)][-1] == replayed[1]
            assert [event async for event in service.events(job.id, after=end.id)] == []

    asyncio.run(scenario())


def test_a_listener_of_a_waiting_job_hears_of_its_cancellation(tmp_path):
    async def scenario():
        gate = tmp_path / "gate"
        async with running(tmp_path) as service:
            await service.submit("until_file", {"path": str(gate)})
            waiting, _ = await service.submit("echo", {})

            async def listen() -> list[JobEvent]:
                return [event async for event in service.events(waiting.id)]

            listener = asyncio.create_task(listen())
            await service.cancel(waiting.id)
            event = (await asyncio.wait_for(listener, PATIENCE_S))[-1]
            assert (event.name, event.data["status"]) == ("end", "cancelled")
            gate.touch()

    asyncio.run(scenario())
