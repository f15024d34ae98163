"""Event streams: nothing is left of those that were left, none is swallowed, and many stay cheap."""

import asyncio
from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime

import pytest
from harness import PATIENCE_S, eventually, finished, reports, running

from app.api.routes import jobs as routes
from app.jobs import events, service
from app.jobs.events import JobEvents, end_event
from app.jobs.model import Job, JobStatus, Progress

ENDED_AT = datetime(2026, 1, 1, tzinfo=UTC)
ENDED = Job(
    id="0" * 32,
    kind="solve",
    status=JobStatus.SUCCEEDED,
    lane="interactive",
    payload={},
    result={},
    error=None,
    progress=Progress(1.0),
    attempt=1,
    created_at=ENDED_AT,
    started_at=ENDED_AT,
    finished_at=ENDED_AT,
    has_artifact=False,
)


def count_reads(monkeypatch, jobs):
    """Count what is read of the job table by the name of the method."""
    reads = Counter()
    for name in ("get", "look"):
        read = getattr(jobs._store, name)

        def counted(job_id, name=name, read=read):
            reads[name] += 1
            return read(job_id)

        monkeypatch.setattr(jobs._store, name, counted)
    return reads


class Served:
    """What a route gets of the services."""

    def __init__(self, jobs):
        self.jobs = jobs


async def open_stream(jobs, job_id):
    """Open a stream as a browser does; return what closes it again."""
    response = await routes.get_job_events(job_id, Served(jobs), None)
    closed, begun = asyncio.Event(), asyncio.Event()

    async def receive():
        await closed.wait()
        return {"type": "http.disconnect"}

    async def send(message):
        begun.set()

    call = asyncio.create_task(
        response({"type": "http", "method": "GET", "path": "/", "headers": []}, receive, send)
    )
    await begun.wait()

    async def close():
        closed.set()
        await asyncio.wait_for(call, PATIENCE_S)

    return close


def test_streams_that_are_left_leave_no_task_and_no_reads(tmp_path, monkeypatch):
    async def scenario():
        async with running(tmp_path) as jobs:
            gate = {"path": str(tmp_path / "gate")}
            runs, _ = await jobs.submit("until_file", gate)
            waits, _ = await jobs.submit("until_file", gate)
            await reports(jobs, runs)
            # The first one starts a task that all share.
            await (await open_stream(jobs, waits.id))()
            before = asyncio.all_tasks()
            for job in (runs, waits):
                closers = [await open_stream(jobs, job.id) for _ in range(20)]
                for close in closers:
                    await close()
            await eventually(lambda: asyncio.all_tasks() <= before)
            reads = count_reads(monkeypatch, jobs)
            (tmp_path / "gate").touch()
            for job in (runs, waits):
                await finished(jobs, job)
            assert jobs._events.listeners == 0
            # The one who waited for it looked once before it ran.
            assert reads["look"] <= 2

    asyncio.run(scenario())


def test_on_sqlite_who_waits_and_who_listens_look_once_and_are_told_the_rest(tmp_path, monkeypatch):
    async def scenario():
        async with running(tmp_path) as jobs:
            patience = []

            async def noted(changed, timeout_s):
                patience.append(timeout_s)
                await changed.wait()

            gate = {"path": str(tmp_path / "gate")}
            await jobs.submit("until_file", gate)
            waits, _ = await jobs.submit("until_file", gate)
            monkeypatch.setattr(service, "wait_for", noted)
            monkeypatch.setattr(events, "wait_for", noted)
            reads = count_reads(monkeypatch, jobs)
            waiting = asyncio.create_task(jobs.wait(waits.id, None))

            async def listen():
                return [event.name async for event in jobs.events(waits.id)]

            listener = asyncio.create_task(listen())
            await eventually(lambda: len(patience) == 2)
            (tmp_path / "gate").touch()
            assert (await waiting).status is JobStatus.SUCCEEDED
            assert (await listener)[-1] == "end"
            assert set(patience) == {None}
            assert reads == {"look": 2}

    asyncio.run(scenario())


def test_a_stream_ends_when_its_listener_may_not_have_it_any_more(tmp_path, monkeypatch):
    monkeypatch.setattr(events, "_ASK_AGAIN_S", 0.01)

    async def scenario():
        async with running(tmp_path) as jobs:
            gate = {"path": str(tmp_path / "gate")}
            await jobs.submit("until_file", gate)
            waits, _ = await jobs.submit("until_file", gate)
            answers = [True, True]

            async def allowed():
                return bool(answers and answers.pop())

            # Nothing happens to the job meanwhile.
            assert [event async for event in jobs.events(waits.id, allowed=allowed)] == []
            assert answers == []
            assert (await jobs.get(waits.id)).status is JobStatus.QUEUED
            (tmp_path / "gate").touch()

    asyncio.run(scenario())


def test_an_id_ahead_of_all_swallows_nothing():
    channel = JobEvents()
    channel.report(Progress(0.1))
    first = next(channel.since(0)).id
    ahead = first + 600_000
    assert [event.data["fraction"] for event in channel.since(ahead)] == [0.1]
    assert list(channel.since(first)) == []
    channel.report(Progress(0.2))
    assert [event.data["fraction"] for event in channel.since(first)] == [0.2]
    channel.end(replace(ENDED, finished_at=datetime.now(UTC)))
    told = list(channel.since(ahead))
    assert [event.name for event in told] == ["progress", "progress", "end"]
    assert channel.has_told_all(told[-1].id)
    assert not channel.has_told_all(ahead)
    assert not channel.has_told_all(told[-2].id)


def test_only_who_has_seen_the_end_is_told_that_there_is_no_more(tmp_path):
    async def scenario():
        async with running(tmp_path) as jobs:
            job, _ = await jobs.submit("echo", {})
            ids = [event.id async for event in jobs.events(job.id)]
            done = await jobs.look(job.id)
            assert jobs.has_told_all(done, end_event(done).id)
            for other in (0, ids[-1] + 600_000, 10**17):
                assert not jobs.has_told_all(done, other)
                assert [event.name async for event in jobs.events(job.id, other)][-1] == "end"

    asyncio.run(scenario())


def test_of_many_listeners_each_gets_the_newest_only_and_it_is_written_once(tmp_path, monkeypatch):
    monkeypatch.setattr(events, "_SENT_A_SECOND", 1e-9)
    monkeypatch.setattr(events, "_LONGEST_BETWEEN_S", PATIENCE_S)

    async def scenario():
        async with running(tmp_path) as jobs:
            job, _ = await jobs.submit("epochs", {"folder": str(tmp_path), "epochs": 3})
            (tmp_path / "1").touch()
            await reports(jobs, job)

            async def listen():
                return [event async for event in jobs.events(job.id)]

            listeners = [asyncio.create_task(listen()) for _ in range(40)]
            await eventually(lambda: jobs._events.listeners == 40)
            for name in ("2", "3"):
                (tmp_path / name).touch()

                async def reached(name=name):
                    return (await jobs.look(job.id)).progress.epoch == int(name)

                await eventually(reached)
            (tmp_path / "end").touch()
            heard = await asyncio.gather(*listeners)
            # All were in their pause while the second and the third came; the end is told at once.
            assert [[event.data["epoch"] for event in each] for each in heard] == [[1, 3, 3]] * 40
            assert {each[-1].name for each in heard} == {"end"}
            assert len({id(event.text) for each in heard for event in each[-1:]}) == 1

    asyncio.run(scenario())


@pytest.mark.parametrize("over", [False, True])
def test_the_newest_is_a_progress_and_the_end(over):
    channel = JobEvents()
    for fraction in (0.1, 0.2):
        channel.report(Progress(fraction))
    if over:
        channel.end(ENDED)
    names = [event.name for event in channel.since(0, newest=True)]
    assert names == (["progress", "end"] if over else ["progress"])
