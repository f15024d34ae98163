"""What a service knows of the jobs that wait, where others take them in and out too."""

import asyncio
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from app.jobs.lanes import Lanes
from app.jobs.model import Job, JobKind, JobStatus, Progress
from app.jobs.overdue import OverdueJobs
from app.jobs.peers import NoPeers
from app.jobs.waiting import Waiting

HASTY = JobKind("hasty", "job_work:echo", "interactive", at_once="job_work:echo")
PATIENT = JobKind("patient", "job_work:echo", "interactive")


class Others(NoPeers):
    """Other services that may have taken in jobs, of which nobody has told."""

    others_may_wait = True


@pytest.fixture
def lanes():
    return Lanes(capacity=2)


@pytest.fixture
def job():
    return Job(
        id="0" * 32,
        kind="hasty",
        status=JobStatus.QUEUED,
        lane="interactive",
        payload={},
        result=None,
        error=None,
        progress=Progress(),
        attempt=0,
        created_at=datetime(2026, 1, 1, tzinfo=UTC),
        started_at=None,
        finished_at=None,
        has_artifact=False,
    )


@pytest.fixture
def waiting(lanes):
    return Waiting(lanes, {}, None, Others("me"), asyncio.Event())


def test_a_lane_of_which_something_is_heard_while_it_is_looked_at_is_looked_at_again(lanes, waiting):
    waiting.heard("interactive")
    waiting.looks("interactive")
    waiting.found_none("interactive")
    assert lanes.waiting["interactive"] == 0
    waiting.looks("interactive")
    waiting.heard("interactive")
    waiting.found_none("interactive")
    assert lanes.waiting["interactive"] == 1


def test_nothing_waits_only_once_nothing_was_found(lanes, waiting, job):
    waiting.count_anew({"interactive": 1})
    waiting.less(job)
    assert lanes.waiting["interactive"] == 1
    waiting.looks("interactive")
    waiting.found_none("interactive")
    assert lanes.waiting["interactive"] == 0


def test_what_others_have_answered_is_not_answered_here(lanes, job):
    answered = []

    async def answer(job_ids):
        answered.extend(job_ids)
        if "last" in job_ids:
            overdue.end()
        return dict.fromkeys(job_ids, 0.0)

    async def scenario():
        kinds = {kind.name: kind for kind in (HASTY, PATIENT)}
        waiting = Waiting(lanes, kinds, overdue, Others("me"), asyncio.Event())
        for job_id in ("ended here", "of before"):
            waiting.more(replace(job, id=job_id, kind="hasty"), 0.0)
        waiting.watch_anew(
            [("patient", "patient", 0.0), ("unknown", "unknown", 0.0)]
            + [(job_id, "hasty", at) for at, job_id in enumerate(["ended elsewhere", "first", "last"])]
        )
        waiting.forget("ended elsewhere")
        await overdue.keep()

    overdue = OverdueJobs(answer)
    asyncio.run(scenario())
    assert answered == ["first", "last"]
