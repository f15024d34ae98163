"""What an answer says of times, ways and landings over HTTP, and that others say nothing of it."""

import json

from app.api.allocation_models import Allocation

PLAIN = {
    "uavs": [
        {"x_s": 0, "y_s": 0, "speed": 2, "voyage": 40, "loadlist": [3]},
        {"x_s": 0, "y_s": 0, "speed": 2, "voyage": 40, "loadlist": [1]},
    ],
    "targets": [{"x": 8, "y": 0, "level": 1, "loadlist": [3], "service_time": 0.5}],
    "objective": {"distance_weight": 0.01},
    "algorithm": "greedy",
}
ZONE = {"id": "airport", "polygon": [[4, -3], [5, -3], [5, 4], [4, 4]]}
WORLD = {
    **PLAIN,
    "targets": [{**PLAIN["targets"][0], "earliest": 9}],
    "no_fly_zones": [ZONE],
    "start_plan": [[1, 0]],
    "objective": {"distance_weight": 0.01, "makespan_weight": 0.001},
}
LATER = {
    *("begin_time", "departure_time", "range_left", "endurance_left", "path"),
    *("landing", "makespan", "changes"),
}


def keys_of(value):
    """All keys of an object and of what is in it."""
    if isinstance(value, dict):
        return set(value).union(*map(keys_of, value.values()))
    return set().union(*map(keys_of, value)) if isinstance(value, list) else set()


def test_an_answer_says_when_and_by_which_way(client):
    answer = client.post("/allocate", json=WORLD).json()

    there = 5 + 1 + 18**0.5
    flies, stays = answer["routes"]
    (stop,) = flies["stops"]
    assert stop == {
        "target_id": "area-1",
        "step": 1,
        "arrival_time": stop["arrival_time"],
        "distance": stop["distance"],
        "delivered": [3.0],
        "begin_time": 9.0,
        "departure_time": 9.5,
        "range_left": 40 - stop["distance"],
        "endurance_left": None,
        "path": [[0.0, 0.0], [4.0, -3.0], [5.0, -3.0], [8.0, 0.0]],
    }
    assert abs(stop["distance"] - there) < 1e-12
    assert flies["landing"]["path"] == stop["path"][::-1]
    assert flies["landing"]["time"] == answer["makespan"] == 9.5 + stop["distance"] / 2
    assert stays["landing"] is None
    assert answer["changes"] == 1
    earned = 1 - 0.01 * stop["distance"] - 0.001 * answer["makespan"]
    assert abs(answer["reward"] - earned) < 1e-12


def test_an_answer_of_the_first_edition_says_nothing_of_it(client):
    named = {**PLAIN, "uavs": [{**PLAIN["uavs"][0], "name": "Kestrel"}, PLAIN["uavs"][1]]}
    for body in (PLAIN, {**named, "materials": [{"name": "water"}]}):
        answer = client.post("/allocate", json=body).json()
        assert not keys_of(answer) & LATER


def test_retries_batches_and_models_say_the_same(client):
    for body in (PLAIN, WORLD):
        key = {"Idempotency-Key": json.dumps(body)[-60:]}
        answer, again = (client.post("/allocate", json=body, headers=key).json() for _ in range(2))
        assert again == answer
        assert Allocation(**answer).model_dump(mode="json", exclude_unset=True) == answer
        line = json.loads(client.post("/allocate/batch", json={"problems": [body]}).text)["allocation"]
        result = client.get(f"/jobs/{answer['job_id']}").json()["result"]
        differ = {"job_id", "elapsed_s"}
        assert {**line, **{name: answer[name] for name in differ}} == answer == result


def test_the_description_says_that_they_may_be_left_out(client):
    schemas = client.get("/openapi.json").json()["components"]["schemas"]
    for model, names in (
        ("StopModel", {"begin_time", "departure_time", "range_left", "endurance_left", "path"}),
        ("RouteModel", {"landing"}),
        ("Allocation", {"makespan", "changes"}),
    ):
        assert names <= set(schemas[model]["properties"])
        assert not names & set(schemas[model]["required"])
