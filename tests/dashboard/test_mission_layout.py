"""A mission's tables and forms fit where they stand, and speak of hours and degrees on the globe."""

import re

import pytest
from dashboard_steps import PATIENCE_MS, go, ready
from mission_steps import Mission, select, without_a_mission
from playwright.sync_api import expect

MATERIALS = ["drinking water", "food parcels", "medicine"]
UAV = {"x_s": 84.6, "y_s": 28.0, "speed": 60, "voyage": 200, "loadlist": [30, 30, 30]}
VALLEY = {
    "crs": "wgs84",
    "uavs": [{**UAV, "id": "Long-range fixed wing 1"}, {**UAV, "id": "dhading-b"}],
    "targets": [
        {"id": name, "x": 84.7 + at / 50, "y": 28.1, "level": 1, "loadlist": [10, 8, 4]}
        for at, name in enumerate(["Palungtar health centre", "Saurpani", "Jharlang", "Salyantar"])
    ],
    "bases": [
        {"id": "Kathmandu airport", "x": 84.65, "y": 28.0, "stock": [900, 1800, 220], "turnaround": 0.25}
    ],
    "materials": [{"name": name} for name in MATERIALS],
    "start_plan": [[0, 1], [2, 3]],
}


@pytest.fixture
def page(shared_page):
    before = shared_page.viewport_size
    yield from without_a_mission(shared_page)
    shared_page.set_viewport_size(before)


@pytest.fixture(scope="module")
def mission(service):
    return Mission(service, VALLEY).search_ends()


WIDER = """all => all.filter((each) => each.checkVisibility())
    .filter((each) => each.scrollWidth > each.clientWidth || each.getBoundingClientRect().right > innerWidth)
    .map((each) => [each.ariaLabel ?? each.dataset.testid, each.scrollWidth, each.clientWidth])"""
"""What is wider than its place, or than the page."""
TABLES = "#view-missions .scroll, #view-missions table"
ALL_MISSIONS = re.compile("^(All missions|Toutes les missions)$")


def opened(page, mission):
    """Open a mission, in whatever language, and all of its tables."""
    page.evaluate("(id) => { location.hash = `#/missions/${id}`; }", mission.id)
    expect(page.locator("[data-testid='mission-stops ahead'] tbody tr")).to_have_count(4)
    page.locator("#view-missions details").evaluate_all("all => all.forEach((each) => { each.open = true; })")


@pytest.mark.parametrize("locale", ["en-GB", "fr-FR"])
def test_no_table_of_a_mission_is_wider_than_its_place(browser, service, mission, locale):
    with browser.new_context(locale=locale) as context:
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        page.goto(service.url)
        ready(page)
        for width in (390, 820, 1024, 1280, 1920):
            page.set_viewport_size({"width": width, "height": 800})
            go(page, "missions")
            expect(page.locator("tr[data-mission]")).not_to_have_count(0)
            assert page.locator(TABLES).evaluate_all(WIDER) == [], f"the list, {width}"
            opened(page, mission)
            assert page.locator(TABLES).evaluate_all(WIDER) == [], width
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), width
            page.locator("#view-missions button").filter(has_text=ALL_MISSIONS).click()


def test_a_cell_has_its_title_before_it_where_there_is_no_room_for_columns(page, mission):
    seen = "all => all.map((each) => getComputedStyle(each, '::before').content)"
    cells = page.locator("[data-testid=mission-UAVs] tr[data-uav='dhading-b'] td")
    heads = page.locator("[data-testid=mission-UAVs] thead")
    page.set_viewport_size({"width": 1024, "height": 800})
    opened(page, mission)
    assert cells.evaluate_all(seen) == ['"Doing"', '"Range left"', '"Load"', '"Seen"']
    assert heads.evaluate("(head) => getComputedStyle(head).clipPath") == "inset(50%)"
    page.set_viewport_size({"width": 1280, "height": 800})
    assert set(cells.evaluate_all(seen)) == {"none"}
    assert heads.evaluate("(head) => getComputedStyle(head).clipPath") == "none"


def test_what_can_be_told_of_a_chosen_area_comes_into_sight(page, mission):
    page.set_viewport_size({"width": 1280, "height": 600})
    mission.open(page)
    areas = page.get_by_test_id("mission-areas")
    if not areas.is_visible():
        page.locator("#view-missions summary", has_text="Areas").click()
    name = areas.get_by_role("button", name="Salyantar")
    name.scroll_into_view_if_needed()
    acts = page.locator("#mission-acts")
    expect(acts).not_to_be_in_viewport()
    name.click()
    expect(acts.locator("[data-type=areas_changed]")).to_be_in_viewport(ratio=1)


def test_forms_on_the_globe_have_its_words_and_units(page, mission):
    mission.open(page)
    select(page, "targets", "Saurpani")
    page.locator("#mission-acts").get_by_role("button", name="Need or place changed").click()
    form = page.locator("form[data-form=areas_changed]")
    form.locator("summary").click()
    for label in ("Longitude", "Latitude", "Deadline"):
        expect(form.get_by_label(label)).to_be_visible()
    expect(form).to_contain_text("Latest arrival, in hours from now")
    assert "time units" not in form.inner_text()
    form.get_by_role("button", name="Cancel").click()
    page.locator("[data-mission-place=uavs]").press("Enter")
    page.locator("#map").press("Enter")
    form = page.locator("form[data-form=uavs_added]")
    expect(form.get_by_label("Start longitude")).to_be_visible()
    expect(form).to_contain_text("Average speed: km/h")
    expect(form).to_contain_text("Maximum range of one flight, in km")
    form.get_by_role("button", name="Cancel").click()
