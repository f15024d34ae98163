"""What is refused: with which status, which problem type, and which pointer."""

import copy
import gzip
import json

import pytest

HUGE = "1" + "0" * 400


def changed(problem, path, value):
    """A copy of a problem with one place changed; a path like uavs/0/speed."""
    body = copy.deepcopy({**problem, "algorithm": "greedy"})
    *parents, last = path.split("/")
    place = body
    for step in parents:
        place = place[int(step)] if isinstance(place, list) else place.setdefault(step, {})
    if isinstance(place, list):
        place[int(last)] = value
    else:
        place[last] = value
    return body


def refusal(response, status, kind):
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    assert response.headers["x-request-id"]
    problem = response.json()
    assert {"type", "title", "status", "detail", "instance"} <= problem.keys()
    assert (problem["status"], problem["type"]) == (status, f"/docs/errors#{kind}")
    return problem


@pytest.mark.parametrize(
    ("path", "value", "pointer"),
    [
        ("surprise", 1, "/surprise"),
        ("uavs/0/colour", "red", "/uavs/0/colour"),
        ("uavs/0/a~b/c", {}, "/uavs/0/a~0b"),
        ("objective/lambda", 1, "/objective/lambda"),
        ("uavs", [], "/uavs"),
        ("targets", [], "/targets"),
        ("uavs", {}, "/uavs"),
        ("uavs/1", None, "/uavs/1"),
        ("uavs/0/speed", -1, "/uavs/0/speed"),
        ("uavs/0/speed", 0, "/uavs/0/speed"),
        ("uavs/0/speed", "1", "/uavs/0/speed"),
        ("uavs/0/speed", True, "/uavs/0/speed"),
        ("uavs/0/speed", None, "/uavs/0/speed"),
        ("uavs/0/voyage", -0.1, "/uavs/0/voyage"),
        ("uavs/0/dis", -1, "/uavs/0/dis"),
        ("uavs/0/ret", 2, "/uavs/0/ret"),
        ("uavs/0/ret", True, "/uavs/0/ret"),
        ("uavs/0/x_s", 1e13, "/uavs/0/x_s"),
        ("uavs/0/loadlist", [], "/uavs/0/loadlist"),
        ("uavs/0/loadlist/1", -1, "/uavs/0/loadlist/1"),
        ("uavs/1/loadlist", [1, 2], "/uavs/1/loadlist"),
        ("targets/3/loadlist", [1, 2, 3, 4], "/targets/3/loadlist"),
        ("uavs/2/id", "uav-1", "/uavs/2/id"),
        ("targets/2/id", "area-1", "/targets/2/id"),
        ("uavs/0/id", "", "/uavs/0/id"),
        ("uavs/0/id", "x" * 101, "/uavs/0/id"),
        ("uavs/0/id", "\x00", "/uavs/0/id"),
        ("targets/0/level", -1, "/targets/0/level"),
        ("targets/0/service_time", -1, "/targets/0/service_time"),
        ("targets/0/deadline", "soon", "/targets/0/deadline"),
        ("max_steps", 0, "/max_steps"),
        ("max_steps", 101, "/max_steps"),
        ("max_steps", 5.5, "/max_steps"),
        ("crs", "mars", "/crs"),
        ("objective/distance_weight", -1, "/objective/distance_weight"),
        ("objective/charge_return", 1, "/objective/charge_return"),
        ("seed", -1, "/seed"),
        ("seed", 2**53, "/seed"),
        ("time_limit_s", 0, "/time_limit_s"),
        ("parameters", [], "/parameters"),
    ],
)
def test_field_is_refused_where_it_is(client, problem, path, value, pointer):
    response = client.post("/allocate", json=changed(problem, path, value))

    assert response.status_code == 422, response.text
    refused = refusal(response, 422, response.json()["type"].rpartition("#")[2])
    assert refused["type"] in ("/docs/errors#invalid-request", "/docs/errors#invalid-problem")
    assert pointer in [error["pointer"] for error in refused["errors"]]
    assert all(error["detail"] for error in refused["errors"])


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("seed", 2**53, "is 9007199254740992, must be at most 9007199254740991"),
        ("uavs/0/speed", "3", "is a text, needs a number"),
        ("max_steps", "3", "is a text, needs a whole number"),
        ("uavs/0/x_s", 1e13, "is 10000000000000, must be at most 1000000000000"),
    ],
)
def test_a_number_is_said_as_it_is_and_a_text_is_no_number(client, problem, path, value, says):
    refused = client.post("/allocate", json=changed(problem, path, value)).json()

    assert says in [error["detail"] for error in refused["errors"]]


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999", HUGE])
def test_number_that_is_not_finite(client, problem, number):
    text = json.dumps(changed(problem, "uavs/0/voyage", "HERE")).replace('"HERE"', number)

    response = client.post("/allocate", content=text, headers={"Content-Type": "application/json"})

    assert refusal(response, 422, "invalid-request")["errors"][0]["pointer"] == "/uavs/0/voyage"


@pytest.mark.parametrize(
    ("parameters", "pointer"),
    [
        ({"iterations": 5}, "/parameters/iterations"),
        ({"num_total": 1}, "/parameters/num_total"),
        ({"num_total": "30"}, "/parameters/num_total"),
        ({"mutation_rate": 1.5}, "/parameters/mutation_rate"),
        ({"\ud800": 1}, "/parameters/\\ud800"),
    ],
)
def test_parameters_of_the_algorithm(client, problem, parameters, pointer):
    body = json.dumps({**problem, "algorithm": "ga", "parameters": parameters})

    response = client.post("/allocate", content=body, headers={"Content-Type": "application/json"})

    refused = refusal(response, 422, response.json()["type"].rpartition("#")[2])
    assert refused["type"] in ("/docs/errors#invalid-parameters", "/docs/errors#invalid-request")
    assert refused["errors"][0]["pointer"] in (pointer, "/parameters")


def test_not_a_number_among_the_parameters(client, problem):
    body = json.dumps({**problem, "algorithm": "ga", "parameters": {"mutation_rate": float("nan")}})

    response = client.post("/allocate", content=body, headers={"Content-Type": "application/json"})

    assert refusal(response, 422, "invalid-parameters")["errors"][0]["pointer"] == "/parameters/mutation_rate"


ZONE = {"polygon": [[0.4, 0.4], [0.6, 0.4], [0.5, 0.6]]}


@pytest.mark.parametrize(
    ("algorithm", "parameters"),
    [("qmix", {"mode": "paper"}), ("transfer_qmix", {"mode": "paper"}), ("dqn", {})],
)
def test_field_that_the_algorithm_cannot_take_is_named(client, problem, algorithm, parameters):
    listed = {each["name"]: each["unsupported"] for each in client.get("/algorithms").json()["algorithms"]}
    reasons = {each["field"]: each["reason"] for each in listed[algorithm]}
    world = {**problem, "no_fly_zones": [ZONE], "objective": {"half_life": 2.0}}
    chosen = {"algorithm": algorithm, "parameters": parameters}

    refused = refusal(client.post("/allocate", json={**world, **chosen}), 422, "invalid-problem")

    told = {each["pointer"]: each["detail"] for each in refused["errors"]}
    assert told == {
        "/no_fly_zones": reasons["no_fly_zones"],
        "/objective/half_life": reasons["objective.half_life"],
    }
    assert all("`auto` takes it" in detail for detail in told.values())
    taken = client.post("/allocate", json={**world, "algorithm": "auto", "time_limit_s": 1})
    assert taken.status_code == 200, taken.text


def test_what_service_mode_leaves_to_the_papers_learner_is_refused_the_same_way(client, problem):
    """Where a problem is too large for the networks for every size, which only a worker sees."""
    large = {**problem, "uavs": 8 * problem["uavs"], "targets": 5 * problem["targets"]}
    for name, stem in (("uavs", "u"), ("targets", "t")):
        large[name] = [{**each, "id": f"{stem}{i}"} for i, each in enumerate(large[name])]
    body = {**large, "no_fly_zones": [ZONE], "algorithm": "qmix", "parameters": {"n_epochs": 1}}

    refused = refusal(client.post("/allocate", json=body), 422, "invalid-problem")

    assert [each["pointer"] for each in refused["errors"]] == ["/no_fly_zones"]


def test_training_that_cannot_take_a_field_of_its_task_is_refused(client, problem):
    body = {"name": "a town", "task": {**problem, "no_fly_zones": [ZONE]}}
    train = {"algorithm": "qmix", "parameters": {"mode": "paper", "n_epochs": 1}}

    refused = refusal(client.post("/library", json={**body, "train": train}), 422, "invalid-problem")

    assert [each["pointer"] for each in refused["errors"]] == ["/task/no_fly_zones"]


def test_unknown_algorithm_is_told_which_there_are(client, problem):
    refused = refusal(
        client.post("/allocate", json={**problem, "algorithm": "magic"}), 422, "unknown-algorithm"
    )

    assert refused["errors"][0]["pointer"] == "/algorithm"
    assert "ga" in refused["algorithms"]


@pytest.mark.parametrize("text", ['{"uavs": [', "", "\xff", "[" * 100_000, "{}}", '{"seed": 1, "seed": 2}'])
def test_body_that_is_not_json(client, text):
    response = client.post(
        "/allocate", content=text.encode("latin-1"), headers={"Content-Type": "application/json"}
    )

    if text:
        refusal(response, 400, "malformed-json")
    else:
        refusal(response, 422, "invalid-request")


@pytest.mark.parametrize("text", ["null", "[]", "1", '"text"', "{}"])
def test_json_that_is_no_request(client, text):
    for path in ("/allocate", "/library", "/library/similar"):
        response = client.post(path, content=text, headers={"Content-Type": "application/json"})
        refusal(response, 422, "invalid-request")


def test_lone_surrogate(client, problem):
    for body in (changed(problem, "uavs/0/id", "\ud800"), changed(problem, "\ud800", 1)):
        response = client.post(
            "/allocate", content=json.dumps(body), headers={"Content-Type": "application/json"}
        )
        refusal(response, 422, "invalid-request")


def test_nested_deep_where_anything_is_taken(client, problem):
    deep = json.dumps({**problem, "algorithm": "ga", "parameters": {"x": "HERE"}})
    deep = deep.replace('"HERE"', "[" * 900 + "]" * 900)

    response = client.post("/allocate", content=deep, headers={"Content-Type": "application/json"})

    assert response.status_code in (400, 422)
    assert response.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("content_type", ["text/plain", "application/x-www-form-urlencoded", ""])
def test_body_in_another_format(client, problem, content_type):
    headers = {"Content-Type": content_type} if content_type else {}

    response = client.post("/allocate", content=json.dumps(problem), headers=headers)

    assert "application/json" in refusal(response, 415, "unsupported-media-type")["detail"]


def test_body_that_is_compressed(client, problem):
    headers = {"Content-Type": "application/json", "Content-Encoding": "gzip"}

    response = client.post("/allocate", content=gzip.compress(json.dumps(problem).encode()), headers=headers)

    assert "gzip" in refusal(response, 415, "unsupported-media-type")["detail"]
    assert response.headers["accept-encoding"] == "identity"


@pytest.mark.parametrize("announced", [True, False])
def test_body_over_the_limit(client, announced):
    text = b" " * 250_001

    response = client.post(
        "/allocate",
        content=text if announced else iter([text[:150_000], text[150_000:]]),
        headers={"Content-Type": "application/json"},
    )

    refused = refusal(response, 413, "body-too-large")
    assert refused["limit"] == 250_000
    assert "250000" in refused["detail"]


@pytest.mark.parametrize(
    ("m", "n", "k", "pointer", "says"),
    [
        (41, 1, 1, "/uavs", "41 UAVs, at most 40"),
        (1, 51, 1, "/targets", "51 targets, at most 50"),
        (1, 1, 9, "/uavs/0/loadlist", "9 materials, at most 8"),
    ],
)
def test_problem_over_the_limits(client, m, n, k, pointer, says):
    body = {
        "algorithm": "greedy",
        "uavs": [{"x_s": 0, "y_s": 0, "speed": 1, "voyage": 1, "loadlist": [1] * k}] * m,
        "targets": [{"x": 0, "y": 0, "level": 1, "loadlist": [1] * k}] * n,
    }

    refused = refusal(client.post("/allocate", json=body), 422, "problem-too-large")

    says_the_same = {name: refused[name] for name in ("detail", "sentence", "values")}
    assert refused["errors"] == [{"pointer": pointer, **says_the_same}]
    assert says in refused["detail"]


def test_many_errors_are_cut(client, problem):
    body = {**problem, "targets": [{"x": "a", "y": "b", "level": "c", "loadlist": "d"}] * 50}

    refused = refusal(client.post("/allocate", json=body), 422, "invalid-request")

    assert len(refused["errors"]) == 100
    assert "(and at least 99 more)" in refused["detail"]


def test_nothing_of_the_request_is_echoed(client, problem):
    body = changed(problem, "uavs/0/speed", "a secret")

    assert "a secret" not in client.post("/allocate", json=body).text


@pytest.mark.parametrize(
    ("method", "path", "status", "kind"),
    [
        ("GET", "/nothing", 404, "not-found"),
        ("GET", "/examples/nothing", 404, "not-found"),
        ("PUT", "/allocate", 405, "method-not-allowed"),
        ("POST", "/jobs", 405, "method-not-allowed"),
        ("GET", "/jobs/nothing", 404, "job-not-found"),
        ("DELETE", "/jobs/nothing", 404, "job-not-found"),
        ("GET", "/jobs/nothing/events", 404, "job-not-found"),
        ("GET", "/library/nothing", 404, "policy-not-found"),
        ("GET", "/library/nothing/checkpoint", 404, "policy-not-found"),
        ("DELETE", "/library/nothing", 404, "policy-not-found"),
        ("GET", "/library/%00", 404, "policy-not-found"),
        ("DELETE", "/library/%00", 404, "policy-not-found"),
        ("GET", "/library/%ED%A0%80/checkpoint", 404, "policy-not-found"),
        ("GET", "/jobs/%00", 404, "job-not-found"),
        ("DELETE", "/jobs/%00", 404, "job-not-found"),
        ("GET", "/jobs/%00/events", 404, "job-not-found"),
        ("GET", "/jobs/" + "0" * 31 + "%0A", 404, "job-not-found"),
        ("GET", "/jobs/" + "0" * 32 + "%0A", 404, "job-not-found"),
        ("GET", "/jobs?cursor=nothing", 422, "invalid-cursor"),
        ("GET", "/library?cursor=nothing", 422, "invalid-cursor"),
    ],
)
def test_places_there_are_not(client, method, path, status, kind):
    refused = refusal(client.request(method, path), status, kind)

    assert refused["instance"].startswith("/" + path.split("/")[1].split("?")[0])


@pytest.mark.parametrize("path", ["/jobs", "/library"])
@pytest.mark.parametrize("limit", ["0", "101", "x"])
def test_page_size(client, path, limit):
    refused = refusal(client.get(path, params={"limit": limit}), 422, "invalid-request")

    assert refused["errors"][0]["parameter"] == "limit"


def test_method_not_allowed_says_what_is(client):
    assert client.put("/allocate").headers["allow"] == "POST"
    assert client.put("/library").headers["allow"] == "GET, HEAD, POST"
    assert client.put("/jobs/x").headers["allow"] == "DELETE, GET, HEAD"
    assert set(client.delete("/docs").headers["allow"].split(", ")) == {"GET", "HEAD"}


@pytest.mark.parametrize(
    "path", ["/healthz", "/readyz", "/jobs?limit=1", "/metrics", "/", "/nowhere", "/jobs/x"]
)
def test_head_is_get_without_a_body(client, path):
    head, get = client.head(path), client.get(path)

    assert head.status_code == get.status_code
    assert head.content == b""
    assert head.headers["content-type"] == get.headers["content-type"]
    assert head.headers["x-request-id"]


def test_there_is_no_head_of_what_takes_a_body_or_goes_on(client):
    assert client.head("/allocate").status_code == 405
    assert client.head(f"/jobs/{'0' * 32}/events").status_code == 405
