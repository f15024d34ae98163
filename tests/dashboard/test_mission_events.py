"""What has happened is told by clicks, and what the service says about it is on screen."""

import pytest
from dashboard_steps import go, state
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


def drag(page, handle, across, down):
    box = handle.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + across, y + down, steps=4)
    page.mouse.up()


def test_zones_are_dragged_by_corners_and_as_a_whole_and_told_as_one_event(page, service):
    shut = {"id": "shut", "polygon": [[20, 20], [24, 20], [24, 24], [20, 24]], "name": "Harbour"}
    tower = {"id": "tower", "polygon": [[30, 30], [36, 30], [36, 36]]}
    mission = Mission(service, {**SMALL, "no_fly_zones": [tower, shut]}).search_ends().open(page)
    select(page, "no_fly_zones", "shut")
    corner = page.locator(".corner[data-corner='2']")
    drag(page, corner, 30, -20)
    form = page.locator("form[data-form=zones_changed]")
    expect(form).to_contain_text("Harbour")
    corner.press("Alt+ArrowRight")
    expect(corner).to_be_focused()
    form.get_by_label("y of corner 1").fill("19.5")
    form.get_by_label("y of corner 1").press("Enter")
    select(page, "no_fly_zones", "tower")
    expect(form.locator("[data-shape=shut]")).to_have_text("Harbour has 4 corners.")
    drag(page, page.get_by_role("button", name="All of tower"), -40, 10)
    page.get_by_role("button", name="All of tower").press("Alt+ArrowLeft")
    # Nothing is told yet; and what others tell meanwhile is not undone.
    other = {"id": "other", "polygon": [[40, 40], [41, 40], [41, 41]]}
    mission.tell("other", type="zones_changed", no_fly_zones=[tower, shut, other])
    at_the_newest(page, mission)
    expect(form).to_be_visible()
    tell(page)

    newest(page, mission, "zones_changed")
    expect(form).to_have_count(0)
    told = [each for each in mission.read("/events")["events"] if each["type"] == "zones_changed"]
    assert len(told) == 2
    now = {zone["id"]: zone for zone in mission.read()["state"]["problem"]["no_fly_zones"]}
    assert list(now) == ["tower", "shut", "other"]
    assert now["other"]["polygon"] == other["polygon"]
    assert now["shut"]["name"] == "Harbour"
    before, after = shut["polygon"], now["shut"]["polygon"]
    assert (after[0], after[1], after[3]) == ([20, 19.5], before[1], before[3])
    assert after[2][0] > before[2][0]
    assert after[2][1] > before[2][1]
    moved = [
        (x - tower["polygon"][n][0], y - tower["polygon"][n][1])
        for n, (x, y) in enumerate(now["tower"]["polygon"])
    ]
    assert all(across < 0 and along < 0 for across, along in moved)
    assert max(across for across, _ in moved) == pytest.approx(min(across for across, _ in moved), abs=0.05)
    # The problem on screen is another one.
    assert "no_fly_zones" not in state(page, "problem")


def test_a_shape_that_is_given_up_or_crosses_itself_is_not_told(page, service):
    page.expected_troubles.append("422")
    square = {"id": "square", "polygon": [[20, 20], [30, 20], [30, 30], [20, 30]]}
    mission = Mission(service, {**SMALL, "no_fly_zones": [square]}).search_ends().open(page)
    select(page, "no_fly_zones", "square")
    page.locator(".corner[data-corner='0']").press("Delete")
    form = page.locator("form[data-form=zones_changed]")
    expect(form).to_contain_text("3 corners")
    form.get_by_role("button", name="Cancel").click()
    expect(page.locator(".corner:not(.between, .whole)")).to_have_count(4)
    page.locator(".corner[data-corner='0']").press("Alt+ArrowDown")
    form.get_by_label("x of corner 1").fill("40")
    form.get_by_label("x of corner 1").press("Enter")
    form.get_by_label("y of corner 1").fill("25")
    form.get_by_label("y of corner 1").press("Enter")
    expect(form.locator("#zone-fault")).to_contain_text("crosses")
    tell(page)
    expect(form.locator(".violations li")).to_contain_text("cross")
    assert mission.read()["state"]["problem"]["no_fly_zones"][0]["polygon"] == square["polygon"]
    # Back where it was, nothing is left to tell.
    for axis in "xy":
        form.get_by_label(f"{axis} of corner 1").fill("20")
        form.get_by_label(f"{axis} of corner 1").press("Enter")
    expect(form).to_have_count(0)
    # In another view there is nothing to take hold of.
    go(page, "problem")
    expect(page.locator(".corner")).to_have_count(0)


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
    page.get_by_role("button", name="Cancel").click()
