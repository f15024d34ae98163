"""Two lives of a service on one database: it is stopped with no time, and with some.

The first begins with what an earlier version left behind, killed in the midst of its work. `released/` has
what such versions wrote, as SQL: a service of that version was given work and killed, and of its library all
policies but one were taken out to keep the file small. How this version is killed is in `test_crash.py`.
"""

import json
import signal
import socket
import sqlite3
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import httpx
import pytest
from answers import but_for_reasons

from app.api.openapi_examples import example_problem

RELEASED = sorted((Path(__file__).parent / "released").glob("*.sql"))
KEY = "b5e511898713.uLlAWJA7SNsdFL69Qxh7_8hFlJZjhz5RKpHSIqtOvhM"
"""Of the role `library`, made with that version."""

ALLOCATED, TRAINED = "4019113ae68d4ce68b7732e5d8a46f19", "3e89b68c8d99469bb073d3e700ca7e45"
RUNNING, WAITING = "eec8b514134348ae8adf49ca040d0a97", "b7bc0d6f5dc1488588c6a9832962575d"
BEARER = {"Authorization": f"Bearer {KEY}"}
ASYNC = {"Prefer": "respond-async"}
# A clean end is followed by the signal that asked for it, as a shell expects.
ENDED = (0, -signal.SIGTERM)
LONG = {"algorithm": "qmix", "parameters": {"n_epochs": 10_000_000}}
QUICK = {"algorithm": "qmix", "parameters": {"n_epochs": 4, "batch_size": 2}, "keep_checkpoint": True}
SLOW = {"algorithm": "local_search", "time_limit_s": 0.5}
PROBLEM = example_problem("paper-5x10")
BATCH = {"problems": [{**PROBLEM, **SLOW, "seed": seed} for seed in range(6)]}
BATCH_KEY = {"Idempotency-Key": "over a stop"}
QUICK_KEY = {"Idempotency-Key": "before a stop"}


def later(client, body):
    """Submit an allocation and return the id of its job."""
    return client.post("/allocate", json=body, headers=ASYNC).json()["id"]


def lines_of(response):
    return [json.loads(line) for line in response.iter_lines()]


def state_after(client, job_id):
    """Follow a job to its end, and return how it ended."""
    with client.stream("GET", f"/jobs/{job_id}/events") as stream:
        for _ in stream.iter_lines():
            pass
    return client.get(f"/jobs/{job_id}").json()["status"]


@pytest.fixture(scope="module", params=RELEASED, ids=lambda file: file.stem)
def data_folder(request, tmp_path_factory):
    """A folder with the database of an earlier version."""
    folder = tmp_path_factory.mktemp("data")
    with sqlite3.connect(folder / "allocator.sqlite3") as connection:
        connection.executescript(request.param.read_text())
    connection.close()
    return folder


@pytest.fixture(scope="module")
def start(start_for_module):
    """Starts services with the client of one who has the key."""

    def started(**settings):
        service = start_for_module(workers=1, **settings)
        service.client.headers.update(BEARER)
        return service

    return started


def gone_on_with(client):
    """What the earlier version left, when what it had begun has ended, and a transfer from its policy."""
    for job_id in (RUNNING, WAITING):
        state_after(client, job_id)
    jobs = {job_id: client.get(f"/jobs/{job_id}").json() for job_id in (ALLOCATED, TRAINED, RUNNING, WAITING)}
    source = jobs[TRAINED]["result"]["policy_id"]
    small = {**PROBLEM, "uavs": PROBLEM["uavs"][:2], "targets": PROBLEM["targets"][:3]}
    sizes = {"drqn_hidden_dim": 4, "qmix_hidden_dim": 2}
    parameters = {"mode": "paper", "source": source, **sizes, "n_epochs": 3}
    request = {**small, "algorithm": "transfer_qmix", "parameters": parameters}
    return SimpleNamespace(
        jobs=jobs,
        source=source,
        policy=client.get(f"/library/{source}").json(),
        weights=client.get(f"/library/{source}/checkpoint"),
        transferred=client.post("/allocate", json=request).json(),
    )


@pytest.fixture(scope="module")
def stopped(start):
    """The first life, which is stopped with streams open, a batch half done, and jobs that run and wait."""
    # Places for what the earlier version had in its queue, too.
    service = start(max_checkpoint_bytes=10**6, queue_limit=4)
    client = service.client
    cold = client.get("/readyz")
    without_key = httpx.get(f"{client.base_url}/jobs")
    at_once = client.post("/allocate", json={**PROBLEM, "algorithm": "greedy"})
    service.await_ready()
    earlier = gone_on_with(client)
    answer = client.post("/allocate", json={**PROBLEM, **QUICK}, headers=QUICK_KEY).json()
    policy = client.post("/library", json={"name": "new", "job_id": answer["job_id"]}).json()
    job = client.get(f"/jobs/{answer['job_id']}").json()

    with client.stream("POST", "/allocate/batch", json=BATCH, headers=BATCH_KEY) as batch:
        received = batch.iter_lines()
        first = json.loads(next(received))
        long = later(client, {**PROBLEM, **LONG})
        waiting = later(client, {**PROBLEM, "algorithm": "greedy"})
        with client.stream("GET", f"/jobs/{long}/events") as events:
            told = events.iter_lines()
            next(told)
            service.process.send_signal(signal.SIGTERM)
            for _ in told:
                pass
        try:
            rest = [json.loads(line) for line in received]
        except httpx.TransportError:
            rest = []  # the server's grace was over before the stream had ended
    ended = service.process.wait(30)
    return SimpleNamespace(
        cold=cold, without_key=without_key, at_once=at_once, earlier=earlier, answer=answer, policy=policy,
        job=job, first=first, rest=rest, long=long, waiting=waiting, ended=ended,
    )  # fmt: skip


@pytest.fixture(scope="module")
def last(stopped, start):
    """The second life, which has some seconds for its end; how ended what ran and waited."""
    service = start(shutdown_grace_s=6.0).await_ready()
    service.client.delete(f"/jobs/{stopped.long}")
    service.states = [state_after(service.client, job_id) for job_id in (stopped.long, stopped.waiting)]
    return service


def test_everything_of_an_earlier_version_is_there_and_what_was_begun_is_done(stopped):
    earlier = stopped.earlier
    assert stopped.without_key.status_code == 401
    assert {job["status"] for job in earlier.jobs.values()} == {"succeeded"}
    assert earlier.policy["name"] == "kept"
    assert earlier.weights.headers["etag"].strip('"') == earlier.policy["checkpoint"]["sha256"]
    assert earlier.transferred["source_policy"]["id"] == earlier.source


def test_it_takes_jobs_before_it_is_ready(stopped):
    assert stopped.cold.status_code in (200, 503)
    if stopped.cold.status_code == 503:
        assert stopped.cold.json()["type"] == "/docs/errors#not-ready"
        assert stopped.cold.headers["retry-after"] == "1"
    assert stopped.at_once.status_code == 200


def test_a_clean_stop_ends_open_streams_and_says_what_it_leaves(stopped):
    assert stopped.ended in ENDED
    for line in stopped.rest:
        assert "allocation" in line or line["problem"]["type"] == "/docs/errors#draining"


def test_the_next_has_jobs_and_library_and_goes_on_with_what_ran(stopped, last):
    client = last.client
    assert client.get(f"/jobs/{stopped.job['id']}").json() == stopped.job
    assert client.get(f"/library/{stopped.policy['id']}").json() == stopped.policy
    again = client.post("/allocate", json={**PROBLEM, **QUICK}, headers=QUICK_KEY).json()
    assert again == stopped.answer
    assert last.states == ["cancelled", "succeeded"]


def test_a_batch_that_was_left_is_gone_on_with(stopped, last):
    with last.client.stream("POST", "/allocate/batch", json=BATCH, headers=BATCH_KEY) as response:
        lines = {line["index"]: line for line in lines_of(response)}
    assert sorted(lines) == list(range(len(BATCH["problems"])))
    assert all("allocation" in line for line in lines.values())
    kept = lines[stopped.first["index"]]
    assert but_for_reasons(kept["allocation"]) == but_for_reasons(stopped.first["allocation"])


def test_a_stop_answers_all_who_wait_as_problems_and_is_over_within_its_grace(last):
    url = last.client.base_url
    answers = {}

    def ask(name, body):
        with httpx.Client(base_url=url, timeout=60, headers=BEARER) as client:
            answers[name] = client.post("/allocate", json=body)

    def ask_for_many():
        body = {"problems": [{**PROBLEM, **LONG}]}
        with (
            httpx.Client(base_url=url, timeout=60, headers=BEARER) as client,
            client.stream("POST", "/allocate/batch", json=body) as stream,
        ):
            answers["batch"] = lines_of(stream)

    def unfinished_jobs():
        states = ("queued", "running")
        found = [last.client.get("/jobs", params={"status": each}).json()["jobs"] for each in states]
        return sum(map(len, found))

    callers = [threading.Thread(target=ask, args=(name, {**PROBLEM, **LONG})) for name in ("runs", "waits")]
    callers.append(threading.Thread(target=ask_for_many))
    for caller in callers:
        caller.start()
    while unfinished_jobs() < 3:
        time.sleep(0.01)
    unfinished = socket.create_connection((url.host, url.port))
    head = f"POST /allocate HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {KEY}\r\n"
    unfinished.sendall(f"{head}Content-Length: 10\r\n\r\n{{".encode())
    last.client.get("/healthz")  # what was sent before has arrived

    last.process.send_signal(signal.SIGTERM)
    refused = b""
    while chunk := unfinished.recv(65536):
        refused += chunk
    unfinished.close()
    for caller in callers:
        caller.join(60)
    assert last.process.wait(60) in ENDED

    for name in ("runs", "waits"):
        assert (answers[name].status_code, answers[name].json()["type"]) == (503, "/docs/errors#draining")
        assert int(answers[name].headers["retry-after"]) > 0
    assert [line["problem"]["type"] for line in answers["batch"]] == ["/docs/errors#draining"]
    assert refused.startswith(b"HTTP/1.1 503 ")
    assert b'"type":"/docs/errors#draining"' in refused
