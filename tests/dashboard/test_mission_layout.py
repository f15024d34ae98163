"""A mission's tables and forms fit where they stand, and speak of hours and degrees on the globe."""

import pytest
from mission_steps import Mission, select, without_a_mission
from playwright.sync_api import expect

MATERIALS = ["water", "food", "medicine"]
UAV = {"x_s": 84.6, "y_s": 28.0, "speed": 60, "voyage": 200, "loadlist": [30, 30, 30]}
VALLEY = {
    "crs": "wgs84",
    "uavs": [{**UAV, "id": "gorkha-a"}, {**UAV, "id": "dhading-b"}],
    "targets": [
        {"id": name, "x": 84.7 + at / 50, "y": 28.1, "level": 1, "loadlist": [10, 8, 4]}
        for at, name in enumerate(["Palungtar", "Saurpani", "Jharlang", "Salyantar"])
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


@pytest.mark.parametrize("width", [390, 820, 1280])
def test_no_table_of_a_mission_is_wider_than_its_place(page, mission, width):
    page.set_viewport_size({"width": width, "height": 800})
    mission.open(page)
    expect(page.locator("[data-testid='mission-stops ahead'] tbody tr")).to_have_count(4)
    page.locator("#view-missions details.card").evaluate_all(
        "all => all.forEach((each) => { each.open = true; })"
    )
    wide = page.locator("#view-missions .scroll").evaluate_all(
        """all => all.filter((each) => each.checkVisibility())
            .filter((each) => each.scrollWidth > each.closest(".card").clientWidth - 24)
            .map((each) => [each.getAttribute("aria-label"), each.scrollWidth, each.clientWidth])"""
    )
    assert wide == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


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
