"""Files of the dashboard: what goes out comes back the same; other people's are read as they are found."""

import base64
import json
import random
import string
from pathlib import Path

import pytest
from page_modules import run_module

from app.api.application import create_application
from app.api.openapi_examples import example_problem
from app.settings import Settings

CASES = Path(__file__).parents[1] / "cases"
READ = """
    const { fieldsOf } = await load("schema.js");
    const formats = await load("formats.js");
    const fields = fieldsOf(given.openapi);
    return given.files.map((file) => {
        try {
            return formats.read(Uint8Array.from(Buffer.from(file, "base64")), given.present, fields);
        } catch (error) {
            if (!(error instanceof formats.FormatError)) throw error;
            return { refused: error.message };
        }
    });
"""
AGAIN = """
    const { fieldsOf } = await load("schema.js");
    const formats = await load("formats.js");
    const fields = fieldsOf(given.openapi);
    return given.problems.map((problem) => ["toJson", "toCsv", "toGeoJson"].map((write) => {
        const text = formats[write](problem, fields);
        return formats.read(new TextEncoder().encode(text), given.present, fields);
    }));
"""
PRESENT = {"max_steps": 7, "crs": "local", "objective": {"charge_return": True}, "uavs": [], "targets": []}


@pytest.fixture(scope="module")
def openapi(tmp_path_factory):
    return create_application(Settings(data_dir=tmp_path_factory.mktemp("described"))).openapi()


@pytest.fixture
def read(openapi):
    """Reads files as the page does; several at once where there are several."""

    def reading(*files, present=PRESENT):
        contents = [base64.b64encode(f if isinstance(f, bytes) else f.encode()).decode() for f in files]
        found = run_module(READ, {"openapi": openapi, "files": contents, "present": present})
        return found[0] if len(files) == 1 else found

    return reading


class Maker:
    """Makes values of JSON schemas, so that a field that is added later is tried too."""

    SPECIAL = (
        "=1+1",
        "@a",
        "+b",
        "-c",
        "\tt",
        "'=x",
        "''@",
        "'plain",
        "a,b",
        "a;b",
        'q"q',
        " edge ",
        "új 村 ‍",
        "#1",
        "007",
        "1,5",
        "true",
        "|",
        "line\nbreak",
        "﻿mark",
        "[1]",
        "<b>",
        "kind",
        "sep=;",
    )

    def __init__(self, seed, components, materials):
        self.random = random.Random(seed)
        self.components = components
        self.materials = materials
        self.count = 0

    def properties(self, name):
        return self.components[name]["properties"], self.components[name].get("required", [])

    def item(self, name):
        properties, required = self.properties(name)
        kept = {n: s for n, s in properties.items() if n in required or self.random.random() < 0.6}
        return {n: self.value(s, identifier=n == "id") for n, s in kept.items()} | {"id": self.identifier()}

    def identifier(self):
        self.count += 1
        return f"{self.random.choice(self.SPECIAL)}{self.count}{self.random.choice(self.SPECIAL)}"

    def number(self):
        kind = self.random.randrange(5)
        if kind == 0:
            return self.random.randrange(90)
        if kind == 1:
            return self.random.choice([1e-12, 5e-324, 1e9, 0.1 + 0.2, 1 / 3])
        return self.random.uniform(0, 90)

    def value(self, schema, identifier=False):
        if "anyOf" in schema:
            schema = next(each for each in schema["anyOf"] if each.get("type") != "null")
        if "$ref" in schema:
            schema = self.components[schema["$ref"].rsplit("/", 1)[1]]
        if "enum" in schema:
            return self.random.choice(schema["enum"])
        match schema.get("type"):
            case "number":
                return self.number()
            case "integer":
                return self.random.randrange(int(schema.get("maximum", 9)) + 1)
            case "boolean":
                return self.random.random() < 0.5
            case "string":
                return self.random.choice(self.SPECIAL) + self.random.choice(string.ascii_letters)
            case "array" if schema["items"].get("type") == "number":
                return [self.number() for _ in range(self.materials)]
            case "array":
                return [self.value(schema["items"]) for _ in range(self.random.randrange(3))]
            case "object":
                return {
                    name: self.value(each)
                    for name, each in schema.get("properties", {}).items()
                    if name in schema.get("required", []) or self.random.random() < 0.7
                }
        raise AssertionError(f"no value is known for {schema}")

    def problem(self):
        properties, _ = self.properties("ProblemModel")
        settings = {
            name: self.value(schema)
            for name, schema in properties.items()
            if name not in ("uavs", "targets") and self.random.random() < 0.7
        }
        uavs = [self.item("UAVModel") for _ in range(self.random.randrange(1, 5))]
        return settings | {"uavs": uavs, "targets": [self.item("TargetModel") for _ in range(4)]}


def meaning(problem):
    """A problem without settings that are not set, its zones and bases with the ids that they get."""
    given = {name: value for name, value in problem.items() if value != {}}
    for name, stem in (("no_fly_zones", "zone"), ("bases", "base")):
        if name in given:
            given[name] = [{"id": f"{stem}-{at}", **item} for at, item in enumerate(given[name], 1)]
    # No bases are none, whether a file says so or not.
    return {name: value for name, value in given.items() if name != "bases" or value}


def test_whatever_goes_out_comes_back_the_same(openapi):
    components = openapi["components"]["schemas"]
    problems = [Maker(seed, components, seed % 4 + 1).problem() for seed in range(60)]
    fields = {name for problem in problems for item in problem["targets"] for name in item}
    assert fields == set(components["TargetModel"]["properties"])

    found = run_module(AGAIN, {"openapi": openapi, "problems": problems, "present": PRESENT})

    for problem, (as_json, as_csv, as_geojson) in zip(problems, found, strict=True):
        for again in (as_json, as_csv):
            assert again["notices"] == []
        assert meaning(as_json["problem"]) == meaning(problem)
        # What is not set stays as it is on screen where a file cannot say so; CSV says it.
        assert meaning(as_csv["problem"]) == meaning(problem)
        assert meaning(as_geojson["problem"]) == {"crs": "local", **meaning(problem)}


def test_a_planned_problem_stays_planned(openapi):
    problem = json.loads((CASES / "F10-planned-lost-by-csv.json").read_text())
    found = run_module(AGAIN, {"openapi": openapi, "problems": [problem], "present": PRESENT})[0]
    assert [each["problem"]["objective"]["unloading"] for each in found] == ["planned"] * 3


def test_an_empty_cell_is_no_load_at_its_place(read):
    problem = read((CASES / "F8-import-sparse.csv").read_bytes())["problem"]
    assert problem["uavs"][0]["loadlist"] == [0, 7]
    assert [target["loadlist"] for target in problem["targets"]] == [[3, 0], [0, 5]]


def test_loads_are_told_by_the_names_of_their_columns(read):
    problem = read((CASES / "F9-import-column-order.csv").read_bytes())["problem"]
    assert problem["uavs"][0]["loadlist"] == [8, 7]
    assert problem["targets"][0]["loadlist"] == [4, 3]


def test_a_file_of_semicolons_and_decimal_commas_is_read(read):
    found = read((CASES / "O8-import-semicolon.csv").read_bytes())
    assert (found["problem"]["uavs"][0]["x_s"], found["problem"]["uavs"][0]["y_s"]) == (34.8354, -19.8185)
    assert found["problem"]["targets"][0]["x"] == 34.75
    assert found["notices"] == ["Decimal commas were read: 34,8354 as 34.8354"]


HEAD = "kind,id,x_s,y_s,speed,voyage,x,y,level,load_1"
ROWS = ("uav,u1,0,0,1,10,,,,7", "area,Port-à-Piment,,,,,1.5,0,1,3")
PLAIN = "\r\n".join((HEAD, *ROWS)) + "\r\n"
AS_FOUND = {
    "mark": PLAIN.encode("utf-8-sig"),
    "utf-16 with a mark": PLAIN.encode("utf-16"),
    "utf-16 big end": b"\xfe\xff" + PLAIN.encode("utf-16-be"),
    "utf-16 without a mark": PLAIN.encode("utf-16-le"),
    "old mac": PLAIN.replace("\r\n", "\r").encode(),
    "unix": PLAIN.replace("\r\n", "\n").encode(),
    "no last line end": PLAIN.rstrip().encode(),
    "sep": b"sep=,\r\n" + PLAIN.encode(),
    "sep semicolon": b"sep=;\r\n" + PLAIN.replace(",", ";").encode(),
    "semicolons": PLAIN.replace(",", ";").encode(),
    "tabs": PLAIN.replace(",", "\t").encode(),
    "capitals": PLAIN.replace(HEAD, HEAD.upper()).replace("uav,", "UAV,").replace("area,", "Area,").encode(),
    "hxl": PLAIN.replace(
        HEAD, HEAD + "\r\n#meta+kind,#loc+name,#geo+lon,,,,#geo+lon,#geo+lat,#severity,#need"
    ).encode(),
    "blank lines": ("\r\n,,,,,,,,,\r\n" + PLAIN.replace("\r\narea", "\r\n\r\narea")).encode(),
    "quotes": PLAIN.replace("u1", '"u1"').replace("1.5", '"1.5"').encode(),
    "spaces": PLAIN.replace(",", " , ").encode(),
}


def test_tables_are_read_as_programs_write_them(read):
    plain, *found = read(PLAIN, *AS_FOUND.values())
    assert plain["problem"]["targets"][0] == {
        "id": "Port-à-Piment",
        "x": 1.5,
        "y": 0,
        "level": 1,
        "loadlist": [3],
    }
    assert dict(zip(AS_FOUND, found, strict=True)) == dict.fromkeys(AS_FOUND, plain)


def test_another_code_page_is_read_and_said(read):
    found = read(PLAIN.encode("cp1252"))
    assert found["problem"] == read(PLAIN)["problem"]
    assert found["notices"] == ["It is not UTF-8 and was read as Windows-1252: check the names"]


def csv(*rows, head=HEAD):
    return "\n".join((head, *rows)) + "\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (csv("uav,u1,0,zero,1,10,,,,7"), "line 2: `y_s` is no number: zero"),
        (csv("", "", "uav,u1,0,0x10,1,10,,,,7"), "line 4: `y_s` is no number: 0x10"),
        (csv('uav,"a\nb",0,0,1,10,,,,7', "uav,c,0,,1,1e999,,,,7"), "line 4: `voyage` is no number: 1e999"),
        (
            csv('uav,u1,"34,8",0,1,10,,,,7'),
            "line 2: `x_s` has a decimal comma, in a file with commas between the cells: 34,8",
        ),
        (
            csv("uav;u1;1.5;0;1;10;;;;7,5", head=HEAD.replace(",", ";")),
            "line 2: `load_1` is ambiguous: line 2 has a decimal point, 1.5: 7,5",
        ),
        (
            csv("uav;u1;1.234,5;0;1;10;;;;7", head=HEAD.replace(",", ";")),
            "line 2: `x_s` is no number: 1.234,5",
        ),
        (csv('uav,u1,0,0,1,10,,,"7'), "line 2: a quote is out of place"),
        (csv("uav,u1,0,0,1,10,,,,7,8"), "line 2: it has 11 cells for 10 columns"),
        (csv("plane,u1,0,0,1,10,,,,7"), "line 2: `kind` is neither uav, area, base nor problem: plane"),
        (csv("uav,u1,0,0,1,,,,,7"), "UAV u1 has no `voyage`"),
        (
            "name,lat,lon\na,1,2\n",
            "line 1: it has to name the columns, and `kind` is not among them (found: name, lat, lon)",
        ),
        ("", "it is empty"),
        (csv(head=HEAD + ",load_1"), "line 1: two columns are named `load_1`"),
        (
            csv("uav,u1,0,0,1,10,,,,7,1", head=HEAD + ",load_3"),
            "line 2: there is no column `load_2`, but one after it",
        ),
        (
            csv("problem,,,,,,,,,,maybe", head=HEAD + ",return_to_base"),
            "line 2: `return_to_base` is neither true nor false: maybe",
        ),
        (
            csv("problem,,,,,,,,,,mercator", head=HEAD + ",crs"),
            "line 2: `crs` is none of local, wgs84: mercator",
        ),
        (csv("problem,,,,,,,,,", "problem,,,,,,,,,"), "line 3: the settings stand in line 2 already"),
        (b"PK\x03\x04\x00\x00\x00\x00\x00\x00", "this is no text in UTF-8, UTF-16 or Windows-1252"),
        ('{"uavs": [], "targets": {}}', "it has no lists `uavs` and `targets`, and is no FeatureCollection"),
        ("[1, 2]", "it has no lists `uavs` and `targets`, and is no FeatureCollection"),
        (json.dumps({"uavs": [7], "targets": []}), "UAV 1 is no object"),
        (
            json.dumps({"uavs": [], "targets": [{"id": "a", "x": 0, "y": "1", "level": 1, "loadlist": [1]}]}),
            'area a: `y` is "1", a number is needed',
        ),
        (
            json.dumps({"uavs": [], "targets": [{"x": 0, "y": 1, "level": 1, "loadlist": [1, None]}]}),
            "area 1: `loadlist` is [1,null], a list of numbers is needed",
        ),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(read, content, message):
    assert read(content) == {"refused": message}


def test_columns_and_fields_that_are_none_are_left_out_and_said(read):
    table, problem = read(
        csv("uav,u1,0,0,1,10,,,,7,heavy", head=HEAD + ",remark"),
        json.dumps({**example_problem("paper-5x10"), "algorithm": "ga", "seed": 1, "note": "x"}),
    )
    assert table["notices"] == ["Columns that are no fields of a problem were left out: remark"]
    assert problem["notices"] == ["Fields that the service does not know were left out: note"]
    assert "note" not in problem["problem"]


def test_texts_are_no_formulas_in_a_table_and_come_back(openapi):
    problem = json.loads((CASES / "O3-csv-formulas.json").read_text())
    code = """
        const { fieldsOf } = await load("schema.js");
        return (await load("formats.js")).toCsv(given.problem, fieldsOf(given.openapi));
    """
    written = run_module(code, {"problem": problem, "openapi": openapi})
    assert '''"'=HYPERLINK(""http://x"",""y"")"''' in written
    assert "'@SUM(1+1)*cmd|" in written
    found = run_module(AGAIN, {"openapi": openapi, "problems": [problem], "present": PRESENT})[0]
    for again in found:
        assert [each["id"] for each in again["problem"]["targets"]] == [
            each["id"] for each in problem["targets"]
        ]


def test_names_that_repeat_are_numbered_and_said(read):
    given = json.loads((CASES / "O5-names-repeat-dhangadi.json").read_text())
    given["targets"].append({**given["targets"][-1], "id": "Shiva Mandir (2)"})
    names = [target["id"] for target in given["targets"]]
    assert names.count("Shiva Mandir") == 3

    found = read(json.dumps(given))

    ids = [target["id"] for target in found["problem"]["targets"]]
    assert len(set(ids)) == len(ids)
    renamed = [new for old, new in zip(names, ids, strict=True) if old != new]
    assert renamed == ["Shiva Mandir (3)", "Shiva Mandir (4)"]
    assert found["notices"] == [
        "2 areas have ids that stood before and were numbered: Shiva Mandir (3), Shiva Mandir (4)"
    ]


def test_a_name_of_full_length_is_numbered_within_its_length(read):
    area = {"id": "x" * 100, "x": 0, "y": 0, "level": 1, "loadlist": [1]}
    ids = [
        target["id"]
        for target in read(json.dumps({"uavs": [], "targets": [area, area]}))["problem"]["targets"]
    ]
    assert ids == ["x" * 100, "x" * 96 + " (2)"]


def test_items_without_ids_get_free_ones(read):
    area = {"x": 0, "y": 0, "level": 1, "loadlist": [1]}
    found = read(json.dumps({"uavs": [], "targets": [{**area, "id": "area-2"}, area, {**area, "id": 7}]}))
    assert [target["id"] for target in found["problem"]["targets"]] == ["area-2", "area-3", "7"]


def collection(*features, **members):
    return json.dumps({"type": "FeatureCollection", **members, "features": features})


def feature(geometry, **members):
    properties = {"kind": "area", "level": 1, "loadlist": [4], **members.pop("properties", {})}
    return {"type": "Feature", "geometry": geometry, "properties": properties, **members}


def point(*place):
    return {"type": "Point", "coordinates": place}


SQUARE = [[10, 0], [12, 0], [12, 2], [10, 2], [10, 0]]


def test_a_map_of_evacuation_centres_is_read(read):
    found = read((CASES / "O7-import-bipad-evaccentre.geojson").read_bytes())
    assert found["problem"]["targets"] == [
        {"id": "area-1", "x": 80.5805463, "y": 28.7092336, "level": 1, "loadlist": [4]}
    ]
    assert found["problem"]["crs"] == "wgs84"
    assert found["notices"] == [
        "feature 2 has no geometry and was left out",
        "Attributes that are no fields of a problem were left out: Type, Name, Longitude, Latitude",
    ]


def test_features_are_read_as_they_are_found(read):
    found = read(
        collection(
            feature(point(1, 2, 300), id=None),
            feature(point(1, 2), properties={"id": 7}),
            feature(point(1, 2), id=8),
            feature(
                {"type": "MultiPoint", "coordinates": [[3, 4]]},
                properties={"loadlist": "[ 4.0 ]", "deadline": None},
            ),
            feature({"type": "Polygon", "coordinates": [SQUARE]}, id="school"),
            feature({"type": "MultiPolygon", "coordinates": [[[[0, 0], [1, 0], [0, 1], [0, 0]]], [SQUARE]]}),
            feature(
                point(5, 6),
                properties={
                    "kind": "UAV",
                    "speed": 1,
                    "voyage": 9,
                    "x_s": 0,
                    "y_s": 0,
                    "x_c": 1,
                    "y_c": 1,
                    "level": None,
                },
            ),
            feature(point(5, 6), properties={"kind": "uav", "speed": 1, "voyage": 9, "x_s": 0, "y_s": 0}),
            crs={"type": "name", "properties": {"name": "EPSG:4326"}},
        )
    )
    targets = found["problem"]["targets"]
    assert [target["id"] for target in targets] == ["area-1", "7", "8", "area-4", "school", "area-6"]
    assert [(target["x"], target["y"]) for target in targets] == [(1, 2)] * 3 + [(3, 4), (11, 1), (11, 1)]
    assert targets[3] == {"id": "area-4", "x": 3, "y": 4, "level": 1, "loadlist": [4]}
    flying, waiting = found["problem"]["uavs"]
    assert (flying["x_s"], flying["x_c"], flying["y_c"]) == (0, 5, 6)
    assert (waiting["x_s"], waiting["y_s"], "x_c" in waiting) == (5, 6, False)
    assert found["notices"] == [
        "feature 5 (school) is a Polygon: its middle was taken",
        "feature 6 is a MultiPolygon: its middle was taken",
        "Attributes that are no fields of a problem were left out: level",
    ]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            collection(
                feature(point(1, 2)),
                crs={"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}},
            ),
            "its `crs` is urn:ogc:def:crs:EPSG::3857: "
            "save it with longitude and latitude on WGS 84 (EPSG:4326)",
        ),
        (
            collection(feature(point(8970000, 3340000), id="a")),
            "feature 1 (a) is at 8970000, 3340000: these are no degrees of longitude and latitude",
        ),
        (
            collection(
                feature(point(1, 2)),
                feature({"type": "LineString", "coordinates": [[0, 0], [1, 1]]}, properties={"Name": "road"}),
            ),
            "feature 2 (road) is a LineString: a UAV, an area or a base is one point",
        ),
        (
            collection(feature({"type": "MultiPoint", "coordinates": [[0, 0], [1, 1]]})),
            "feature 1 is a MultiPoint of 2 points: a UAV, an area or a base is one point",
        ),
        (collection(feature(point("1", "2"))), 'feature 1 has coordinates that are no numbers: ["1","2"]'),
        (
            collection(feature(point(1, 2), properties={"kind": "school"}, id="a")),
            "feature 1 (a) has no property `kind` that is uav, area, base or zone",
        ),
        (
            collection(feature(point(1, 2), properties={"level": "high"}, id="a")),
            'area a: `level` is "high", a number is needed',
        ),
        (json.dumps({"type": "FeatureCollection"}), "it has no list `features`"),
    ],
)
def test_a_map_that_cannot_be_read_is_refused_with_its_feature(read, content, message):
    assert read(content) == {"refused": message}


def test_bases_go_out_and_come_back(openapi):
    uav = {"id": "u", "x_s": 1, "y_s": 2, "speed": 3, "voyage": 40, "loadlist": [5, 6]}
    problem = {
        "uavs": [{**uav, "full_load": [7, 8], "bases": ["depot"]}],
        "targets": [{"id": "a", "x": 1, "y": 1, "level": 1, "loadlist": [2, 0]}],
        "bases": [
            {"id": "depot", "x": 3, "y": 4, "stock": [9, 0], "turnaround": 0.5, "name": "=Depot"},
            {"id": "spare", "x": 5, "y": 6},
        ],
        "crs": "local",
    }
    (found,) = run_module(AGAIN, {"openapi": openapi, "problems": [problem], "present": PRESENT})
    for again in found:
        assert again["problem"]["bases"] == problem["bases"]
        assert again["problem"]["uavs"] == problem["uavs"]
        assert again["notices"] == []


def test_a_base_of_a_file_is_checked_and_without_a_stock_it_has_as_much_as_is_asked_for(openapi, read):
    rows = "kind,id,x_s,y_s,speed,voyage,x,y,level,load_1,stock_1\n"
    rows += "uav,u,0,0,1,10,,,,7,\narea,a,,,,,1,1,1,2,\nbase,d,,,,,3,4,,,\nbase,d,,,,,3,5,,,2\n"
    found = read(rows.encode())
    assert found["problem"]["bases"] == [
        {"id": "d", "x": 3, "y": 4},
        {"id": "d (2)", "x": 3, "y": 5, "stock": [2]},
    ]
    assert any("1 base has an id that stood before" in said for said in found["notices"])
    assert "base d has no `y`" in read(rows.replace("3,4,", "3,,").encode())["refused"]
