"""Lists of places as people have them: which column is which, what they make, and what is refused."""

import base64
import json

import pytest
from page_files import PRESENT
from page_modules import run_module
from page_texts import LANGUAGES, translations

_MAKE = """
    const { fieldsOf } = await load("schema.js");
    const { readList, FormatError } = await load("formats.js");
    const places = await load("formats/places.js");
    const { withItems } = await load("importing.js");
    const fields = fieldsOf(given.openapi);
    return given.lists.map(({ bytes, how, crs, present, otherwise }) => {
        const sheet = readList(Uint8Array.from(Buffer.from(bytes, "base64")));
        if (!sheet) return null;
        const kind = places.kindOf(sheet);
        const before = how === "new" ? [] : (present.materials ?? []).map(({ name }) => name);
        const assigned = places.guess(sheet, places.choices(fields, kind, 6, true), before);
        const materials = places.materialsOf(sheet, assigned, before);
        const globe = places.degreesLikely(sheet, assigned);
        const known = places.choices(fields, kind, 6, globe, materials);
        const { items, faults } = places.itemsOf(sheet, assigned, known, otherwise);
        const made = withItems(present, fields, kind, items, { how, crs, materials });
        const right = places.rightRow(sheet, assigned);
        const left = places.leftOut(sheet, assigned);
        return { kind, assigned, globe, faults, ...made, right, left, told: sheet.notices };
    });
"""


@pytest.fixture
def make(openapi):
    """What the page makes of a list, as it is proposed, by default added to nothing; None: it is no list."""

    def made(*lists, how="new", crs="wgs84", present=PRESENT, otherwise=None):
        filled = {"level": 1, "loadlist/0": 5} if otherwise is None else otherwise
        given = [
            {
                "bytes": base64.b64encode(each if isinstance(each, bytes) else each.encode()).decode(),
                "how": how,
                "crs": crs,
                "present": present,
                "otherwise": filled,
            }
            for each in lists
        ]
        found = run_module(_MAKE, {"openapi": openapi, "lists": given})
        return found[0] if len(found) == 1 else found

    return made


DONDO = {"id": "area-1", "name": "Dondo", "x": 34.74, "y": -19.61, "level": 1, "loadlist": [20]}
BUZI = {"id": "area-2", "name": "Búzi", "x": 34.6, "y": -19.88, "level": 1, "loadlist": [5]}
LISTS = {
    "English": "name,lat,lon,need\nDondo,-19.61,34.74,20\nBúzi,-19.88,34.6,5\n",
    "French": "Lieu;Latitude;Longitude;Besoin (kg)\nDondo;-19,61;34,74;20\nBúzi;-19,88;34,6;5\n",
    "Portuguese": "Aldeia\tLatitude\tLongitude\tCarga\nDondo\t-19,61\t34,74\t20\nBúzi\t-19,88\t34,6\t5",
    "Spanish": "cantidad|longitud|latitud|nombre\n20|34.74|-19.61|Dondo\n5|34.6|-19.88|Búzi",
    "no names, semicolons": "Dondo;-19,61;34,74;20\nBúzi;-19,88;34,6;5\n",
    "no names, commas": "Dondo,-19.61,34.74,20\nBúzi,-19.88,34.6,5\n",
    "unknown names": "Q,N,E,need\nDondo,-19.61,34.74,20\nBúzi,-19.88,34.6,5\n",
    "tags": "name,lat,lon,need\n#loc,#geo+lat,#geo+lon,#need\nDondo,-19.61,34.74,20\nBúzi,-19.88,34.6,5",
    "Windows-1252": "nome;lat;lon;carga\nDondo;-19,61;34,74;20\nBúzi;-19,88;34,6;5\n".encode("cp1252"),
    "minus signs": "name,lat,lon,need\nDondo,−19.61,34.74,20\nBúzi,−19.88,34.6,5\n",
}  # fmt: skip


def test_lists_of_four_languages_are_read_without_a_hand(make):
    found = dict(zip(LISTS, make(*LISTS.values()), strict=True))
    assert {name: each["faults"] for name, each in found.items() if each["faults"]} == {}
    for each in found.values():
        assert each["problem"]["targets"] == [DONDO, BUZI]
        assert (each["kind"], each["globe"], each["problem"]["crs"]) == ("targets", True, "wgs84")


def test_points_without_a_kind_are_a_list_and_polygons_their_middle(make):
    point = {"type": "Point", "coordinates": [34, -19]}
    square = [[[34, -20], [36, -20], [36, -18], [34, -18], [34, -20]]]
    features = [
        {"properties": {"NAME": "A", "besoin": 3, "photo": 0}, "geometry": point},
        {"properties": {"NAME": "B"}, "geometry": {"type": "Polygon", "coordinates": square}},
        {"properties": {"NAME": "C"}, "geometry": None},
    ]  # fmt: skip
    found = make(json.dumps({"type": "FeatureCollection", "features": features}))
    assert [(t["name"], t["x"], t["y"], t["loadlist"]) for t in found["problem"]["targets"]] == [
        ("A", 34, -19, [3]),
        ("B", 35, -19, [5]),
    ]
    assert found["told"] == [
        "feature 2 (B) is a Polygon: its middle was taken",
        "feature 3 (C) has no geometry and was left out",
    ]


def test_a_list_of_uavs_is_told_by_its_columns(make):
    found = make(
        "drone;vitesse;autonomie;longitude;latitude;charge 1;charge 2\nA;100;150;34,7;-19,6;2;3\n",
        otherwise={},
    )
    assert found["problem"]["uavs"] == [
        {
            "id": "uav-1",
            "name": "A",
            "speed": 100,
            "voyage": 150,
            "x_s": 34.7,
            "y_s": -19.6,
            "loadlist": [2, 3],
        }
    ]


@pytest.mark.parametrize(
    ("text", "globe"),
    [
        ("name,x,y\nA,300,20", False),
        ("name,x,y\nA,30,20", True),
        ("A,300,20", False),
        ("name,lat,lon\nA,300,20", True),
    ],
)
def test_degrees_are_told_by_names_and_values(make, text, globe):
    assert make(text)["globe"] is globe


def test_faults_name_the_line_and_the_column_and_show_a_right_row(make):
    found = make("name;lat;lon;need\nA;1,5;2,5;3\nB;95;3;4\nC;;3;4\nD;1;east;4\nE;1;2;-3\nF;1.5;2;3\n")
    assert found["faults"] == [
        "line 3: `latitude (lat)` is 95: it has to be from \u221290 to 90",
        "line 4: `latitude` is empty",
        "line 5: `longitude (lon)` is no number: east",
        "line 6: `need 1 (need)` is -3: it has to be at least 0",
        "line 7: `latitude (lat)` is ambiguous: line 2 has a decimal comma, 1,5: 1.5",
    ]
    assert [target["name"] for target in found["problem"]["targets"]] == ["A"]
    assert found["right"] == "Dondo;-19,61;34,74;20"


def test_a_list_without_places_says_which_column_is_missing(make):
    assert make("name,need\nA,3")["faults"] == ["No column is longitude, latitude: choose it above"]


def test_what_is_a_problem_or_no_list_is_none(make):
    problem = "kind,id,x,y,level,load_1\narea,a,1,2,3,4\n"
    points = {"type": "FeatureCollection", "features": [{"properties": {"kind": "area"}, "geometry": None}]}
    assert (
        make(problem, "just words", "a,b\nc,d", "", json.dumps(points), '{"uavs": [], "targets": []}')
        == [None] * 6
    )


PRESENT_2 = {
    "crs": "wgs84",
    "uavs": [{"id": "u", "x_s": 1, "y_s": 1, "speed": 1, "voyage": 9, "loadlist": [4, 4], "excluded": ["a"]}],
    "targets": [{"id": "a", "x": 1, "y": 2, "level": 1, "loadlist": [1, 1]}],
    "start_plan": [[0], [1]],
}


def test_items_are_added_to_what_is_there_with_ids_of_their_own(make):
    found = make("id,lat,lon,need\na,3,4,7\nb,5,6,8\n", how="add", present=PRESENT_2)
    targets = found["problem"]["targets"]
    assert [(each["id"], each["loadlist"]) for each in targets] == [
        ("a", [1, 1]),
        ("a (2)", [7, 0]),
        ("b", [8, 0]),
    ]
    # Going home is the number after all areas.
    assert found["problem"]["start_plan"] == [[0], [3]]
    assert found["problem"]["uavs"] == PRESENT_2["uavs"]
    assert found["notices"] == ["1 area has an id that stood before and was numbered: a (2)"]


def test_items_take_the_place_of_those_of_their_kind(make):
    found = make("id,lat,lon,need 1,need 2,need 3\nb,5,6,8,0,1\n", how="replace", present=PRESENT_2)
    assert found["problem"]["targets"] == [{"id": "b", "x": 6, "y": 5, "level": 1, "loadlist": [8, 0, 1]}]
    (uav,) = found["problem"]["uavs"]
    assert (uav["loadlist"], uav["excluded"]) == ([4, 4, 0], [])


@pytest.mark.parametrize("language", ["en", *(path.stem for path in LANGUAGES)])
def test_the_templates_of_each_language_are_read_as_they_are(make, language):
    texts = run_module(
        """
        globalThis.document = { addEventListener() {} };
        (await load("texts.js")).speak(given.language, given.texts);
        const { templateOf } = await load("import_dialog.js");
        return ["targets", "uavs", "bases"].map(templateOf);
        """,
        {"language": language, "texts": translations(language) if language != "en" else {}},
    )
    areas, uavs, bases = make(*texts)
    assert [each["faults"] for each in (areas, uavs, bases)] == [[], [], []]
    assert [each["kind"] for each in (areas, uavs, bases)] == ["targets", "uavs", "bases"]
    assert areas["problem"]["targets"][1]["deadline"] == 3
    assert uavs["problem"]["uavs"][0]["voyage"] == 150
    assert bases["problem"]["bases"][0]["stock"] == [500]


URGENCY = {"level": 1}
VILLAGES = (
    "village,lat,lon,priority,deadline (h),water,food,medicine\n"
    "Barpak,28.205,84.742,3,1.0,10,8,4\nLaprak,28.222,84.799,3,,8,,2\n"
)
FLEET = "drone,lat,lon,speed,range,load medicine,charge en eau,Food (kg)\nA,28,84.6,50,90,1,2,3\n"


def named(problem):
    return [each.get("name") for each in problem.get("materials", [])]


def test_columns_of_numbers_that_nothing_else_claims_are_needs_with_their_names(make):
    found = make(VILLAGES, otherwise=URGENCY)
    assert found["faults"] == []
    targets = found["problem"]["targets"]
    assert [each["loadlist"] for each in targets] == [[10, 8, 4], [8, 0, 2]]
    assert [each.get("deadline") for each in targets] == [1, None]
    assert (named(found["problem"]), found["left"]) == (["water", "food", "medicine"], [])


def test_materials_of_a_second_list_are_found_by_their_names_in_whatever_order(make):
    present = make(VILLAGES, otherwise=URGENCY)["problem"] | {"uavs": []}
    present["materials"][0]["name"] = "Eau"
    found = make(FLEET, how="add", present=present, otherwise={})
    assert found["problem"]["uavs"][0]["loadlist"] == [2, 3, 1]
    assert named(found["problem"]) == ["Eau", "food", "medicine"]
    # A material that nothing had is one more, which the areas do not need.
    more = make(FLEET.replace("Food", "tents"), how="add", present=present, otherwise={})["problem"]
    assert more["uavs"][0]["loadlist"] == [2, 0, 1, 3]
    assert named(more) == ["Eau", "food", "medicine", "tents"]
    assert more["targets"][0]["loadlist"] == [10, 8, 4, 0]


def test_materials_without_names_take_those_of_the_columns_and_keep_their_weights(make):
    present = PRESENT_2 | {"materials": [{"weight": 2}, {"name": "food"}]}
    found = make(
        "name,lat,lon,need food,need water\nA,1,2,5,6\n", how="add", present=present, otherwise=URGENCY
    )
    assert found["problem"]["materials"] == [{"name": "water", "weight": 2}, {"name": "food"}]
    assert found["problem"]["targets"][1]["loadlist"] == [6, 5]


@pytest.mark.parametrize(
    ("columns", "left"),
    [
        ("need,population", ["population"]),
        ("need,households left", ["households left"]),
        ("water,phone", ["phone"]),
        ("water,no", ["no"]),
    ],
)
def test_columns_that_are_no_amounts_stay_out_and_are_named(make, columns, left):
    found = make(f"name,lat,lon,{columns},remarks\nA,1.5,2.5,7,12,none\n", otherwise=URGENCY)
    assert found["left"] == [*left, "remarks"]
    assert found["problem"]["targets"][0]["loadlist"] == [7]


def test_columns_of_one_material_keep_what_tells_them_apart(make):
    found = make("name,lat,lon,food (adults),food (children)\nA,1,2,3,4\n", otherwise=URGENCY)
    assert named(found["problem"]) == ["food (adults)", "food (children)"]


def test_a_row_without_any_amount_is_a_fault(make):
    found = make("name,lat,lon,water,food\nA,1,2,3,\nB,1,2,,\n", otherwise=URGENCY)
    assert found["faults"] == ["line 3: `need: water` is empty"]
