"""What has happened is told by clicks, and what the service says about it is on screen."""

import pytest
from dashboard_steps import state
from mission_steps import SMALL, Mission, at_the_newest, newest, select, tell, without_a_mission
from playwright.sync_api import expect


@pytest.fixture
def page(shared_page):
    yield from without_a_mission(shared_page)


def test_what_is_planned_is_filled_in_and_told(page, service):
    mission = Mission(service).search_ends().open(page)
    mission.tell("go", type="clock", at=4.2)
    at_the_newest(page, mission)
    page.locator("summary", has_text="Stops done").click()
    page.get_by_role("button", name="Report u1 at near").click()
    form = page.locator("form[data-form=visit_done]")
    expect(form.locator("input[name='delivered/0']")).to_have_value("3")
    form.locator("input[name='delivered/0']").fill("1")
    tell(page)

    told = newest(page, mission, "visit_done")

    assert told["event"] == {
        "type": "visit_done",
        "uav_id": "u1",
        "target_id": "near",
        "delivered": [1],
        **({"time": None} if "time" in told["event"] else {}),
    }
    expect(page.locator("[data-testid='mission-stops done'] tr[data-stop=near]")).to_contain_text("reported")
    areas = {each["id"]: each for each in mission.read()["state"]["problem"]["targets"]}
    assert (areas["near"]["loadlist"], areas["near"]["requested"]) == ([2], [3])
    expect(page.locator("[data-testid=mission-areas] tr[data-area=near]")).to_contain_text("2 of 3")
    # A stop ahead is done before its time: the UAV is there.
    page.get_by_role("button", name="u2 at far is done").click()
    tell(page)
    assert newest(page, mission, "visit_done")["event"]["target_id"] == "far"


EVENTS = {
    "uav_delayed": ("uavs", "u1", {"until": "2"}, {"uav_id": "u1", "until": 2}),
    "uav_lost": ("uavs", "u1", {}, {"uav_id": "u1"}),
    "level_changed": ("targets", "near", {"level": "7"}, {"target_id": "near", "level": 7}),
    "area_cancelled": ("targets", "far", {}, {"target_id": "far"}),
    "stock_changed": ("bases", "depot", {"stock/0": "4"}, {"base_id": "depot", "stock": [4]}),
    "zones_changed": ("no_fly_zones", "tower", {}, {"no_fly_zones": []}),
    "reload_done": (
        "bases",
        "depot",
        {"loadlist/0": "5"},
        {"uav_id": "u1", "base_id": "depot", "loadlist": [5]},
    ),
}


@pytest.mark.parametrize("of_type", EVENTS)
def test_each_event_is_told_by_clicks(page, service, of_type):
    kind, name, fields, expected = EVENTS[of_type]
    mission = Mission(service).search_ends().open(page)
    select(page, kind, name)
    page.locator(f"#mission-acts button[data-type={of_type}]").click()
    for field, entered in fields.items():
        page.locator(f"form[data-form={of_type}] [name='{field}']").fill(entered)
    tell(page)
    event = newest(page, mission, of_type)["event"]
    assert {key: event[key] for key in expected} == expected
    expect(page.locator(f"form[data-form={of_type}]")).to_have_count(0)


def test_the_wind_turns_and_stops(page, service):
    mission = Mission(service).search_ends().open(page)
    page.get_by_role("button", name="Wind", exact=True).click()
    page.locator("input[name='wind/speed']").fill("1")
    page.locator("input[name='wind/towards']").fill("90")
    tell(page)
    wind = newest(page, mission, "wind_changed")["event"]["wind"]
    assert (wind["speed"], wind["towards"]) == (1, 90)
    expect(page.locator(".wind")).to_contain_text("wind 1 towards 90°")
    page.get_by_role("button", name="Wind", exact=True).click()
    page.locator("input[name='wind/speed']").fill("")
    tell(page)
    expect(page.locator(".wind")).to_have_count(0)
    assert mission.read()["state"]["problem"].get("wind") is None


def test_areas_and_uavs_are_placed_on_the_map(page, service):
    mission = Mission(service).search_ends().open(page)
    page.locator("[data-mission-place=targets]").click()
    page.locator("#map").click(position={"x": 300, "y": 200})
    form = page.locator("form[data-form=areas_added]")
    form.locator("[name='/targets/0/loadlist/0'], [name='targets/0/loadlist/0']").fill("2")
    tell(page)
    (area,) = newest(page, mission, "areas_added")["event"]["targets"]
    assert (area["loadlist"], area["level"]) == ([2], 1)
    expect(page.locator(f"[data-testid=mission-areas] tr[data-area='{area['id']}']")).to_be_attached()
    # By the keyboard it is the middle of the map.
    page.locator("[data-mission-place=uavs]").press("Enter")
    page.locator("#map").press("Enter")
    page.locator("form[data-form=uavs_added] input[name=id]").fill("u9")
    tell(page)
    (uav,) = newest(page, mission, "uavs_added")["event"]["uavs"]
    assert (uav["id"], uav["speed"], uav["loadlist"]) == ("u9", 2, [6])
    expect(page.locator("[data-testid=mission-UAVs] tr[data-uav=u9]")).to_be_visible()
    assert state(page, "problem")["uavs"][-1]["id"] != "u9"


def test_a_zone_is_drawn_and_what_it_breaks_is_said(page, service):
    mission = Mission(service).search_ends().open(page)
    page.locator("[data-draw=mission-zone]").click()
    for x, y in ((300, 100), (500, 100), (500, 200)):
        page.locator("#map").click(position={"x": x, "y": y})
    page.locator("#map").press("Enter")
    # Meanwhile another dispatcher closes one, too.
    other = {"id": "other", "polygon": [[40, 40], [41, 40], [41, 41]]}
    mission.tell("other", type="zones_changed", no_fly_zones=[*SMALL["no_fly_zones"], other])
    at_the_newest(page, mission)
    tell(page)
    expect(page.locator("path.no-fly-zone[data-zone-id='zone-3']")).to_be_attached()
    zones = mission.read()["state"]["problem"]["no_fly_zones"]
    assert [zone["id"] for zone in zones] == ["tower", "other", "zone-3"]
    assert len(zones[2]["polygon"]) == 3
    # A closed area: no stop of the plan is left there, and the history says which rule it is.
    closed = [{"id": "shut", "polygon": [[-2, 13], [2, 13], [2, 15], [-2, 15]]}]
    effect = mission.tell("shut", type="zones_changed", no_fly_zones=closed)["effect"]
    assert [each["target_id"] for each in effect["broken"]] == ["far"]
    row = page.locator("[data-testid=mission-log] li.broken").first
    expect(row).to_contain_text(f"u2 does not stop at far: {effect['broken'][0]['says']}")


def test_what_was_filled_in_for_one_mission_is_not_told_to_another(page, service):
    first, second = (Mission(service).search_ends() for _ in range(2))
    first.open(page)
    select(page, "uavs", "u1")
    page.locator("#mission-acts button[data-type=uav_lost]").click()
    second.open(page)
    expect(page.locator("#view-missions h2", has_text=second.id[:8])).to_be_visible()
    expect(page.locator("form[data-form=uav_lost]")).to_have_count(0)


def test_an_area_that_is_found_otherwise_keeps_what_it_has_got(page, service):
    mission = Mission(service).search_ends().open(page)
    mission.tell("go", type="clock", at=4.6)
    at_the_newest(page, mission)
    select(page, "targets", "near")
    page.locator("#mission-acts button[data-type=areas_changed]").click()
    page.locator("form[data-form=areas_changed] [name$='loadlist/0']").fill("2")
    page.locator("form[data-form=areas_changed] [name=level]").fill("5")
    tell(page)
    newest(page, mission, "areas_changed")
    area = next(each for each in mission.read()["state"]["problem"]["targets"] if each["id"] == "near")
    assert (area["loadlist"], area["requested"], area["level"]) == ([2], [5], 5)
    assert area["service_time"] == 0.5


def test_what_the_service_refuses_is_said_at_the_field(page, service):
    page.expected_troubles.append("422")
    mission = Mission(service).search_ends().open(page)
    mission.tell("go", type="clock", at=4.2)
    at_the_newest(page, mission)
    page.locator("[data-testid='mission-stops ahead'] tr[data-stop=far] button", has_text="Done").click()
    page.locator("form[data-form=visit_done] [name='delivered/0']").fill("50")
    tell(page)
    expect(page.locator("form[data-form=visit_done] [data-pointer='/delivered/0'] .error")).to_contain_text(
        "had 6 aboard"
    )
    assert "visit_done" not in mission.types()
    assert state(page, "untold") == []
    page.get_by_role("button", name="Not so").click()
