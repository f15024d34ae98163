"""A database that an earlier version left behind, killed in the midst of its work, is gone on with.

`released/` has what such versions wrote, as SQL: a service of that version was given work and killed, and of
its library all policies but one were taken out to keep the file small.
"""

import sqlite3
from pathlib import Path

import pytest

from app.api.openapi_examples import example_problem

RELEASED = sorted((Path(__file__).parent / "released").glob("*.sql"))
KEY = "b5e511898713.uLlAWJA7SNsdFL69Qxh7_8hFlJZjhz5RKpHSIqtOvhM"
"""Of the role `library`, made with that version."""

ALLOCATED, TRAINED = "4019113ae68d4ce68b7732e5d8a46f19", "3e89b68c8d99469bb073d3e700ca7e45"
RUNNING, WAITING = "eec8b514134348ae8adf49ca040d0a97", "b7bc0d6f5dc1488588c6a9832962575d"


@pytest.mark.parametrize("file", RELEASED, ids=lambda file: file.stem)
def test_everything_is_there_and_what_was_begun_is_done(file, start_service, tmp_path):
    with sqlite3.connect(tmp_path / "allocator.sqlite3") as connection:
        connection.executescript(file.read_text())
        (policy_id,) = connection.execute("SELECT id FROM policies").fetchone()
    connection.close()

    client = start_service(workers=1, receive_timeout_s=60).await_ready().client

    assert client.get("/jobs").status_code == 401
    client.headers["Authorization"] = f"Bearer {KEY}"
    for job_id in (RUNNING, WAITING):
        with client.stream("GET", f"/jobs/{job_id}/events") as events:
            assert list(events.iter_lines())
    jobs = {job_id: client.get(f"/jobs/{job_id}").json() for job_id in (ALLOCATED, TRAINED, RUNNING, WAITING)}
    assert {job["status"] for job in jobs.values()} == {"succeeded"}
    assert jobs[TRAINED]["result"]["policy_id"] == policy_id
    assert client.get(f"/library/{policy_id}").json()["name"] == "kept"
    weights = client.get(f"/library/{policy_id}/checkpoint")
    assert (
        weights.headers["etag"].strip('"')
        == client.get(f"/library/{policy_id}").json()["checkpoint"]["sha256"]
    )
    problem = example_problem("paper-5x10")
    small = {**problem, "uavs": problem["uavs"][:2], "targets": problem["targets"][:3]}
    source = {"mode": "paper", "source": policy_id, "drqn_hidden_dim": 4, "qmix_hidden_dim": 2}
    request = {**small, "algorithm": "transfer_qmix", "parameters": {**source, "n_epochs": 3}}
    assert client.post("/allocate", json=request).json()["source_policy"]["id"] == policy_id
