"""POST /evaluate with amounts of one's own, where they are planned."""

import pytest

PROBLEM = {
    "uavs": [{"id": "u1", "x_s": 0, "y_s": 0, "speed": 1, "voyage": 10, "loadlist": [0, 0], "capacity": 4}],
    "targets": [
        {"id": "north", "x": 0, "y": 1, "level": 2, "loadlist": [3, 4]},
        {"id": "south", "x": 0, "y": -1, "level": 1, "loadlist": [3, 0]},
    ],
    "bases": [{"id": "base-1", "x": 0, "y": 0, "stock": [6, 20]}],
    "materials": [{"name": "water", "weight": 1}, {"name": "medicine", "weight": 0.25}],
    "objective": {"distance_weight": 0.1, "unloading": "planned", "loading": "planned"},
    "max_steps": 4,
}
PLAN = {"assignment": [[3], [0], [1]]}


def test_amounts_are_as_they_are_given(client):
    amounts = {"loaded": [[[2, 1]], [None], [None]], "delivered": [[None], [[1, 1]], [[1, 0]]]}
    answer = client.post("/evaluate", json={**PROBLEM, **PLAN, **amounts}).json()
    reload, north, south = answer["routes"][0]["stops"]
    assert (reload["loaded"], north["delivered"], south["delivered"]) == ([2.0, 1.0], [1.0, 1.0], [1.0, 0.0])
    assert answer["satisfaction"] == pytest.approx(2 * 2 / 7 + 1 / 3)
    assert answer["bases"] == [{"base_id": "base-1", "stock": [4.0, 19.0]}]
    assert {each["target_id"]: each["remaining"] for each in answer["unmet"]} == {
        "north": [2.0, 3.0],
        "south": [2.0, 0.0],
    }
    best = client.post("/evaluate", json={**PROBLEM, **PLAN}).json()
    assert best["satisfaction"] > answer["satisfaction"]
    own = {"loaded": [[each.get("loaded")] for each in best["routes"][0]["stops"]]}
    own["delivered"] = [[each.get("delivered")] for each in best["routes"][0]["stops"]]
    again = client.post("/evaluate", json={**PROBLEM, **PLAN, **own}).json()
    assert {**again, "job_id": "", "elapsed_s": 0} == {**best, "job_id": "", "elapsed_s": 0}


def test_what_remains_follows_them(client):
    amounts = {"loaded": [[[2, 1]], [None], [None]], "delivered": [[None], [[1, 1]], [[1, 0]]]}
    answer = client.post("/evaluate", json={**PROBLEM, **PLAN, **amounts, "at": 1.5}).json()
    assert answer["remaining"]["uavs"][0]["loadlist"] == [1.0, 0.0]
    assert answer["remaining"]["targets"][0]["loadlist"] == [2.0, 3.0]
    assert answer["remaining"]["bases"][0]["stock"] == [4.0, 19.0]


@pytest.mark.parametrize(
    ("loaded", "delivered", "says"),
    [
        ([7, 0], [3, 0], "it would take more than the base has in stock"),
        ([4, 4], [3, 0], "with that load it exceeds its capacity"),
        ([-1, 0], [0, 0], "it would unload more than the UAV carries or the area needs"),
        ([1, 0], [2, 0], "it would unload more than the UAV carries or the area needs"),
        ([1, 0], [0, 0], "it would unload nothing"),
    ],
)
def test_what_cannot_be_loaded_or_unloaded_is_refused(client, loaded, delivered, says):
    body = {
        **PROBLEM,
        "assignment": [[3], [0]],
        "loaded": [[loaded], [None]],
        "delivered": [[None], [delivered]],
    }
    answer = client.post("/evaluate", json=body)
    assert answer.status_code == 422
    assert answer.json()["type"].endswith("/docs/errors#illegal-plan")
    assert says in answer.json()["detail"]
    (error,) = answer.json()["errors"]
    assert error["pointer"] == (
        "/assignment/0/0" if "unload" not in says or loaded[0] < 0 else "/assignment/1/0"
    )
    assert error["detail"].endswith(says)


def test_every_action_that_no_amounts_allow_is_named_with_its_figures(client):
    north, south = PROBLEM["targets"]
    body = {**PROBLEM, "targets": [{**north, "y": 6}, {**south, "deadline": 0.5}]}
    answer = client.post("/evaluate", json={**body, **PLAN})
    assert answer.status_code == 422
    assert [(each["pointer"], each["detail"]) for each in answer.json()["errors"]] == [
        (
            "/assignment/1/0",
            "u1 to north: the visit, and the way home where it is required, exceed the voyage: "
            "12 needed, 10 there",
        ),
        ("/assignment/2/0", "u1 to south: it arrives after the deadline: 1 needed, 0.5 there"),
    ]
    assert [(each["step"], each["rule"]) for each in answer.json()["breaches"]] == [
        (2, "range"),
        (3, "deadline"),
    ]


@pytest.mark.parametrize("unloading", ["greedy", "planned"])
def test_an_action_of_many_digits_is_no_action(client, unloading):
    objective = {"unloading": unloading}
    answer = client.post("/evaluate", json={**PROBLEM, "objective": objective, "assignment": [[10**30]]})
    assert answer.status_code == 422
    assert answer.json()["errors"] == [
        {"pointer": "/assignment/0/0", "detail": "u1: there is no such action"}
    ]


@pytest.mark.parametrize(
    ("changes", "pointer", "says"),
    [
        ({"loaded": [[None]] * 3}, "/delivered", "given together"),
        (
            {"delivered": [[None]] * 2, "loaded": [[None]] * 3},
            "/delivered",
            "2 steps, but `assignment` has 3",
        ),
        ({"delivered": [[None]] * 3, "loaded": [[None, None], [None], [None]]}, "/loaded/0", "2 UAVs"),
        ({"delivered": [[[1]], [None], [None]], "loaded": [[None]] * 3}, "/delivered/0/0", "2 materials"),
        (
            {"delivered": [[[-1, 0]], [None], [None]], "loaded": [[None]] * 3},
            "/delivered/0/0/0",
            "less than 0",
        ),
        ({"delivered": [[None]] * 3, "objective": {}}, "/delivered", "is not planned"),
    ],
)
def test_amounts_that_do_not_fit_are_refused_by_name(client, changes, pointer, says):
    answer = client.post("/evaluate", json={**PROBLEM, **PLAN, **changes})
    assert answer.status_code == 422
    error = next(each for each in answer.json()["errors"] if each["pointer"] == pointer)
    assert says in error["detail"]


def test_reasons_keep_amounts_that_are_given(client):
    uav = {"id": "u1", "x_s": 0, "y_s": 0, "speed": 1, "voyage": 10, "loadlist": [4]}
    target = {"id": "north", "x": 0, "y": 1, "level": 2, "loadlist": [4]}
    body = {"uavs": [uav], "targets": [target], "objective": {"distance_weight": 0.1, "unloading": "planned"}}
    answer = client.post("/evaluate", json={**body, "assignment": [[0]], "delivered": [[[1]]]}).json()
    (reason,) = answer["unmet"]
    assert (reason["remaining"], reason["code"], reason["uav_id"]) == ([3.0], "not_chosen", "u1")
    assert reason["reward_change"] == pytest.approx(2 * 3 / 4)
