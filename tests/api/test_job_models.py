"""Jobs on the wire: a result goes out as it is stored, between what is known of its job."""

import json
from datetime import UTC, datetime, timedelta

import pytest

from app.api.job_models import job_response
from app.jobs.model import JobStatus, JobSummary, Progress

BEGUN = datetime(2026, 1, 1, tzinfo=UTC)


def ended(after_s=1.5):
    return JobSummary(
        id="a" * 32,
        kind="allocate",
        status=JobStatus.SUCCEEDED,
        lane="interactive",
        error=None,
        progress=Progress(1.0, best_reward=2.5, assignment=[[0, 1]]),
        attempt=1,
        created_at=BEGUN,
        started_at=BEGUN,
        finished_at=BEGUN + timedelta(seconds=after_s),
        has_artifact=False,
    )


@pytest.mark.parametrize(
    "stored",
    ["{}", " { } ", '{"reward":1.0,"name":"\\ud800 }, {"}', '{"a": {"b": []}, "n": 1e-7}'],
)
def test_a_result_is_whole_whatever_is_in_it(stored):
    response = job_response(ended(), stored)

    answer = json.loads(response.body)
    assert answer["result"] == {"job_id": "a" * 32, **json.loads(stored), "elapsed_s": 1.5}
    assert stored.strip()[1:-1].strip() in response.body.decode()
    assert (answer["status"], answer["progress"]["assignment"]) == ("succeeded", [[0, 1]])
    assert answer["created_at"] == "2026-01-01T00:00:00Z"


def test_without_a_result_there_is_none():
    assert json.loads(job_response(ended(), None).body)["result"] is None
