"""The operator's overlay and the land of the map: what is taken, and how both are served."""

import gzip
import json

import httpx
import pytest
from picture_archive import archive, picture
from starlette.testclient import TestClient

from app.api.application import create_application
from app.api.overlay import MOST_BYTES, read_overlay
from app.settings import Settings

COLLECTION = {"type": "FeatureCollection", "features": []}
LAND = "/dashboard/vendor/world-atlas-2.0.2/land-50m.json.gz"


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ("{", "is no JSON"),
        ('{"type": "FeatureCollection", "features": [NaN]}', "is no JSON"),
        ("[]", "is no GeoJSON with the type FeatureCollection"),
        ('{"type": "Feature"}', "is no GeoJSON with the type FeatureCollection"),
        ('{"type": "FeatureCollection"}', "a list `features`"),
        (json.dumps({**COLLECTION, "crs": {"properties": {"name": "EPSG:32736"}}}), "EPSG:32736"),
        (b"\xff\xfe\x00", "is no JSON"),
        (b" " * (MOST_BYTES + 1), f"at most {MOST_BYTES} are taken"),
    ],
)
def test_what_is_no_overlay_is_refused_with_the_setting_and_the_reason(tmp_path, content, why):
    path = tmp_path / "o.geojson"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ValueError, match=r"ALLOCATOR_OVERLAY_FILE .*o\.geojson") as refused:
        read_overlay(path)
    assert why in str(refused.value)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.geojson"):
        read_overlay(tmp_path / "none.geojson")


@pytest.mark.parametrize("crs", [None, {"properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}])
def test_an_overlay_is_taken_in_degrees(tmp_path, crs):
    path = tmp_path / "o.geojson"
    path.write_text(json.dumps({**COLLECTION, "crs": crs}, indent=2), "utf-8")
    assert json.loads(read_overlay(path)) == {**COLLECTION, "crs": crs}


@pytest.fixture
def asking(tmp_path):
    """Asks a service that is not started: nothing here needs its database."""

    def client(**settings):
        application = create_application(Settings(data_dir=tmp_path, **settings))
        return TestClient(application, base_url="http://localhost")

    return client


def test_the_overlay_needs_a_key_where_others_do(tmp_path, asking):
    path = tmp_path / "o.geojson"
    path.write_text(json.dumps(COLLECTION), "utf-8")
    open_to_all = asking(overlay_file=path, no_keys=True)
    assert open_to_all.get("/dashboard/settings.json").json()["overlay"] == "overlay.geojson"
    answer = open_to_all.get("/overlay.geojson")
    assert (answer.headers["content-type"], answer.json()) == ("application/geo+json", COLLECTION)

    none = asking(no_keys=True)
    assert none.get("/dashboard/settings.json").json()["overlay"] is None
    assert none.get("/overlay.geojson").status_code == httpx.codes.NOT_FOUND


WORLD = archive(picture(200, 0, 0), 2)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (WORLD[:100], "has 100 bytes, and the header alone of PMTiles has 127"),
        (WORLD[:7] + b"\x02" + WORLD[8:], "PMTiles of version 2"),
        (
            archive(b"vectors", 2, tile_type=1),
            "tiles of type 1, which are no pictures: PNG, JPEG, WebP, AVIF",
        ),
        (WORLD[:-1], "it is not complete"),
    ],
)
def test_tiles_that_cannot_be_shown_are_refused_with_the_setting_and_the_reason(
    tmp_path, asking, content, why
):
    path = tmp_path / "o.pmtiles"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"ALLOCATOR_OVERLAY_FILE .*o\.pmtiles") as refused:
        asking(overlay_file=path)
    assert why in str(refused.value)


def test_of_tiles_the_parts_are_sent_that_are_asked_for(tmp_path, asking):
    path = tmp_path / "o.anything"
    path.write_bytes(WORLD)
    client = asking(overlay_file=path, no_keys=True)
    assert client.get("/dashboard/settings.json").json()["overlay"] == "overlay.pmtiles"
    answer = client.get("/overlay.pmtiles", headers={"Range": "bytes=7-12"})
    assert answer.status_code == httpx.codes.PARTIAL_CONTENT
    assert answer.content == WORLD[7:13]
    assert "content-encoding" not in answer.headers
    assert answer.headers["etag"]
    assert client.get("/overlay.geojson").status_code == httpx.codes.NOT_FOUND


def test_land_is_sent_as_it_lies_compressed_and_is_kept_by_browsers(asking):
    client = asking(no_keys=True)
    with client.stream("GET", LAND) as answer:
        assert answer.headers["content-encoding"] == "gzip"
        assert answer.headers["content-type"] == "application/json"
        assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"
        sent = b"".join(answer.iter_raw())
        tag = answer.headers["etag"]
    assert json.loads(gzip.decompress(sent))["objects"].keys() == {"land"}

    again = client.get(LAND, headers={"If-None-Match": tag})
    assert again.status_code == httpx.codes.NOT_MODIFIED
    assert "content-encoding" not in again.headers
    assert client.get("/dashboard/js/land.js").headers["cache-control"] == "no-cache"
