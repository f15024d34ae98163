"""Tables and lists of other people, read by the dashboard as they are found."""

import json
from pathlib import Path

import pytest

from app.api.openapi_examples import example_problem

CASES = Path(__file__).parents[1] / "cases"


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
