"""Many allocations in one request: each answered as it ends, and as durable as any job."""

import json
import time

import pytest


def lines_of(response):
    return [json.loads(line) for line in response.iter_lines()]


def in_order(lines):
    assert sorted(line["index"] for line in lines) == list(range(len(lines)))
    return sorted(lines, key=lambda line: line["index"])


@pytest.fixture
def item(problem):
    return {**problem, "algorithm": "ga", "parameters": {"num_total": 10, "iteration": 5}}


def test_every_problem_gets_the_answer_that_it_gets_alone(client, item):
    problems = [{**item, "seed": seed, "id": f"seed-{seed}"} for seed in range(12)]
    with client.stream("POST", "/allocate/batch", json={"problems": problems}) as response:
        assert response.status_code == 200
        assert response.headers["content-type"].startswith("application/x-ndjson")
        lines = in_order(lines_of(response))
    for line, asked in zip(lines, problems, strict=True):
        assert line["id"] == asked["id"]
        alone = client.post("/allocate", json={name: asked[name] for name in asked if name != "id"}).json()
        for name in ("reward", "assignment", "seed", "algorithm", "parameters", "unmet"):
            assert line["allocation"][name] == alone[name]
        job = client.get(f"/jobs/{line['allocation']['job_id']}").json()
        assert (job["kind"], job["status"]) == ("batch", "succeeded")


def test_what_is_wrong_with_one_is_told_in_its_line(client, item):
    twice = {**item, "uavs": [{**uav, "id": "same"} for uav in item["uavs"]]}
    problems = [item, {**item, "algorithm": "luck"}, twice, {**item, "parameters": {"wings": 2}}, item]
    with client.stream("POST", "/allocate/batch", json={"problems": problems}) as response:
        lines = in_order(lines_of(response))
    assert "id" not in lines[0]
    assert [line.get("problem", {}).get("type") for line in lines] == [
        None,
        "/docs/errors#unknown-algorithm",
        "/docs/errors#invalid-problem",
        "/docs/errors#invalid-parameters",
        None,
    ]
    alone = client.post("/allocate", json=problems[1]).json()
    assert {**lines[1]["problem"], "instance": "/allocate"} == alone


def test_a_body_of_the_wrong_shape_is_refused_as_a_whole(client, item):
    bad = {**item, "uavs": [{**item["uavs"][0], "speed": -1}]}
    refused = client.post("/allocate/batch", json={"problems": [item, bad]})
    assert (refused.status_code, refused.json()["type"]) == (422, "/docs/errors#invalid-request")
    assert refused.json()["errors"][0]["pointer"] == "/problems/1/uavs/0/speed"
    assert client.post("/allocate/batch", json={"problems": []}).status_code == 422


def test_too_many_are_refused_and_more_than_there_are_places_wait(narrow, item):
    client = narrow.await_ready().client
    refused = client.post("/allocate/batch", json={"problems": [item] * 4})
    assert (refused.status_code, refused.json()["type"]) == (422, "/docs/errors#batch-too-large")
    described = client.get("/openapi.json").json()["components"]["schemas"]["BatchRequest"]
    assert refused.json()["limit"] == described["properties"]["problems"]["maxItems"] == 3
    # Two batches of three, of which four wait at least: one has to be patient.
    slow = {**item, "algorithm": "local_search", "parameters": {}, "time_limit_s": 0.3}
    with (
        client.stream("POST", "/allocate/batch", json={"problems": [slow] * 3}) as one,
        client.stream("POST", "/allocate/batch", json={"problems": [slow] * 2}) as other,
    ):
        answers = [in_order(lines_of(response)) for response in (one, other)]
    assert [len(each) for each in answers] == [3, 2]
    assert all("allocation" in line for each in answers for line in each)


def test_answers_come_as_they_end_and_single_requests_go_first(client, item):
    slow = {**item, "algorithm": "local_search", "parameters": {}, "time_limit_s": 1.0, "id": "slow"}
    problems = [{**item, "algorithm": "greedy", "parameters": {}}, slow, slow, slow, slow]
    with client.stream("POST", "/allocate/batch", json={"problems": problems}) as response:
        received = response.iter_lines()
        first = json.loads(next(received))
        assert "id" not in first
        alone = client.post("/allocate", json={**item, "seed": 9}).json()
        lines = [first, *(json.loads(line) for line in received)]
    ended = [
        client.get(f"/jobs/{line['allocation']['job_id']}").json()["finished_at"]
        for line in lines
        if line.get("id")
    ]
    assert client.get(f"/jobs/{alone['job_id']}").json()["finished_at"] < max(ended)
    # The time of each counts from when its work begins: the last had its second too.
    last = max((line for line in lines if "id" in line), key=lambda line: line["allocation"]["elapsed_s"])
    assert last["allocation"]["elapsed_s"] > 1.5


def test_a_batch_goes_on_without_its_client_and_comes_again_with_its_key(client, item):
    problems = [{**item, "seed": seed} for seed in range(20, 32)]
    headers = {"Idempotency-Key": f"batch-{time.time_ns()}"}
    with client.stream("POST", "/allocate/batch", json={"problems": problems}, headers=headers) as response:
        first = json.loads(next(response.iter_lines()))
    with client.stream("POST", "/allocate/batch", json={"problems": problems}, headers=headers) as response:
        lines = in_order(lines_of(response))
    assert lines[first["index"]] == first
    with client.stream("POST", "/allocate/batch", json={"problems": problems}, headers=headers) as response:
        assert in_order(lines_of(response)) == lines
    other = [{**problems[0], "seed": 99}, *problems[1:]]
    with client.stream("POST", "/allocate/batch", json={"problems": other}, headers=headers) as response:
        again = in_order(lines_of(response))
    assert again[0]["problem"]["type"] == "/docs/errors#idempotency-key-reused"
    assert again[1:] == lines[1:]


def test_a_batch_whose_client_cannot_come_again_ends_with_it(client, item):
    endless = {**item, "algorithm": "qmix", "parameters": {"n_epochs": 10_000_000}}
    quick = {**item, "algorithm": "greedy", "parameters": {}}
    problems = [quick, *({**endless, "seed": seed} for seed in range(40, 46))]
    with client.stream("POST", "/allocate/batch", json={"problems": problems}) as response:
        assert "allocation" in json.loads(next(response.iter_lines()))

    states = ("queued", "running")
    while any(client.get("/jobs", params={"status": status}).json()["jobs"] for status in states):
        time.sleep(0.05)
