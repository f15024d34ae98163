"""Problems over HTTP: names in every script, what was requested, amounts that add up, and warnings."""

import json

import pytest
from cases import case
from referee import replay

GREEDY = {"algorithm": "greedy"}


def answered(client, body):
    response = client.post("/allocate", json=body)
    assert response.status_code == 200, response.text
    return response.json()


@pytest.mark.parametrize(
    "name",
    [
        "F1a-id-sinhala", "F1b-id-persian", "F1c-id-no-break-space", "F2a-antimeridian-both-signs",
        "F3a-ten-tenths", "F3c-crumb-two-areas", "O1b-same-scene-10-degrees-west", "O2-speed-1e-10",
        "extent-5e-324-500", "extreme-bound-index-error",
    ],
)  # fmt: skip
def test_every_case_is_answered_as_the_referee_has_it(client, name):
    problem = {key: value for key, value in case(name).items() if key != "algorithm"}
    answer = answered(client, {**problem, **GREEDY, "bound": True})
    truth = replay(problem, answer["assignment"])
    for field in ("reward", "satisfaction", "distance", "distance_weight"):
        assert answer[field] == pytest.approx(truth[field], rel=1e-9, abs=1e-12), field
    assert answer["bound"] >= answer["reward"] - 1e-12
    # Numbers under 1e-100 count as 0.
    unmet = [need for need in truth["remaining"] if max(need) >= 1e-100]
    assert [item["remaining"] for item in answer["unmet"]] == [pytest.approx(need) for need in unmet]


def test_a_name_that_cannot_stand_in_a_line_is_refused_with_its_character(client):
    body = {**case("F1a-id-sinhala"), **GREEDY}
    body["targets"][0]["id"] = "clinic \u202ecba"
    refused = client.post("/allocate", json=body)
    assert refused.status_code == 422
    (error,) = refused.json()["errors"]
    assert error["pointer"] == "/targets/0/id"
    assert "U+202E RIGHT-TO-LEFT OVERRIDE as character 8" in error["detail"]


def test_an_area_that_has_nearly_all_is_less_urgent(client, problem):
    body = {**problem, **GREEDY, "objective": {"distance_weight": 0}}
    target = body["targets"][0]
    full = answered(client, body)
    target["requested"] = [41 * amount + 1 for amount in target["loadlist"]]
    begun = answered(client, body)
    assert begun["reward"] == pytest.approx(replay(body, begun["assignment"])["reward"], rel=1e-9)
    assert begun["reward"] < full["reward"]
    target["requested"] = [amount / 2 for amount in target["loadlist"]]
    refused = client.post("/allocate", json=body)
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["pointer"] == "/targets/0/requested/0"


def test_warnings_come_with_every_answer_and_stay_with_the_job(client, problem):
    assert answered(client, {**problem, **GREEDY})["warnings"] == []
    swapped = {**case("O4-swapped-station-dhangadi"), **GREEDY}
    answer = answered(client, swapped)
    (warning,) = answer["warnings"]
    assert (warning["pointer"], warning["code"]) == ("/targets/26/x", "coordinates_swapped")
    assert "Chisapani Station" in warning["detail"]
    assert client.get(f"/jobs/{answer['job_id']}").json()["result"]["warnings"] == [warning]
    batch = client.post("/allocate/batch", json={"problems": [{**problem, **GREEDY}, swapped]})
    found = [json.loads(line) for line in batch.text.splitlines()]
    assert sorted(len(line["allocation"]["warnings"]) for line in found) == [0, 1]
