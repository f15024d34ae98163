"""Words, zones, wind, matrices and a plan to begin from on the dashboard: kept, written, read, edited."""

import json

import pytest
from page_modules import run_module

from app.api.application import create_application
from app.api.problem_models import ProblemModel
from app.settings import Settings

SQUARE = [[0, 1], [1, 1], [1, 2], [0, 2]]
PROBLEM = {
    "crs": "local",
    "max_steps": 4,
    "objective": {"half_life": 3, "minimum_share": 0.5, "minimum_weight": 2, "change_weight": 0.1},
    "materials": [{"name": "water", "weight": 1.5}, {"name": "=food"}],
    "no_fly_zones": [
        {"id": "airport", "polygon": SQUARE, "name": "Airport", "properties": {"k": [1]}},
        {"id": "zone-2", "polygon": SQUARE[:3]},
    ],
    "wind": {"speed": 2, "towards": 90},
    "start_plan": [[0, 2], [1, 2]],
    "uavs": [
        {
            "id": "u", "x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [5, 1], "endurance": 3,
            "airborne": 0.5, "reserve": 0.25, "available_from": 1, "available_until": 9, "capacity": 40,
            "skills": ["medic", "night flight"], "excluded": ["b; c"], "committed": ["a"], "name": "Kestrel",
            "properties": {"key": [1, {"a": None}]},
        },
        {"id": "v", "x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [5, 1], "skills": []},
    ],
    "targets": [
        {"id": "a", "x": 1, "y": 0, "level": 1, "loadlist": [2, 0], "earliest": 1, "skills": ["=1+1"],
         "name": "V"},
        {"id": "b; c", "x": 1, "y": 3, "level": 1, "loadlist": [2, 0]},
    ],
}  # fmt: skip
ON_LEGS = {
    "crs": "local",
    "matrices": {"road": {"distance": [[0, None], [2.5, 0]], "duration": [[0, 1], [3, 0]]}},
    "uavs": [{**PROBLEM["uavs"][1], "location": 0, "home_location": 1, "profile": "road"}],
    "targets": [{**PROBLEM["targets"][1], "location": 1}],
}
PRESENT = {
    "crs": "local", "max_steps": 7, "wind": {"speed": 9, "towards": 0}, "start_plan": [[0]],
    "no_fly_zones": [{"polygon": SQUARE}], "materials": [{"name": "old"}], "uavs": [], "targets": [],
}  # fmt: skip
FIELDS = """
    const { fieldsOf } = await load("schema.js");
    const formats = await load("formats.js");
    const fields = fieldsOf(given.openapi);
    const read = (text) => {
        try {
            return formats.read(new TextEncoder().encode(text), given.present, fields);
        } catch (error) {
            if (!(error instanceof formats.FormatError)) throw error;
            return { refused: error.message };
        }
    };
"""


@pytest.fixture(scope="module")
def openapi(tmp_path_factory):
    return create_application(Settings(data_dir=tmp_path_factory.mktemp("described"))).openapi()


def run(openapi, code, **given):
    return run_module(FIELDS + code, {"openapi": openapi, "present": PRESENT, **given})


@pytest.mark.parametrize("problem", [PROBLEM, ON_LEGS])
def test_every_format_has_all_of_it(openapi, problem):
    code = """
        return ["toJson", "toCsv", "toGeoJson"].map((write) => {
            const text = formats[write](given.problem, fields);
            return [text, read(text)];
        });
    """
    ProblemModel.model_validate(problem)
    for _, again in run(openapi, code, problem=problem):
        assert again["notices"] == []
        assert {name: value for name, value in again["problem"].items() if value != {}} == problem


def test_words_of_a_table_stand_between_semicolons(openapi):
    text = run(openapi, "return formats.toCsv(given.problem, fields);", problem=PROBLEM)
    uav = text.splitlines()[2]
    assert '"medic; night flight"' in uav
    assert '"[""b; c""]"' in uav
    # A single word that a spreadsheet would take for a formula.
    assert "'=1+1" in text.splitlines()[4]
    head = "kind,id,x,y,level,load_1,skills\n"
    cells = ["medic;night", " medic ;; night ; ", '["medic","night"]', "medic", "[1]", "[medic"]
    files = [
        f"{head}area,a,0,0,1,1,{chr(34)}{cell.replace(chr(34), chr(34) * 2)}{chr(34)}\n" for cell in cells
    ]
    found = run(openapi, "return given.files.map(read);", files=files)
    assert [each["problem"]["targets"][0]["skills"] for each in found[:4]] == [
        *[["medic", "night"]] * 3,
        ["medic"],
    ]
    assert [each["refused"] for each in found[4:]] == [
        "line 2: `skills` is no list of words: [1]",
        "line 2: `skills` is no list of words: [medic",
    ]


def test_what_belongs_to_items_does_not_stay_when_a_file_has_none_of_it(openapi):
    table = "kind,id,x_s,y_s,speed,voyage,x,y,level,load_1\nuav,u,0,0,1,9,,,,1\narea,a,,,,,1,1,1,1\n"
    point = {"type": "Feature", "id": "a", "geometry": {"type": "Point", "coordinates": [1, 1]},
             "properties": {"kind": "area", "level": 1, "loadlist": [1]}}  # fmt: skip
    found = run(
        openapi,
        "return given.files.map(read);",
        files=[table, json.dumps({"type": "FeatureCollection", "features": [point]})],
    )
    for each in found:
        assert each["problem"]["wind"] == PRESENT["wind"]
        assert each["problem"]["max_steps"] == 7
        assert not {"start_plan", "no_fly_zones", "materials"} & each["problem"].keys()


def zone(geometry, **properties):
    return {"type": "Feature", "geometry": geometry, "properties": {"kind": "zone", **properties}}


def test_zones_are_polygons_of_a_map(openapi):
    ring = [*SQUARE, SQUARE[0]]
    text = run(openapi, "return formats.toGeoJson(given.problem, fields);", problem=PROBLEM)
    features = [each for each in json.loads(text)["features"] if each["properties"]["kind"] == "zone"]
    assert features[0] == {
        "type": "Feature",
        "id": "airport",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": {"kind": "zone", "name": "Airport", "properties": {"k": [1]}},
    }
    assert "no_fly_zones" not in json.loads(text)["settings"]
    given = [
        zone({"type": "Polygon", "coordinates": [ring]}, name="Airport"),
        zone({"type": "Polygon", "coordinates": [ring, ring]}),
        zone({"type": "MultiPolygon", "coordinates": [[ring]]}),
        zone({"type": "Point", "coordinates": [0, 1]}),
        zone({"type": "Polygon", "coordinates": [[[0, 0], [181, 0], [1, 1]]]}),
    ]
    files = [json.dumps({"type": "FeatureCollection", "features": [each]}) for each in given]
    taken, *refused = run(openapi, "return given.files.map(read);", files=files)
    assert taken["problem"]["no_fly_zones"] == [{"id": "zone-1", "name": "Airport", "polygon": SQUARE}]
    assert [each["refused"] for each in refused] == [
        "feature 1 has 1 hole: a zone has none",
        "feature 1 is a MultiPolygon: a zone is one Polygon",
        "feature 1 is a Point: a zone is one Polygon",
        "feature 1 is at 181, 0: these are no degrees of longitude and latitude",
    ]


def test_what_refers_to_an_item_follows_it(openapi):
    code = """
        const { withAdded, withRemoved, withRenamed } = await load("references.js");
        return [
            withRenamed(given.problem, fields, "targets", "a", "new"),
            withRenamed(given.problem, fields, "uavs", "a", "new"),
            withRemoved(given.problem, fields, "targets", 0),
            withRemoved(given.problem, fields, "targets", 1),
            withRemoved(given.problem, fields, "uavs", 0),
            withAdded(given.problem, "targets", { id: "c" }),
            withAdded(given.problem, "uavs", { id: "w" }),
        ];
    """
    renamed, other, first, second, grounded, area, uav = run(openapi, code, problem=PROBLEM)
    assert renamed["uavs"][0]["committed"] == ["new"]
    assert other["uavs"] == PROBLEM["uavs"]
    assert (first["uavs"][0]["committed"], first["uavs"][0]["excluded"]) == ([], ["b; c"])
    assert first["start_plan"] == [[1, 1], [0, 1]]
    assert second["uavs"][0]["excluded"] == []
    assert second["start_plan"] == [[0, 1], [1, 1]]
    assert grounded["start_plan"] == [[2], [2]]
    assert area["start_plan"] == [[0, 3], [1, 3]]
    assert uav["start_plan"] == [[0, 2, 2], [1, 2, 2]]
    assert len(area["targets"]) == len(uav["uavs"]) == 3
