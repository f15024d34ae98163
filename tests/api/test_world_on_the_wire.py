"""Times, skills, weights, zones, wind, matrices and plans of a problem over HTTP."""

import json

import pytest

from app.api.allocation_models import AllocationRequest
from app.api.application import create_application
from app.api.body_validation import BodyValidator
from app.api.errors import InvalidBody
from app.api.json_body import read_body
from app.api.problem_models import to_problem
from app.domain.errors import InvalidProblem, ProblemTooLarge
from app.domain.records import problem_to_record
from app.settings import Settings

UAV = {"x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [5.0, 1.0]}
TARGET = {"x": 1, "y": 0, "level": 1, "loadlist": [2.0, 0.0]}
BODY = {"uavs": [UAV], "targets": [TARGET, TARGET]}
ZONE = {"polygon": [[0, 1], [1, 1], [1, 2], [0, 2], [0, 1]]}
LEGS = {"distance": [[0, 1, None], [1.5, 0, 2], [1, 1, 0]]}
ON_LEGS = {
    "uavs": [{**UAV, "location": 0, "home_location": 2, "profile": "road"}],
    "targets": [{**TARGET, "location": 1}, {**TARGET, "location": 2.0}],
}
VALIDATOR = BodyValidator(AllocationRequest)


def taken(settings=None, **fields):
    settings = settings or Settings()
    return to_problem(read_body(json.dumps({**BODY, **fields}).encode(), VALIDATOR, settings), settings)


def with_uav(**fields):
    return {"uavs": [{**UAV, **fields}]}


def test_what_is_sent_comes_back():
    uav = {
        "endurance": 3.0, "airborne": 1.0, "reserve": 0.25, "available_from": 1.0, "available_until": 9.0,
        "capacity": 40.0, "skills": ["medic"], "excluded": ["area-2"], "committed": ["area-1"],
        "name": "Kestrel", "properties": {"key": [1, {"a": None}]},
    }  # fmt: skip
    target = {"earliest": 1.0, "skills": ["medic", "="], "name": "Village", "properties": {"n": 1}}
    whole = {
        "materials": [{"name": "water", "weight": 1.5}, {}],
        "no_fly_zones": [{**ZONE, "name": "Airport", "properties": {}}, {"id": "w", **ZONE}],
        "wind": {"speed": 0.5, "towards": -90.0},
        "start_plan": [[1.0], [2]],
        "objective": {"half_life": 2.0, "minimum_share": 0.5, "minimum_weight": 3.0, "makespan_weight": 0.1},
    }
    record = problem_to_record(taken(uavs=[{**UAV, **uav}], targets=[{**TARGET, **target}, TARGET], **whole))
    assert {name: record["uavs"][0][name] for name in uav} == uav
    assert {name: record["targets"][0][name] for name in target} == target
    assert record["materials"] == [{"name": "water", "weight": 1.5}, {"name": "material-2"}]
    corners = [[0.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]
    assert record["no_fly_zones"] == [
        {"id": "zone-1", "polygon": corners, "name": "Airport", "properties": {}},
        {"id": "w", "polygon": corners},
    ]
    assert record["wind"] == whole["wind"]
    assert record["start_plan"] == [[1], [2]]
    assert whole["objective"].items() <= record["objective"].items()
    with_matrices = problem_to_record(taken(**ON_LEGS, matrices={"road": LEGS}))
    assert with_matrices["matrices"] == {"road": LEGS}
    assert [item["location"] for item in with_matrices["targets"]] == [1, 2]


def test_a_home_location_that_is_the_location_is_the_default():
    plain = {"uavs": [{**UAV, "location": 1}], "targets": ON_LEGS["targets"], "matrices": {"road": LEGS}}
    written = {**plain, "uavs": [{**UAV, "location": 1, "home_location": 1}]}
    assert taken(**plain) == taken(**written)


def test_what_is_null_or_empty_is_not_there():
    empty = {
        **with_uav(endurance=None, capacity=None, skills=[], excluded=[], committed=[], name=None),
        "materials": [], "no_fly_zones": [], "wind": None, "matrices": None, "start_plan": None,
    }  # fmt: skip
    assert taken(**empty) == taken()
    assert problem_to_record(taken(**empty)) == problem_to_record(taken())


@pytest.mark.parametrize(
    ("fields", "pointer", "said"),
    [
        (with_uav(reserve=1), "/uavs/0/reserve", "is 1, must be less than 1"),
        (with_uav(endurance=0), "/uavs/0/endurance", "is 0, must be more than 0"),
        (with_uav(skills=["a", 1]), "/uavs/0/skills/1", "needs a text"),
        (with_uav(location=0.5), "/uavs/0/location", "needs a whole number"),
        (with_uav(properties=[]), "/uavs/0/properties", "needs an object"),
        ({"wind": {"speed": 1}}, "/wind/towards", "is missing"),
        ({"wind": {"speed": 1, "towards": 0, "gusts": 2}}, "/wind/gusts", "unknown field"),
        ({"materials": [{"weight": "1"}, {}]}, "/materials/0/weight", "needs a number"),
        ({"no_fly_zones": [{"id": "z"}]}, "/no_fly_zones/0/polygon", "is missing"),
        ({"no_fly_zones": [{"polygon": [[0, 0], [1, 0]]}]}, "/no_fly_zones/0/polygon", "at least 3"),
        (
            {"no_fly_zones": [{"polygon": [[0, 0], [1, 0], [1, 1, 1]]}]},
            "/no_fly_zones/0/polygon/2",
            "at most 2",
        ),
        ({"matrices": {}}, "/matrices", "at least 1"),
        ({"matrices": {"r": {}}}, "/matrices/r/distance", "is missing"),
        ({"matrices": {"a/b": {**LEGS, "time": []}}}, "/matrices/a~1b/time", "there are distance, duration"),
        ({"matrices": {"r": 5}}, "/matrices/r", "needs an object"),
        (
            {"matrices": {"r": {"distance": [[0, -1]]}}},
            "/matrices/r/distance/0/1",
            "is -1, must be at least 0",
        ),
        ({"start_plan": [[0], [True]]}, "/start_plan/1/0", "needs a whole number"),
        ({"objective": {"minimum_share": 2}}, "/objective/minimum_share", "at most 1"),
    ],
)
def test_what_is_wrong_with_a_field_is_said_where_it_is(fields, pointer, said):
    with pytest.raises(InvalidBody) as caught:
        taken(**fields)
    (error,) = caught.value.errors
    assert error.pointer == pointer
    assert said in error.detail


@pytest.mark.parametrize(
    ("fields", "pointer"),
    [
        ({**with_uav(excluded=["area-3"])}, "/uavs/0/excluded/0"),
        ({"matrices": {"road": {"distance": [[0, 1], [1]]}}, **ON_LEGS}, "/matrices/road/distance/1"),
        ({"matrices": {"\t": LEGS}, **ON_LEGS}, "/matrices"),
        (
            {"crs": "wgs84", "no_fly_zones": [{"polygon": [[0, 0], [181, 0], [1, 1]]}]},
            "/no_fly_zones/0/polygon/1/0",
        ),
    ],
)
def test_rules_between_fields_are_those_of_the_domain(fields, pointer):
    with pytest.raises(InvalidProblem) as caught:
        taken(**fields)
    assert pointer in {each.pointer for each in caught.value.violations}


@pytest.mark.parametrize(
    ("setting", "fields", "pointer", "said"),
    [
        (
            "max_no_fly_zones",
            {"no_fly_zones": [ZONE, ZONE]},
            "/no_fly_zones",
            "2 no-fly zones, at most 1 are",
        ),
        ("max_materials", {"materials": [{}, {}]}, "/materials", "2 materials, at most 1 are"),
        (
            "max_profiles",
            {"matrices": {"road": LEGS, "b": LEGS}, **ON_LEGS},
            "/matrices",
            "2 profiles, at most 1",
        ),
        (
            "max_locations",
            {"matrices": {"road": LEGS}, **ON_LEGS},
            "/matrices/road/distance",
            "3 rows, at most 1",
        ),
        ("max_skills", with_uav(skills=["a", "b"]), "/uavs/0/skills", "2 words, at most 1"),
        (
            "max_targets",
            {**with_uav(excluded=["a", "b"]), "targets": [TARGET]},
            "/uavs/0/excluded",
            "2 ids, at most 1",
        ),
    ],
)
def test_every_list_has_a_limit(setting, fields, pointer, said):
    with pytest.raises(ProblemTooLarge) as caught:
        taken(Settings(**{setting: 1}), **fields)
    found = {each.pointer: each.detail for each in caught.value.violations}
    assert said in found[pointer]


def test_the_corners_of_all_zones_together_are_limited():
    zones = {"no_fly_zones": [ZONE, ZONE]}
    assert len(taken(Settings(max_zone_corners=10), **zones).no_fly_zones) == 2
    with pytest.raises(ProblemTooLarge, match="10 corners of no-fly zones, at most 9 are taken"):
        taken(Settings(max_zone_corners=9), **zones)


def test_the_largest_matrices_and_the_largest_properties_are_taken():
    settings = Settings(max_locations=400)
    size = settings.max_locations
    legs = {"distance": [[1] * size] * size, "duration": [[2] * size] * size}
    fields = {**ON_LEGS, "matrices": {"road": legs}}
    names = {f"{k:x}": 1 for k in range(500)}
    fields["uavs"] = [{**fields["uavs"][0], "properties": names}]
    problem = taken(settings, **fields)
    assert problem.matrices["road"].duration.shape == (size, size)
    assert problem.uavs[0].properties == names


def test_the_description_of_the_service_has_the_limits():
    schemas = create_application(Settings(max_skills=7, max_locations=9)).openapi()["components"]["schemas"]
    problem, uav = schemas["ProblemModel"]["properties"], schemas["UAVModel"]["properties"]
    assert uav["skills"]["maxItems"] == 7
    assert uav["skills"]["default"] == []
    assert uav["excluded"]["maxItems"] == Settings().max_targets
    assert problem["no_fly_zones"]["maxItems"] == Settings().max_no_fly_zones
    assert problem["matrices"]["anyOf"][0]["maxProperties"] == Settings().max_profiles
    assert schemas["MatrixModel"]["properties"]["distance"]["maxItems"] == 9
    assert uav["reserve"]["exclusiveMaximum"] == 1.0
