"""Three lives of a service on one database: it is killed, stopped with no time, and stopped with some."""

import json
import signal
import socket
import threading
import time
from types import SimpleNamespace

import httpx
import pytest
from answers import but_for_reasons

from app.api.openapi_examples import example_problem

ASYNC = {"Prefer": "respond-async"}
# A clean end is followed by the signal that asked for it, as a shell expects.
ENDED = (0, -signal.SIGTERM)
LONG = {"algorithm": "qmix", "parameters": {"n_epochs": 10_000_000}}
QUICK = {"algorithm": "qmix", "parameters": {"n_epochs": 4, "batch_size": 2}, "keep_checkpoint": True}
SLOW = {"algorithm": "local_search", "time_limit_s": 0.5}
PROBLEM = example_problem("paper-5x10")
BATCH = {"problems": [{**PROBLEM, **SLOW, "seed": seed} for seed in range(6)]}
BATCH_KEY = {"Idempotency-Key": "over a stop"}
QUICK_KEY = {"Idempotency-Key": "over a kill"}


def later(client, body):
    """Submit an allocation and return the id of its job."""
    return client.post("/allocate", json=body, headers=ASYNC).json()["id"]


def lines_of(response):
    return [json.loads(line) for line in response.iter_lines()]


@pytest.fixture(scope="module")
def killed(start_for_module):
    """The first life: what it was given and has answered, and who waits when it is killed."""
    service = start_for_module(workers=1, max_checkpoint_bytes=10**6)
    client = service.client
    cold = client.get("/readyz")
    at_once = client.post("/allocate", json={**PROBLEM, "algorithm": "greedy"})
    service.await_ready()
    answer = client.post("/allocate", json={**PROBLEM, **QUICK}, headers=QUICK_KEY).json()
    policy = client.post("/library", json={"name": "kept", "job_id": answer["job_id"]}).json()
    job = client.get(f"/jobs/{answer['job_id']}").json()
    running = later(client, {**PROBLEM, **LONG})
    waiting = later(client, {**PROBLEM, "algorithm": "greedy"})
    service.stop(signal.SIGKILL)
    return SimpleNamespace(
        cold=cold, at_once=at_once, answer=answer, policy=policy, job=job, running=running, waiting=waiting
    )


@pytest.fixture(scope="module")
def stopped(killed, start_for_module):
    """The second life: it goes on with the first, and is stopped with streams open and a batch half done."""
    service = start_for_module(workers=1).await_ready()
    client = service.client
    again = client.post("/allocate", json={**PROBLEM, **QUICK}, headers=QUICK_KEY).json()
    job = client.get(f"/jobs/{killed.job['id']}").json()
    policy = client.get(f"/library/{killed.policy['id']}").json()
    client.delete(f"/jobs/{killed.running}")
    states = []
    for identifier in (killed.running, killed.waiting):
        with client.stream("GET", f"/jobs/{identifier}/events") as stream:
            for _ in stream.iter_lines():
                pass
        states.append(client.get(f"/jobs/{identifier}").json()["status"])

    with client.stream("POST", "/allocate/batch", json=BATCH, headers=BATCH_KEY) as batch:
        received = batch.iter_lines()
        first = json.loads(next(received))
        long = later(client, {**PROBLEM, **LONG})
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
        again=again, job=job, policy=policy, states=states, first=first, rest=rest, long=long, ended=ended
    )


@pytest.fixture(scope="module")
def last(stopped, start_for_module):
    """The third life, which has some seconds for its end."""
    service = start_for_module(workers=1, shutdown_grace_s=6.0).await_ready()
    service.client.delete(f"/jobs/{stopped.long}")
    return service


def test_it_takes_jobs_before_it_is_ready(killed):
    assert killed.cold.status_code in (200, 503)
    if killed.cold.status_code == 503:
        assert killed.cold.json()["type"] == "not-ready"
        assert killed.cold.headers["retry-after"] == "1"
    assert killed.at_once.status_code == 200


def test_a_kill_keeps_jobs_and_library_and_the_next_goes_on_with_what_ran(killed, stopped):
    assert stopped.job == killed.job
    assert stopped.policy == killed.policy
    assert stopped.again == killed.answer
    assert stopped.states == ["cancelled", "succeeded"]


def test_a_clean_stop_ends_open_streams_and_says_what_it_leaves(stopped):
    assert stopped.ended in ENDED
    for line in stopped.rest:
        assert "allocation" in line or line["problem"]["type"] == "draining"


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
        with httpx.Client(base_url=url, timeout=60) as client:
            answers[name] = client.post("/allocate", json=body)

    def ask_for_many():
        body = {"problems": [{**PROBLEM, **LONG}]}
        with (
            httpx.Client(base_url=url, timeout=60) as client,
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
    unfinished.sendall(b"POST /allocate HTTP/1.1\r\nHost: localhost\r\nContent-Length: 10\r\n\r\n{")
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
        assert (answers[name].status_code, answers[name].json()["type"]) == (503, "draining")
        assert int(answers[name].headers["retry-after"]) > 0
    assert [line["problem"]["type"] for line in answers["batch"]] == ["draining"]
    assert refused.startswith(b"HTTP/1.1 503 ")
    assert b'"type":"draining"' in refused
