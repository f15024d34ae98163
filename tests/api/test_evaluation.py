"""POST /evaluate: a plan of somebody's own."""

import pytest

UAVS = [
    {"x_s": 0.1, "y_s": 0.2, "speed": 1.0, "voyage": 3.0, "loadlist": [5, 2]},
    {"x_s": 0.8, "y_s": 0.4, "speed": 1.2, "voyage": 2.5, "loadlist": [3, 6]},
]
TARGETS = [
    {"x": 0.3, "y": 0.9, "level": 1.0, "loadlist": [2, 1]},
    {"x": 0.6, "y": 0.1, "level": 0.4, "loadlist": [1, 3]},
    {"x": 0.9, "y": 0.7, "level": 0.8, "loadlist": [4, 2]},
]
PROBLEM = {"uavs": UAVS, "targets": TARGETS, "objective": {"distance_weight": 1.0}}


def test_a_plan_is_worth_what_its_allocation_says(client):
    found = client.post("/allocate", json={**PROBLEM, "algorithm": "greedy"}).json()
    again = client.post("/evaluate", json={**PROBLEM, "assignment": found["assignment"], "bound": True})
    assert again.status_code == 200
    answer = again.json()
    same = (
        "assignment",
        "reward",
        "satisfaction",
        "distance",
        "distance_weight",
        "routes",
        "unmet",
        "reasons",
    )
    assert {name: answer[name] for name in same} == {name: found[name] for name in same}
    assert answer["bound"] >= answer["reward"]
    assert answer["remaining"] is None


def test_every_action_that_breaks_a_rule_is_named_with_its_figures(client):
    short = {**PROBLEM, "uavs": [{**UAVS[0], "voyage": 1.2}, UAVS[1]]}
    answer = client.post("/evaluate", json={**short, "assignment": [[0, 0], [7, 3], [1, 1]]})
    assert answer.status_code == 422
    problem = answer.json()
    assert problem["type"] == "/docs/errors#illegal-plan"
    assert [each["rule"] for each in problem["breaches"]] == ["range", "no_such_action", "returning"]
    first = problem["breaches"][0]
    assert (first["step"], first["uav_id"], first["target_id"], first["had"]) == (1, "uav-1", "area-1", 1.2)
    assert first["needed"] == pytest.approx(2 * (0.2**2 + 0.7**2) ** 0.5)
    assert [each["pointer"] for each in problem["errors"]] == [
        "/assignment/0/0",
        "/assignment/1/0",
        "/assignment/2/1",
    ]


def test_what_remains_can_be_allocated(client):
    asked = {**PROBLEM, "assignment": [[0, 2], [1, 3]], "at": 0.5}
    remaining = client.post("/evaluate", json=asked).json()["remaining"]
    assert remaining["uavs"][0]["committed"] == ["area-1"]
    assert remaining["uavs"][0]["dis"] == pytest.approx(0.5)
    answer = client.post("/allocate", json={**remaining, "algorithm": "local_search"})
    assert answer.status_code == 200
    assert answer.json()["assignment"][0][0] == 0


def test_a_plan_to_start_from_is_a_floor_and_has_to_be_legal(client):
    start = [[2, 0], [3, 1]]
    worth = client.post("/evaluate", json={**PROBLEM, "assignment": start}).json()["reward"]
    for algorithm in ("greedy", "ga", "local_search", "auto"):
        asked = {**PROBLEM, "algorithm": algorithm, "start_plan": start, "time_limit_s": 0.3}
        assert client.post("/allocate", json=asked).json()["reward"] >= worth - 1e-12
    refused = client.post("/allocate", json={**PROBLEM, "algorithm": "greedy", "start_plan": [[0, 0]]})
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["pointer"] == "/start_plan/0/1"


def test_rows_have_an_action_a_uav(client):
    answer = client.post("/evaluate", json={**PROBLEM, "assignment": [[0]]})
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert (error["pointer"], error["detail"]) == ("/assignment/0", "1 actions, but there are 2 UAVs")


def test_an_evaluated_plan_can_be_taken_along(client):
    asked = {**PROBLEM, "assignment": [[0, 2], [1, 3]]}
    job_id = client.post("/evaluate", json=asked).json()["job_id"]
    for form in ("csv", "geojson"):
        assert client.get(f"/jobs/{job_id}/plan", params={"format": form}).status_code == 200
