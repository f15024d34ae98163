"""Two services on one PostgreSQL database are one service to their clients."""

import subprocess
import sys
import time
from pathlib import Path

import pytest
from live_service import kill, workers_of
from metric_samples import samples
from postgresql_server import PostgresqlServer

ROOT = Path(__file__).parents[2]


def finished(client, job_id):
    """Follow a job by its event stream to its end, and return it."""
    with client.stream("GET", f"/jobs/{job_id}/events") as stream:
        for _ in stream.iter_lines():
            pass
    return client.get(f"/jobs/{job_id}").json()


@pytest.fixture(scope="module")
def server(postgresql):
    """A server that this module may stop."""
    del postgresql  # says where there is none
    own = PostgresqlServer()
    yield own
    own.close()


@pytest.fixture(scope="module")
def two(server, start_for_module):
    url = server.new_database()
    settings = {"workers": 1, "database_url": url, "max_checkpoint_bytes": 1_000_000}
    services = [start_for_module(**settings) for _ in range(2)]
    return [service.await_ready() for service in services]


def test_they_share_jobs_policies_and_keys(two, server, problem, tmp_path):
    one, other = (service.client for service in two)
    request = {**problem, "algorithm": "ga", "seed": 3, "time_limit_s": 0.3}
    headers = {"Idempotency-Key": "the same"}
    answer = one.post("/allocate", json=request, headers=headers)
    assert answer.status_code == 200, answer.text
    again = other.post("/allocate", json=request, headers=headers).json()
    assert again["job_id"] == answer.json()["job_id"]
    assert other.get(f"/jobs/{again['job_id']}").json()["result"]["reward"] == answer.json()["reward"]
    assert other.get("/jobs", params={"cursor": "9" * 18}).status_code == 200

    task = {name: problem[name] for name in ("uavs", "targets", "max_steps") if name in problem}
    parameters = {
        "n_epochs": 4,
        "evaluate_per_epoch": 2,
        "buffer_size": 2,
        "batch_size": 2,
        "learning_starts": 1,
    }
    training = {"algorithm": "qmix", "seed": 1, "parameters": {"mode": "paper", **parameters}}
    accepted = one.post("/library", json={"name": "mine", "task": task, "train": training})
    assert accepted.status_code == 202, accepted.text
    trained = finished(other, accepted.json()["id"])
    assert trained["status"] == "succeeded", trained
    assert one.get(f"/library/{trained['result']['policy_id']}").json()["name"] == "mine"


def test_a_server_that_is_away_is_said_and_come_through(two, server, problem):
    one, other = (service.client for service in two)
    slow = {**problem, "algorithm": "local_search", "seed": 3, "time_limit_s": 2.0}
    job = one.post("/allocate", json=slow, headers={"Prefer": "respond-async"}).json()
    server.stop()
    assert other.get("/readyz").status_code == 503
    away = other.post("/allocate", json=slow)
    assert (away.status_code, away.json()["type"]) == (503, "/docs/errors#store-unavailable")
    assert away.headers["Retry-After"] == "1"
    assert away.headers["X-Request-ID"], "it is answered as other requests are"
    server.start()
    ended = finished(one, job["id"])
    assert ended["status"] == "succeeded"
    assert other.get(f"/jobs/{job['id']}").json()["result"] == ended["result"]


def test_the_command_line_works_on_the_same_database(server, tmp_path):
    url = server.new_database()

    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "app", *arguments],
            cwd=ROOT,
            env={"ALLOCATOR_DATABASE_URL": url, "PATH": "/usr/bin:/bin"},
            capture_output=True,
            text=True,
            check=False,
        )

    made = run("keys", "create", "--role", "allocate", "--name", "me")
    assert made.returncode == 0, made.stderr
    assert made.stdout.split(".")[0] in run("keys", "list").stdout
    refused = run("backup", str(tmp_path / "copy"))
    assert refused.returncode == 1
    assert "pg_dump" in refused.stderr


def test_replaced_workers_are_counted(two):
    """Here, where a service ends soon: the new workers are hardly begun."""
    service = two[1]
    restarts = ("allocator_worker_restarts_total",)
    assert samples(service.client)[restarts] == 0

    # Its worker, and the process that answers beside it.
    processes = workers_of(service.process.pid)
    assert len(processes) == 2
    for process in processes:
        kill(process)
    while samples(service.client)[restarts] < 2:
        assert service.process.poll() is None
        time.sleep(0.01)
    assert samples(service.client)[restarts] == 2
