"""Maps of other people, read by the dashboard as they are found."""

import json
from pathlib import Path

import pytest

CASES = Path(__file__).parents[1] / "cases"


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


ACROSS = [[179, -17], [-179, -17], [-179, -15], [179, -15], [179, -17]]


def test_the_middle_of_an_area_over_the_antimeridian_lies_in_it(read):
    found = read(collection(feature({"type": "Polygon", "coordinates": [ACROSS]})))["problem"]["targets"]
    assert (abs(found[0]["x"]), found[0]["y"]) == (180, -16)
    plane = {"crs": "local"}
    found = read(collection(feature({"type": "Polygon", "coordinates": [ACROSS]}), settings=plane))
    assert found["problem"]["targets"][0]["x"] == pytest.approx(0)


@pytest.mark.parametrize(
    ("geometry", "says"),
    [
        ({"type": "MultiPolygon", "coordinates": 5}, "feature 1 is an empty MultiPolygon"),
        ({"type": "Polygon", "coordinates": "ring"}, "feature 1 is an empty Polygon"),
        ({"type": ["Point"]}, 'feature 1 is a ["Point"]: a UAV, an area or a base is one point'),
        ({}, "feature 1 is a null: a UAV, an area or a base is one point"),
    ],
)
def test_geometries_that_are_none_are_refused_and_what_is_no_name_names_nothing(read, geometry, says):
    assert read(collection(feature(geometry, properties={"id": {}, "name": {"en": "A"}})))["refused"] == says


def test_xml_is_told_from_a_table(read):
    says = "this is XML, as KML, GPX and web pages are: save it as GeoJSON or CSV"
    for text in ('<?xml version="1.0"?><kml></kml>', '\n<gpx version="1.1"></gpx>', "<!DOCTYPE html>"):
        assert read(text) == {"refused": says}
