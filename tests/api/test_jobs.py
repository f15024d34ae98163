"""Jobs over HTTP: asynchronous answers, polling, event streams, cancelling, retries, a full queue."""

import json
import socket
import threading

import pytest
from referee import replay

LONG = {"algorithm": "qmix", "parameters": {"n_epochs": 10_000_000, "evaluate_per_epoch": 100}}
ASYNC = {"Prefer": "respond-async"}


def submit(client, problem, **headers):
    response = client.post("/allocate", json={**problem, **LONG}, headers={**ASYNC, **headers})
    assert response.status_code == 202, response.text
    assert response.headers["location"] == f"/jobs/{response.json()['id']}"
    return response.json()["id"]


def events(lines):
    """The events of a stream, as triples of id, name and data."""
    fields = {}
    for line in lines:
        if line:
            name, _, value = line.partition(":")
            fields[name] = value.strip()
        elif "event" in fields:
            yield int(fields["id"]), fields["event"], json.loads(fields["data"])
            fields = {}


def until_running(client, job_id):
    """Wait for the first progress that has a plan."""
    with client.stream("GET", f"/jobs/{job_id}/events") as stream:
        for _, _, data in events(stream.iter_lines()):
            if data["assignment"]:
                return data
    raise AssertionError("the job has ended")


def test_answer_of_a_job_is_the_answer_of_the_call(client, problem, follow):
    body = {**problem, "algorithm": "ga", "parameters": {"iteration": 20}}
    waited = client.post("/allocate", json=body).json()
    response = client.post("/allocate", json=body, headers=ASYNC)

    job = follow(response.json()["id"])

    assert response.headers["preference-applied"] == "respond-async"
    assert job["status"] == "succeeded"
    assert job["kind"] == "allocate"
    assert job["error"] is None
    assert job["progress"]["fraction"] == 1.0
    assert job["created_at"] <= job["started_at"] <= job["finished_at"]
    result = job["result"]
    assert result["job_id"] == job["id"]
    for answer in (waited, result):
        del answer["job_id"], answer["elapsed_s"]
    assert result == waited


def test_wait_is_bounded(client, problem):
    response = client.post("/allocate", json={**problem, **LONG}, headers={"Prefer": "wait=1"})

    assert response.status_code == 202
    assert response.headers["preference-applied"] == "wait=1"
    client.delete(response.headers["location"])


def test_wait_that_is_long_enough_is_answered_at_once(client, problem):
    body = {**problem, "algorithm": "greedy"}

    response = client.post("/allocate", json=body, headers={"Prefer": "respond-async, wait=30"})

    assert response.status_code == 200
    assert response.headers["preference-applied"] == "respond-async, wait=30"


def test_cancelling_keeps_the_best_plan(client, problem, follow):
    job_id = submit(client, problem)
    seen = until_running(client, job_id)

    response = client.delete(f"/jobs/{job_id}")
    job = follow(job_id)

    assert response.status_code in (200, 202)
    assert job["status"] == "cancelled"
    truth = replay(problem, job["result"]["assignment"])
    assert job["result"]["reward"] == pytest.approx(truth["reward"])
    assert job["result"]["reward"] >= seen["best_reward"]
    assert client.delete(f"/jobs/{job_id}").status_code == 200
    assert client.get(f"/jobs/{job_id}").json() == job


def test_caller_that_waits_gets_the_best_plan_of_a_cancelled_job(client, problem):
    before = {job["id"] for job in client.get("/jobs", params={"limit": 100}).json()["jobs"]}
    answers = []
    waiting = threading.Thread(
        target=lambda: answers.append(client.post("/allocate", json={**problem, **LONG}))
    )
    waiting.start()
    job_id = None
    while job_id is None:
        found = client.get("/jobs", params={"limit": 1}).json()["jobs"][0]
        job_id = found["id"] if found["id"] not in before else None
    until_running(client, job_id)

    client.delete(f"/jobs/{job_id}")
    waiting.join(30)

    assert answers[0].status_code == 200
    assert answers[0].json()["job_id"] == job_id
    replay(problem, answers[0].json()["assignment"])


def test_events_go_on_where_they_were_cut_off(client, problem):
    job_id = submit(client, problem)
    until_running(client, job_id)
    client.delete(f"/jobs/{job_id}")
    with client.stream("GET", f"/jobs/{job_id}/events") as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        all_of_them = list(events(stream.iter_lines()))
    last_seen = all_of_them[0][0]
    with client.stream("GET", f"/jobs/{job_id}/events", headers={"Last-Event-ID": str(last_seen)}) as stream:
        rest = list(events(stream.iter_lines()))

    ids = [identifier for identifier, _, _ in all_of_them]
    assert ids == sorted(set(ids))
    assert [name for _, name, _ in all_of_them[:-1]] == ["progress"] * (len(all_of_them) - 1)
    assert all_of_them[-1][1] == "end"
    assert all_of_them[-1][2]["status"] == "cancelled"
    assert all(0 <= data["fraction"] <= 1 for _, _, data in all_of_them)
    # Of a job that has ended only the newest progress is known, and told again where it may have been missed.
    assert rest[-1] == all_of_them[-1]
    assert all(identifier > last_seen for identifier, _, _ in rest)
    assert [event[1:] for event in rest] == [event[1:] for event in all_of_them[-len(rest) :]]
    with client.stream("GET", f"/jobs/{job_id}/events", headers={"Last-Event-ID": str(ids[-1])}) as stream:
        # An answer that ends the reconnecting of a browser.
        assert stream.status_code == 204
    for ahead in (ids[-1] + 600_000, 10**17):
        with client.stream("GET", f"/jobs/{job_id}/events", headers={"Last-Event-ID": str(ahead)}) as stream:
            assert list(events(stream.iter_lines()))[-1][1] == "end"


def listed_by_pages_of(client, limit):
    listed, cursor = [], None
    while True:
        page = client.get("/jobs", params={"limit": limit, **({"cursor": cursor} if cursor else {})}).json()
        assert len(page["jobs"]) <= limit
        listed += page["jobs"]
        cursor = page["next_cursor"]
        if cursor is None:
            return listed


def test_pages_list_every_job_once_newest_first(client, problem):
    for _ in range(3):
        client.post("/allocate", json={**problem, "algorithm": "greedy"})
    everything, listed = (listed_by_pages_of(client, limit) for limit in (100, 2))
    assert len(listed) >= 3
    assert [job["id"] for job in listed] == [job["id"] for job in everything]
    created = [job["created_at"] for job in listed]
    assert created == sorted(created, reverse=True)
    assert all("result" not in job for job in listed)


def test_a_list_has_the_jobs_of_one_status_without_their_plans(client, problem):
    running = submit(client, problem)
    until_running(client, running)
    done = client.post("/allocate", json={**problem, "algorithm": "greedy"}).json()["job_id"]

    lists = {
        status: client.get("/jobs", params={"status": status, "limit": 100}).json()["jobs"]
        for status in ("running", "succeeded", "queued")
    }
    refused = client.get("/jobs", params={"status": "asleep"})
    client.delete(f"/jobs/{running}")

    assert [job["id"] for job in lists["running"]] == [running]
    assert done in [job["id"] for job in lists["succeeded"]]
    assert {job["status"] for job in lists["succeeded"]} == {"succeeded"}
    assert lists["queued"] == []
    for job in (*lists["running"], *lists["succeeded"]):
        assert set(job["progress"]) == {"fraction", "epoch", "best_reward"}
    assert (refused.status_code, refused.json()["errors"][0]["parameter"]) == (422, "status")


def begun_and_left(service, problem, **headers):
    """Ask for a long allocation, begin to leave once it runs, and return its id."""
    before = {job["id"] for job in service.client.get("/jobs", params={"limit": 100}).json()["jobs"]}
    body = json.dumps({**problem, **LONG}).encode()
    given = {"Content-Type": "application/json", "Content-Length": len(body), **headers}
    head = "".join(f"{name}: {value}\r\n" for name, value in given.items())
    url = service.client.base_url
    connection = socket.create_connection((url.host, url.port))
    connection.sendall(f"POST /allocate HTTP/1.1\r\nHost: {url.host}\r\n{head}\r\n".encode() + body)
    while True:
        found = service.client.get("/jobs", params={"limit": 1}).json()["jobs"][0]
        if found["id"] not in before and found["status"] == "running":
            return found["id"], connection


def test_a_job_whose_client_has_gone_is_ended_if_nobody_else_can_want_it(service, problem, follow):
    client = service.client
    left, connection = begun_and_left(service, problem)
    connection.close()
    followed, connection = begun_and_left(service, problem)
    assert client.get(f"/jobs/{followed}").json()["status"] == "running"
    connection.close()

    # It ends by itself, without anybody who follows it.
    ended = None
    while ended is None:
        listed = client.get("/jobs", params={"status": "cancelled", "limit": 100}).json()["jobs"]
        ended = next((job for job in listed if job["id"] == left), None)
    # The place it had is another's, who comes again with a key; the followed one still has its own.
    keyed, connection = begun_and_left(service, problem, **{"Idempotency-Key": "left-1"})
    connection.close()
    for _ in range(3):
        client.post("/allocate", json={**problem, "algorithm": "greedy", "time_limit_s": 0.2})
    states = {job_id: client.get(f"/jobs/{job_id}").json()["status"] for job_id in (followed, keyed)}
    for job_id in states:
        client.delete(f"/jobs/{job_id}")
        follow(job_id)
    assert set(states.values()) == {"running"}


def test_retry_with_the_same_key_is_the_same_job(client, problem):
    body = {**problem, "algorithm": "greedy"}
    key = {"Idempotency-Key": "retry-1"}
    first = client.post("/allocate", json=body, headers=key)

    again = client.post("/allocate", json=dict(reversed(body.items())), headers=key)
    later = client.post("/allocate", json=body, headers={**key, **ASYNC})
    other = client.post("/allocate", json={**body, "seed": 1}, headers=key)

    assert first.json() == again.json()
    assert later.json()["id"] == first.json()["job_id"]
    assert other.status_code == 422
    assert other.json()["type"] == "/docs/errors#idempotency-key-reused"


def test_full_queue_says_when_to_come_back(client, problem, follow):
    jobs = []
    refused = None
    while refused is None:
        response = client.post("/allocate", json={**problem, **LONG}, headers=ASYNC)
        if response.status_code == 202:
            jobs.append(response.json()["id"])
            assert len(jobs) <= 4, "two workers and two places in the queue"
        else:
            refused = response
    for job_id in jobs:
        client.delete(f"/jobs/{job_id}")
    for job_id in jobs:
        follow(job_id)

    assert len(jobs) == 4
    assert refused.status_code == 429
    assert refused.json()["type"] == "/docs/errors#queue-full"
    assert int(refused.headers["retry-after"]) >= 1


def test_job_that_was_cancelled_before_it_began_has_no_plan(client, problem, follow):
    running = [submit(client, problem) for _ in range(2)]
    answers = []
    waiting = threading.Thread(
        target=lambda: answers.append(client.post("/allocate", json={**problem, "algorithm": "greedy"}))
    )
    waiting.start()
    queued = None
    while queued is None:
        assert not answers, answers[0].text
        newest = client.get("/jobs", params={"limit": 1}).json()["jobs"][0]
        queued = newest["id"] if newest["id"] not in running else None
    for job_id in (queued, *running):
        client.delete(f"/jobs/{job_id}")
    waiting.join(30)
    for job_id in running:
        follow(job_id)

    assert answers[0].status_code == 409
    assert answers[0].json()["type"] == "/docs/errors#job-cancelled"
    assert answers[0].json()["job_id"] == queued


def test_the_problem_of_a_job_is_the_one_that_was_sent(client, problem):
    sent = {
        **problem,
        "objective": {"unloading": "planned", "distance_weight": 0.25},
        "uavs": [{**problem["uavs"][0], "id": "moved", "x_c": 0.5, "dis": 1.5}, *problem["uavs"][1:]],
    }
    sent["targets"][0]["deadline"] = 40.0
    answer = client.post("/allocate", json={**sent, "algorithm": "greedy"}).json()

    found = client.get(f"/jobs/{answer['job_id']}/problem").json()

    assert found["objective"] == sent["objective"]
    assert found["uavs"][0] == {**sent["uavs"][0], "y_c": sent["uavs"][0]["y_s"]}
    assert [uav["id"] for uav in found["uavs"][1:]] == [
        uav.get("id", f"uav-{n}") for n, uav in enumerate(sent["uavs"][1:], 2)
    ]
    assert "x_c" not in found["uavs"][1]
    assert found["targets"][0]["deadline"] == 40.0
    again = client.post("/allocate", json={**found, "algorithm": "greedy"}).json()
    assert (again["assignment"], again["reward"]) == (answer["assignment"], answer["reward"])
    assert client.get(f"/jobs/{'0' * 32}/problem").status_code == 404
