"""What lies below a problem on the globe: land where there is land, and what the operator puts above it."""

import json
from contextlib import contextmanager

import pytest
from dashboard_steps import PATIENCE_MS, open_problem, ready, state
from live_service import SMALL, LiveService
from picture_archive import archive, picture
from playwright.sync_api import expect

ON_LAND = """() => {
    const path = document.querySelector(".land path");
    const { left, top } = document.querySelector(".land").getBoundingClientRect();
    const onLand = (symbol) => {
        const box = symbol.getBoundingClientRect();
        const [x, y] = [box.left + box.width / 2 - left, box.top + box.height / 2 - top];
        return path.isPointInFill(new DOMPoint(x, y));
    };
    return Object.fromEntries([...document.querySelectorAll(".symbol.targets")].map(
        (symbol) => [symbol.dataset.id, onLand(symbol)]));
}"""
DRAWN = "() => document.querySelector('.land path')?.getAttribute('d')"
FAR, NEAR = "land-50m.json.gz", "land-10m.json.gz"

PLACES = {
    "Mozambique and Madagascar": (
        FAR,
        {"Dondo": (34.0, -19.2, True), "channel": (41.5, -19.5, False), "Antsirabe": (46.9, -19.9, True)},
    ),
    "the bay of Maputo": (
        NEAR,
        {"city": (32.55, -25.93, True), "bay": (32.78, -25.95, False), "Catembe": (32.55, -26.1, True)},
    ),
    "Fiji, on both sides of the date line": (
        NEAR,
        {"Viti Levu": (178.0, -17.8, True), "east": (-176.0, -17.0, False)},
    ),
    "Chukotka, on both sides of the date line": (
        FAR,
        {"west": (176.0, 67.0, True), "east": (-176.0, 67.3, True), "strait": (-169.3, 64.5, False)},
    ),
    "the Caspian Sea": (
        FAR,
        {"sea": (51.0, 42.0, False), "Tehran": (51.4, 35.7, True), "Tbilisi": (44.8, 41.7, True)},
    ),
    "Antarctica": (FAR, {"plateau": (20.0, -80.0, True), "sea": (20.0, -60.0, False)}),
}  # fmt: skip


def problem_at(places):
    areas = [{"id": name, "x": x, "y": y, "level": 1, "loadlist": [1]} for name, (x, y, *_) in places.items()]
    return {"crs": "wgs84", "uavs": [], "targets": areas}


@pytest.mark.parametrize("region", PLACES)
def test_land_is_where_it_is(shared_page, region):
    page = shared_page
    ready(page)
    file, places = PLACES[region]
    open_problem(page, problem_at(places), region)
    expect(page.locator(".symbol.targets")).to_have_count(len(places))
    expect(page.locator(".land")).to_have_attribute("data-file", file)

    assert page.evaluate(ON_LAND) == {name: on_land for name, (*_, on_land) in places.items()}


def test_the_close_coast_is_asked_for_only_where_it_is_seen_close(page):
    ready(page)
    far, near = (problem_at(places) for _, places in list(PLACES.values())[:2])
    open_problem(page, far)
    page.wait_for_selector("html[data-kept=true]")
    asked = []
    page.on("request", lambda request: asked.append(request.url.rsplit("/", 1)[-1]))
    page.reload()
    ready(page)
    expect(page.locator(".land")).to_have_attribute("data-file", FAR)
    assert (FAR in asked, NEAR in asked) == (True, False)
    open_problem(page, near)
    expect(page.locator(".land")).to_have_attribute("data-file", NEAR)
    assert (asked.count(FAR), asked.count(NEAR)) == (1, 1)
    open_problem(page, far)
    expect(page.locator(".land")).to_have_attribute("data-file", FAR)
    assert (asked.count(FAR), asked.count(NEAR)) == (1, 1)


def test_a_plane_has_no_land_and_asks_for_none(page):
    ready(page)
    open_problem(page, {**problem_at({"a": (34.0, -19.2)}), "crs": "local"})
    page.wait_for_selector("html[data-kept=true]")
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.reload()
    ready(page)
    expect(page.locator(".symbol.targets")).to_have_count(1)
    expect(page.locator(".land")).to_have_count(0)
    assert not [url for url in asked if "world-atlas" in url]


def test_land_goes_along_while_the_map_is_dragged_and_zoomed(shared_page):
    page = shared_page
    ready(page)
    file, places = PLACES["Mozambique and Madagascar"]
    open_problem(page, problem_at(places), "moved")
    expect(page.locator(".land")).to_have_attribute("data-file", file)
    expected = {name: on_land for name, (*_, on_land) in places.items()}
    box = page.locator("#map").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 380, box["y"] + 100, steps=4)
    assert page.evaluate(ON_LAND) == expected
    page.mouse.up()
    page.locator("#map").press("-")
    page.wait_for_selector("#map:not(.leaflet-zoom-anim)")
    assert page.evaluate(ON_LAND) == expected


OVERLAY = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"name": name},
            "geometry": geometry and {"type": geometry, "coordinates": at},
        }
        for name, geometry, at in (
            ("<b>Gondola</b>", "Point", [33.2, -18.6]),
            ("EN6", "LineString", [[34.8, -19.8], [33.5, -19.1]]),
            ("Sofala", "Polygon", [[[34, -20], [35, -20], [35, -19], [34, -20]]]),
            ("nowhere", None, None),
        )
    ],
}


@contextmanager
def service_with(folder, name, overlay):
    path = folder / name
    path.write_bytes(overlay)
    service = LiveService(folder, workers=1, **SMALL, overlay_file=path)
    try:
        yield service.start().await_alive()
    finally:
        service.stop()


@pytest.fixture(scope="module")
def with_overlay(tmp_path_factory):
    content = json.dumps(OVERLAY).encode()
    with service_with(tmp_path_factory.mktemp("overlay"), "borders.geojson", content) as service:
        yield service


def test_an_overlay_is_drawn_above_the_land_and_takes_no_click(browser, with_overlay):
    context = browser.new_context(viewport={"width": 1366, "height": 900})
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(with_overlay.url)
    ready(page)
    for shape in ("point", "line", "shape"):
        expect(page.locator(f"path.overlay-{shape}")).to_have_count(1)
    expect(page.locator(".overlay-name")).to_have_text("<b>Gondola</b>")
    order = page.evaluate(
        """() => ["land", "tile", "operator", "zones"].map(
            (name) => Number(getComputedStyle(document.querySelector(`.leaflet-${name}-pane`)).zIndex))"""
    )
    assert order == sorted(set(order))

    page.click("[data-place=targets]")
    at = page.locator("path.overlay-point").bounding_box()
    page.mouse.click(at["x"] + at["width"] / 2, at["y"] + at["height"] / 2)
    placed = state(page, "problem")["targets"][-1]
    assert [placed["x"], placed["y"]] == pytest.approx([33.2, -18.6], abs=0.02)
    context.close()


SHOWN = """() => {
    const [tile] = document.querySelectorAll(".leaflet-operator-pane img.leaflet-tile-loaded");
    const canvas = new OffscreenCanvas(1, 1).getContext("2d");
    canvas.drawImage(tile, 0, 0);
    return [...canvas.getImageData(0, 0, 1, 1).data];
}"""


def test_pictures_of_an_archive_are_an_overlay_above_the_land(browser, tmp_path):
    content = archive(picture(200, 90, 30), 3, attribution='<a href="x">The <b>mappers</b></a>')
    with service_with(tmp_path, "world.pmtiles", content) as service, browser.new_context() as context:
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        troubles = []
        page.on("console", lambda said: troubles.append(said.text) if said.type == "error" else None)
        page.goto(service.url)
        ready(page)
        tiles = page.locator(".leaflet-operator-pane img.leaflet-tile-loaded")
        expect(tiles).not_to_have_count(0)
        assert page.evaluate(SHOWN) == [200, 90, 30, 255]
        expect(page.locator(".leaflet-control-attribution")).to_contain_text("The mappers")
        order = page.evaluate(
            """() => ["land", "operator", "overlay"].map(
                (name) => Number(getComputedStyle(document.querySelector(`.leaflet-${name}-pane`)).zIndex))"""
        )
        assert order == sorted(set(order))
        page.click("[data-place=targets]")
        box = page.locator("#map").bounding_box()
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        assert "x" in state(page, "problem")["targets"][-1]
        open_problem(page, {**problem_at({"a": (34.0, -19.2)}), "crs": "local"})
        expect(tiles).to_have_count(0)
        # The service says that its workers are still starting.
        assert [text for text in troubles if "503" not in text] == []
