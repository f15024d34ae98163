"""No-fly zones drawn by hand, a click a corner: changed, renamed, removed; in files and in the request."""

import json
import math

import pytest
from dashboard_steps import go, open_problem, ready, show_answer, state
from page_modules import run_module
from playwright.sync_api import expect

from app.api.problem_models import ProblemModel, to_problem
from app.domain.errors import InvalidProblem
from app.settings import Settings

PROBLEM = {
    "crs": "local",
    "objective": {"distance_weight": 0.001},
    "uavs": [{"id": "u", "x_s": 0, "y_s": 0, "speed": 1, "voyage": 60, "loadlist": [9]}],
    "targets": [{"id": "a", "x": 10, "y": 0, "level": 1, "loadlist": [3]}],
}
GLOBE = {
    **PROBLEM,
    "crs": "wgs84",
    "uavs": [{**PROBLEM["uavs"][0], "x_s": 34.0, "y_s": -19.0, "speed": 60, "voyage": 300}],
    "targets": [{**PROBLEM["targets"][0], "x": 35.0, "y": -19.0}],
}


@pytest.fixture
def show(page):
    """Opens a problem with its map standing still, and returns the page."""

    def shown(problem):
        ready(page)
        open_problem(page, problem)
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        return page

    return shown


def zones(page):
    return state(page, "problem").get("no_fly_zones", [])


def middle(page):
    box = page.locator("#map").bounding_box()
    return box["width"] / 2, box["height"] / 2


def round_the_middle(page, count, radius=100):
    """Return so many places on a circle around the middle of the map."""
    x, y = middle(page)
    turns = [2 * math.pi * n / count for n in range(count)]
    return [(x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns]


def click(page, place, **how):
    page.locator("#map").click(position={"x": place[0], "y": place[1]}, **how)


def draw(page, places):
    page.click("[data-draw=zone]")
    for place in places:
        click(page, place)


def exported(page, kind):
    with page.expect_download() as saved:
        page.click(f"[data-export={kind}]")
    return json.loads(saved.value.path().read_text(encoding="utf-8"))


@pytest.mark.parametrize("problem", [PROBLEM, GLOBE], ids=["plane", "globe"])
def test_ten_clicks_draw_ten_corners_that_are_exported_allocated_and_undone_in_one_step(
    show, service, problem
):
    page = show(problem)
    draw(page, round_the_middle(page, 10))
    expect(page.locator("#drawing-says")).to_have_text("10 corners.")
    page.keyboard.press("Enter")

    (zone,) = zones(page)
    assert (zone["id"], len(zone["polygon"])) == ("zone-1", 10)
    expect(page.locator("path.no-fly-zone")).to_have_attribute("data-zone-id", "zone-1")
    assert exported(page, "JSON")["no_fly_zones"] == [zone]
    (feature,) = [
        each for each in exported(page, "GeoJSON")["features"] if each["properties"]["kind"] == "zone"
    ]
    assert feature["geometry"]["coordinates"] == [[*zone["polygon"], zone["polygon"][0]]]
    answer = show_answer(page, service.url)
    (stop,) = answer["routes"][0]["stops"]
    assert set(map(tuple, stop["path"][1:-1])) <= set(map(tuple, zone["polygon"]))
    assert len(stop["path"]) > 3

    page.locator("body").press("Control+z")
    assert state(page, "problem") == problem
    expect(page.locator("path.no-fly-zone")).to_have_count(0)


def test_a_double_click_and_a_click_on_the_first_corner_end_a_zone_too(show):
    page = show(PROBLEM)
    places = round_the_middle(page, 5)
    zoom = page.locator(".graticule").inner_html()
    draw(page, places[:4])
    page.locator("#map").dblclick(position={"x": places[4][0], "y": places[4][1]})
    assert [len(zone["polygon"]) for zone in zones(page)] == [5]
    assert page.locator(".graticule").inner_html() == zoom

    draw(page, round_the_middle(page, 3, 40))
    click(page, round_the_middle(page, 3, 40)[0])
    assert [len(zone["polygon"]) for zone in zones(page)] == [5, 3]
    assert [zone["id"] for zone in zones(page)] == ["zone-1", "zone-2"]


def test_escape_gives_up_and_two_corners_are_no_zone(show):
    page = show(PROBLEM)
    before = state(page, "past")
    draw(page, round_the_middle(page, 2))
    page.keyboard.press("Enter")
    expect(page.locator("#alerts .notice")).to_contain_text("at least 3 corners")
    expect(page.locator("#drawing-says")).to_have_text("2 corners.")
    page.keyboard.press("Escape")
    expect(page.locator("#drawing")).to_be_hidden()
    expect(page.locator("path.zone-side")).to_have_count(0)
    assert (state(page, "problem"), state(page, "past")) == (PROBLEM, before)


def test_clicks_on_symbols_are_corners_while_a_zone_is_drawn(show):
    page = show(PROBLEM)
    at = page.locator(".symbol[data-id=a]").bounding_box()
    page.click("[data-draw=zone]")
    page.mouse.click(at["x"] + at["width"] / 2, at["y"] + at["height"] / 2)
    expect(page.locator("#drawing-says")).to_have_text("1 corner.")
    assert state(page, "selection") is None


def test_sides_that_cross_are_shown_and_named_while_drawing_and_before_they_are_sent(show):
    page = show(PROBLEM)
    x, y = middle(page)
    bow = [(x - 80, y - 80), (x + 80, y + 80), (x + 80, y - 80), (x - 80, y + 80)]
    says = "The side from corner 1 to 2 crosses that from corner 3 to 4"
    draw(page, bow)
    expect(page.locator("#drawing-says")).to_contain_text(says)
    expect(page.locator("path.zone-side.crossing:not(.band)")).to_have_count(2)
    page.keyboard.press("Control+z")
    expect(page.locator("#drawing-says")).to_have_text("3 corners.")
    expect(page.locator("path.zone-side.crossing:not(.band)")).to_have_count(0)
    click(page, bow[3])
    page.keyboard.press("Enter")
    expect(page.locator("#zone-fault")).to_contain_text(says)
    expect(page.locator("path.zone-side.crossing")).to_have_count(2)
    go(page, "allocate")
    expect(page.locator("#crossing-zones li")).to_contain_text(f"zone-1: {says}")
    page.expected_troubles.append("422")
    page.click("#start")
    expect(page.locator("#violations li")).to_contain_text("crosses")
    page.locator("#violations li button").click()
    expect(page.locator("#view-problem h2", has_text="zone-1")).to_be_visible()
    page.locator("tr[data-corner='1']").get_by_label("Remove corner 2").click()
    expect(page.locator("#zone-fault")).to_be_hidden()
    assert len(zones(page)[0]["polygon"]) == 3
    page.locator("tr[data-corner='1']").get_by_label("Remove corner 2").click()
    expect(page.locator("#alerts .notice").last).to_contain_text("at least 3 corners")
    assert len(zones(page)[0]["polygon"]) == 3


def crosses_for_the_service(crs, polygon):
    body = {**(GLOBE if crs == "wgs84" else PROBLEM), "no_fly_zones": [{"polygon": polygon}]}
    near = {"x_s": 1.0, "y_s": 58.0}
    body["uavs"] = [{**body["uavs"][0], **near}]
    body["targets"] = [{**body["targets"][0], "x": 1.5, "y": 58.0}]
    try:
        to_problem(ProblemModel.model_validate(body), Settings())
    except InvalidProblem as refused:
        return "crosses" in str(refused.violations)
    return False


def test_the_service_and_the_page_say_the_same_of_sides():
    """Arcs of great circles at 60 degrees north: straight lines of degrees would cross, they do not."""
    code = """
        const { crossings } = await load("zones.js");
        return given.map(([crs, polygon]) => crossings(crs, polygon));
    """
    arched = [[0, 60], [40, 60], [40, 59], [20, 61], [0, 59]]
    square, bow = [[0, 0], [2, 0], [2, 2], [0, 2]], [[0, 0], [2, 2], [2, 0], [0, 2]]
    touching = [[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]]
    given = [("local", arched), ("wgs84", arched), ("local", square), ("wgs84", bow), ("local", touching)]
    found = run_module(code, given)
    assert [crosses_for_the_service(*each) for each in given] == list(map(bool, found))
    assert found == [[[0, 2], [0, 3]], [], [], [[0, 2]], []]


def test_corners_are_dragged_moved_added_and_removed_and_zones_renamed_moved_and_removed(show):
    page = show(PROBLEM)
    draw(page, round_the_middle(page, 4))
    page.keyboard.press("Enter")
    before = zones(page)[0]["polygon"]
    corner = page.locator(".corner[data-corner='0']")
    at = corner.bounding_box()
    page.mouse.move(at["x"] + 7, at["y"] + 7)
    page.mouse.down()
    page.mouse.move(at["x"] + 47, at["y"] + 27, steps=4)
    page.mouse.up()
    dragged = zones(page)[0]["polygon"]
    assert dragged[1:] == before[1:]
    assert dragged[0][0] > before[0][0]
    assert dragged[0][1] < before[0][1]

    corner.press("Alt+ArrowLeft")
    expect(corner).to_be_focused()
    assert zones(page)[0]["polygon"][0][0] < dragged[0][0]
    page.get_by_role("button", name="New corner after corner 1 of zone-1").press("Enter")
    assert len(zones(page)[0]["polygon"]) == 5
    page.locator(".corner[data-corner='1']").press("Delete")
    assert zones(page)[0]["polygon"][1:] == before[1:]
    page.get_by_label("x of corner 3").fill("7.5")
    page.get_by_label("x of corner 3").press("Enter")
    assert zones(page)[0]["polygon"][2][0] == 7.5

    page.locator("#view-problem input[name=name]").fill("Airport")
    page.locator("#view-problem input[name=name]").press("Enter")
    cell = page.locator("table[data-kind=no_fly_zones] tr[data-id=zone-1] td[data-column=id]")
    cell.click()
    cell.press("F2")
    page.keyboard.type("airport")
    page.keyboard.press("Enter")
    assert (zones(page)[0]["id"], zones(page)[0]["name"]) == ("airport", "Airport")
    expect(page.get_by_role("button", name="Corner 1 of Airport", exact=True)).to_be_visible()

    was = zones(page)[0]["polygon"]
    at = page.get_by_role("button", name="All of Airport").bounding_box()
    page.mouse.move(at["x"] + 7, at["y"] + 7)
    page.mouse.down()
    page.mouse.move(at["x"] + 7, at["y"] - 33, steps=4)
    page.mouse.up()
    now = zones(page)[0]["polygon"]
    moved = [(x - was[at][0], y - was[at][1]) for at, (x, y) in enumerate(now)]
    assert all(across == pytest.approx(0, abs=0.01) and along > 0 for across, along in moved)
    was = now
    page.locator("#map").focus()
    page.keyboard.press("Alt+ArrowRight")
    now = zones(page)[0]["polygon"]
    moved = [(x - was[at][0], y - was[at][1]) for at, (x, y) in enumerate(now)]
    assert all(across > 0 and along == pytest.approx(0, abs=0.01) for across, along in moved)
    page.locator("#map").focus()
    page.keyboard.press("Delete")
    assert zones(page) == []
    page.locator("body").press("Control+z")
    assert zones(page)[0]["polygon"] == now


def test_the_keyboard_alone_draws_a_zone_and_buttons_do_without_keys(show):
    page = show(PROBLEM)
    page.locator("[data-draw=zone]").press("Enter")
    expect(page.locator("#map")).to_be_focused()
    page.keyboard.press("Space")
    for away in ("ArrowRight", "ArrowDown"):
        moved = page.locator(".graticule").inner_html()
        page.keyboard.press(away)
        page.wait_for_function(
            "(was) => document.querySelector('.graticule').innerHTML !== was"
            " && !document.querySelector('.leaflet-pan-anim')",
            arg=moved,
        )
        page.keyboard.press("Space")
    page.keyboard.press("Backspace")
    expect(page.locator("#drawing-says")).to_have_text("2 corners.")
    steps = page.locator("#drawing")
    steps.get_by_role("button", name="Corner in the middle").click()
    steps.get_by_role("button", name="Finish the zone").click()
    assert [len(zone["polygon"]) for zone in zones(page)] == [3]


def test_a_finger_draws_a_zone(browser, service):
    context = browser.new_context(has_touch=True, viewport={"width": 820, "height": 1180})
    page = context.new_page()
    page.goto(service.url)
    ready(page)
    open_problem(page, PROBLEM)
    page.locator("[data-draw=zone]").tap()
    for x, y in round_the_middle(page, 4):
        page.locator("#map").tap(position={"x": x, "y": y})
    page.get_by_role("button", name="Finish the zone").tap()
    assert [len(zone["polygon"]) for zone in zones(page)] == [4]
    context.close()
