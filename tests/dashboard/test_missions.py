"""Missions on the page: what the service says is on screen, for every dispatcher, in every tab."""

import json
import math
import re
import threading
import time

import httpx
import pytest
from dashboard_steps import begin_again, go, open_problem, ready, show_answer, state, value
from page_modules import run_module
from playwright.sync_api import expect
from referee import replay

from app.api.openapi_examples import example_problem

WITHIN_S = 10

AREA = {"level": 1, "loadlist": [3], "service_time": 0.5}
UAV = {"x_s": 0, "y_s": 0, "speed": 2, "voyage": 60, "loadlist": [6], "full_load": [6]}
SMALL = {
    "crs": "local",
    "uavs": [{**UAV, "id": "u1"}, {**UAV, "id": "u2"}],
    "targets": [{**AREA, "id": "near", "x": 8, "y": 0}, {**AREA, "id": "far", "x": 0, "y": 14}],
    "bases": [{"id": "depot", "x": 10, "y": 10, "stock": [9], "turnaround": 1}],
    "no_fly_zones": [{"id": "tower", "polygon": [[30, 30], [31, 30], [31, 31]]}],
    "objective": {"distance_weight": 0.001},
    "start_plan": [[0, 1]],
}


@pytest.fixture
def page(shared_page):
    """One page for all tests: each begins with the problem that a new page has, and no mission open."""
    begin_again(shared_page)
    shared_page.evaluate("async () => (await import('/dashboard/js/missions/feed.js')).openMission(null)")
    yield shared_page
    shared_page.unroute_all()


class Mission:
    """A mission as another client of the service sees it."""

    def __init__(self, service, problem=SMALL, **planning):
        body = {"problem": problem, "time_limit_s": 0.2, "algorithm": "local_search", **planning}
        self.url = f"{service.url}/missions"
        self.id = self._ask("POST", json=body).json()["id"]
        self.url += f"/{self.id}"

    def _ask(self, method, path="", **content):
        return httpx.request(method, self.url + path, timeout=60, **content).raise_for_status()

    def read(self, path=""):
        return self._ask("GET", path).json()

    def tell(self, name, **event):
        return self._ask("POST", "/events", json={"id": name, **event}).json()

    def delete(self):
        self._ask("DELETE")

    def types(self):
        return [each["type"] for each in self.read("/events?limit=1000")["events"]]

    def search_ends(self):
        while self.read()["searching"]:
            threading.Event().wait(0.05)
        return self

    def open(self, page):
        """Open it by its address, and wait until it is on screen."""
        page.evaluate("(id) => { location.hash = `#/missions/${id}`; }", self.id)
        expect(page.get_by_test_id("mission-link")).to_have_text("live")
        expect(page.get_by_test_id("mission-UAVs")).to_be_visible()
        return self


def at_the_newest(page, mission):
    """Wait until the page has the newest event, and the state that it made."""
    number = mission.read()["last_number"]
    page.wait_for_function(
        """async (number) => {
            const { events, head, plan } = (await import("/dashboard/js/state.js")).get().openMission;
            const heard = Math.min(events[0].number, head.last_number);
            return heard >= number && plan.number === head.state_number;
        }""",
        arg=number,
    )


def select(page, kind, name):
    page.evaluate(
        "async ([kind, id]) => (await import('/dashboard/js/state.js')).select({ kind, id })", [kind, name]
    )


def tell(page):
    page.get_by_test_id("mission-happened").get_by_role("button", name="Tell").click()


def newest(page, mission, of_type):
    """Wait for the page to have an event of a type; return it as the service has it."""
    row = page.locator(f"[data-testid=mission-log] li[data-type={of_type}]").first
    expect(row).to_be_attached()
    at_the_newest(page, mission)
    return next(each for each in reversed(mission.read("/events")["events"]) if each["type"] == of_type)


def look_at(page, at):
    page.locator("#mission-time").fill(str(at))
    page.locator("#mission-time").press("Tab")


def test_a_mission_is_begun_with_the_problem_and_the_plan_on_screen(page, service):
    answer = show_answer(page, service.url, algorithm="greedy")
    go(page, "missions")
    page.locator("#mission-form input[name=name]").fill("First day")
    page.locator("#mission-form input[name=time_limit_s]").fill("0.2")
    page.get_by_role("button", name="Begin the mission").click()
    expect(page.locator("#view-missions h2", has_text="Mission First day")).to_be_visible()
    (found,) = [
        each
        for each in httpx.get(f"{service.url}/missions").json()["missions"]
        if each["name"] == "First day"
    ]
    assert page.url.endswith(f"#/missions/{found['id']}")
    plan = httpx.get(f"{service.url}/missions/{found['id']}/plan").json()
    assert [[stop["target_id"] for stop in route["stops"]] for route in plan["routes"]] == [
        [stop["target_id"] for stop in route["stops"]] for route in answer["routes"]
    ]
    assert plan["reward"] == pytest.approx(answer["reward"])
    page.get_by_role("button", name="All missions").click()
    assert page.url.endswith("#/missions")
    page.go_back()
    expect(page.locator("#view-missions h2", has_text="Mission First day")).to_be_visible()
    page.go_forward()
    row = page.locator(f"[data-testid=missions] tr[data-mission='{found['id']}']")
    page.once("dialog", lambda dialog: dialog.accept())
    row.get_by_role("button", name="Delete").click()
    expect(row).to_have_count(0)


def test_a_mission_that_cannot_begin_says_why(page, service):
    page.expected_troubles.append("422")
    go(page, "missions")
    page.locator("#mission-form input[name=time_limit_s]").fill("-1")
    page.get_by_role("button", name="Begin the mission").click()
    expect(page.locator("#mission-form [data-pointer='/time_limit_s'] .error")).to_contain_text("more than 0")
    page.locator("#mission-form input[name=time_limit_s]").fill("0.2")
    open_problem(page, {}, "nothing yet")
    page.get_by_role("button", name="Begin the mission").click()
    expect(page.locator("#mission-form .violations li").first).to_contain_text("/problem/uavs")


def expected_state(problem, answer, time):
    """The state at a moment by hand: what each UAV has flown and has aboard; what areas need."""
    needs = {target["id"]: list(target["loadlist"]) for target in problem["targets"]}
    services = {target["id"]: target.get("service_time", 0) for target in problem["targets"]}
    uavs = {}
    for uav, route in zip(problem["uavs"], answer["routes"], strict=True):
        load, flown, clock = list(uav["loadlist"]), 0.0, 0.0
        for stop in route["stops"]:
            if stop["arrival_time"] > time:
                flown += stop["distance"] - (stop["arrival_time"] - max(time, clock)) * uav["speed"]
                break
            flown += stop["distance"]
            clock = stop["arrival_time"] + services[stop["target_id"]]
            for k, amount in enumerate(stop["delivered"]):
                load[k] -= amount
                needs[stop["target_id"]][k] -= amount
        else:
            if route["stops"]:
                flown += min(route["return_distance"], max(0.0, time - clock) * uav["speed"])
        uavs[uav["id"]] = {"left": uav["voyage"] - flown, "load": load}
    return uavs, needs


@pytest.mark.parametrize(("example", "time"), [("cyclone-idai", 0.6), ("paper-5x10", 0.35)])
def test_a_moment_that_is_looked_at_is_the_specifications(page, service, example, time):
    open_problem(page, example_problem(example))
    answer = show_answer(page, service.url, algorithm="local_search", time_limit_s=0.5)
    problem = state(page, "problem")
    mission = Mission(service, {**problem, "start_plan": answer["assignment"]}).open(page)

    look_at(page, time)

    expect(page.get_by_test_id("mission-moment")).to_contain_text(f"This is planned for {time}")
    uavs, needs = expected_state(problem, answer, time)
    for name, expected in uavs.items():
        row = page.locator(f"[data-testid=mission-UAVs] tr[data-uav={name}]")
        assert value(row) == pytest.approx(expected["left"], rel=1e-6)
        assert [float(each) for each in row.locator("td.load").inner_text().split(" · ")] == pytest.approx(
            expected["load"], rel=1e-3, abs=1e-9
        )
    for name, expected in needs.items():
        cell = page.locator(f"[data-testid=mission-areas] tr[data-area={name}] td").nth(1)
        shown = [float(each.get_attribute("value")) for each in cell.locator("data").all()]
        assert shown == pytest.approx(expected, abs=1e-9)
    # The mission itself has not moved.
    assert mission.read()["clock"] == 0
    page.get_by_role("button", name="Back to now").click()
    expect(page.get_by_test_id("mission-moment")).to_have_text("")


def test_the_clock_goes_from_event_to_event_and_is_the_missions(page, service):
    mission = Mission(service).search_ends().open(page)
    page.get_by_role("button", name="Next event").click()
    expect(page.locator("#mission-time")).to_have_value("4")
    page.get_by_role("button", name="Next event").click()
    expect(page.locator("#mission-time")).to_have_value("4.5")
    page.get_by_role("button", name="Event before").click()
    expect(page.locator("#mission-time")).to_have_value("4")
    page.get_by_role("button", name="Move the clock here").click()
    assert newest(page, mission, "clock")["at"] == 4
    expect(page.get_by_test_id("mission-clock")).to_contain_text("4 of")
    expect(page.locator("[data-testid=mission-UAVs] tr[data-uav=u1]")).to_contain_text("at near until 4.5")
    expect(page.locator("[data-testid=mission-UAVs] tr[data-uav=u2]")).to_contain_text("to far, there at 7")
    expect(page.locator("path.committed[data-uav-id=u2]")).to_be_attached()
    mission.tell("later", type="clock", at=5)
    expect(page.get_by_test_id("mission-clock")).to_contain_text("5 of")
    # What was is looked at, and not changed.
    look_at(page, 1)
    expect(page.get_by_test_id("mission-moment")).to_contain_text("This is how it was at 1")
    expect(page.locator("[data-testid=mission-UAVs] tr[data-uav=u1]")).to_contain_text("to near")


def test_the_clock_follows_the_one_on_the_wall_through_a_reload(browser, service):
    mission = Mission(service)
    context = browser.new_context()
    page = context.new_page()
    page.clock.install()
    page.goto(f"{service.url}/#/missions/{mission.id}")
    ready(page)
    expect(page.get_by_test_id("mission-UAVs")).to_be_visible()
    page.locator("input[name=seconds]").fill("10")
    page.get_by_role("button", name="Follow the clock on the wall").click()
    with page.expect_response(re.compile("/events$")):
        page.clock.run_for(1100)
    expect(page.get_by_role("button", name="Halt the clock")).to_be_visible()
    first = mission.read()["clock"]
    assert first >= 0.1
    page.reload()
    ready(page)
    expect(page.get_by_role("button", name="Halt the clock")).to_be_visible()
    with page.expect_response(re.compile("/events$")):
        page.clock.run_for(1100)
    second = mission.read()["clock"]
    assert second > first
    page.get_by_role("button", name="Halt the clock").click()
    expect(page.get_by_role("button", name="Follow the clock on the wall")).to_be_visible()
    context.close()


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


def test_lost_and_changed_make_a_proposal_that_is_seen_and_accepted(page, service):
    open_problem(page, example_problem("cyclone-idai"))
    answer = show_answer(page, service.url, algorithm="local_search", time_limit_s=0.5)
    problem = {**state(page, "problem"), "start_plan": answer["assignment"]}
    lost = max(answer["routes"], key=lambda route: len(route["stops"]))["uav_id"]
    mission = Mission(service, problem, time_limit_s=0.5).search_ends().open(page)
    mission.tell("go", type="clock", at=0.05)
    at_the_newest(page, mission)
    select(page, "uavs", lost)
    page.locator("#mission-acts button[data-type=uav_lost]").click()
    tell(page)
    newest(page, mission, "uav_lost")
    expect(page.locator(f"[data-testid=mission-UAVs] tr[data-uav={lost}]")).to_contain_text("lost")
    mission.search_ends()
    proposal = next(each for each in mission.read("/proposals")["proposals"] if each["status"] == "open")
    card = page.locator(f"[data-proposal='{proposal['number']}'][data-status=open]")
    assert value(card) == proposal["gained"] > 0
    for uav in proposal["differences"]["uavs"]:
        row = card.locator(f"[data-testid=proposal-stops] tr[data-uav={uav['uav_id']}]")
        stops = " → ".join(stop["target_id"] for stop in uav["after"]) or "home"
        expect(row.locator("td").nth(1)).to_have_text(stops)
    page.get_by_role("button", name="Show it on the map").click()
    drawn = {
        each.get_attribute("data-uav-id"): each.get_attribute("data-stops").split("\n")
        for each in page.locator("path.route").all()
    }
    assert drawn == {
        route["uav_id"]: [stop["target_id"] for stop in route["stops"]]
        for route in proposal["routes"]
        if route["stops"]
    }
    page.get_by_role("button", name="Accept").click()
    newest(page, mission, "proposal_accepted")
    plan = mission.read("/plan")
    assert plan["reward"] == pytest.approx(proposal["reward"])
    now = mission.read()["state"]["problem"]
    assert replay(now, plan["assignment"])["reward"] == pytest.approx(plan["reward"])
    assert state(page, "openMission")["plan"] == plan
    page.locator("summary", has_text="earlier").click()
    expect(page.locator(f"li[data-proposal='{proposal['number']}']")).to_contain_text("Was accepted")


def test_a_proposal_is_refused_and_another_is_outdated(page, service):
    without_plan = {key: each for key, each in SMALL.items() if key != "start_plan"}
    mission = Mission(service, without_plan).search_ends().open(page)
    page.get_by_role("button", name="Refuse").click()
    refused = newest(page, mission, "proposal_refused")["event"]["proposal"]
    mission.tell("more", type="level_changed", target_id="near", level=2)
    mission.search_ends()
    outdated = mission.read("/proposals")["proposals"][0]["number"]
    expect(page.locator(f"[data-proposal='{outdated}'][data-status=open]")).to_be_visible()
    mission.tell("still more", type="level_changed", target_id="near", level=3)
    page.locator("#view-missions summary", has_text="earlier").click()
    expect(page.locator(f"li[data-proposal='{outdated}']")).to_contain_text("Outdated")
    expect(page.locator(f"li[data-proposal='{refused}']")).to_contain_text("Was refused")


def test_telemetry_moves_the_uavs_on_the_map(page, service):
    mission = Mission(service).search_ends().open(page)
    mission.tell("go", type="clock", at=1)
    at_the_newest(page, mission)
    seen = [{"uav_id": "u1", "time": 1.5, "x": 2.5, "y": 0.5}]
    mission.tell("seen", type="telemetry", positions=seen)
    row = page.locator("[data-testid=mission-UAVs] tr[data-uav=u1]")
    expect(row.locator("data").last).to_have_attribute("value", "1.5")
    where = """async () => {
        const { get } = await import("/dashboard/js/state.js");
        const { asSeen } = await import("/dashboard/js/missions/doing.js");
        const { head, positions } = get().openMission;
        const { x_c: x, y_c: y } = asSeen(head.state, positions, head.state_number).uavs[0];
        return [x, y];
    }"""
    assert page.evaluate(where) == [2.5, 0.5]
    mission.tell("then", type="clock", at=2)
    at_the_newest(page, mission)
    then = mission.read()["state"]["problem"]["uavs"][0]
    assert page.evaluate(where) == [then["x_c"], then["y_c"]]
    # What is selected here is nothing of the problem on screen.
    select(page, "uavs", "u1")
    go(page, "problem")
    assert state(page, "selection") is None


def test_what_comes_all_the_time_has_one_line_in_the_history(page, service):
    mission = Mission(service).search_ends().open(page)
    for n in range(3):
        mission.tell(f"tick-{n}", type="clock", at=0.1 * n)
    for n, moment in enumerate((0.25, 0.3)):
        seen = [{"uav_id": "u1", "time": moment, "x": 2 * moment, "y": 0}]
        mission.tell(f"seen-{n}", type="telemetry", positions=seen)
    mission.tell("tock", type="clock", at=0.5)
    lines = page.locator("[data-testid=mission-log] li")
    expect(lines.nth(0)).to_have_text("0.5 Time has passed")
    expect(lines.nth(1)).to_have_text("0.3 1 position and 1 before")
    expect(lines.nth(2)).to_have_text("0.2 Time has passed and 2 before")
    mission.tell("tock 2", type="clock", at=0.6)
    expect(lines.first).to_have_text("0.6 Time has passed and 1 before")


def test_what_could_not_be_sent_is_kept_and_counts_once(browser, service):
    """The first time it arrives, and the answer is lost on its way."""
    mission = Mission(service).search_ends()
    context = browser.new_context()
    page = context.new_page()
    page.goto(f"{service.url}/#/missions/{mission.id}")
    ready(page)
    expect(page.get_by_test_id("mission-UAVs")).to_be_visible()

    def lose_the_answer(route):
        route.fetch() if route.request.post_data else None
        route.abort()

    page.route("**/missions/*/events", lose_the_answer)
    select(page, "uavs", "u1")
    page.locator("#mission-acts button[data-type=uav_lost]").click()
    tell(page)
    untold = page.get_by_test_id("mission-untold")
    expect(untold).to_contain_text("u1 is lost")
    assert mission.types().count("uav_lost") == 1
    page.reload()
    ready(page)
    expect(untold).to_contain_text("The service cannot be reached")
    second = context.new_page()
    second.goto(page.url)
    ready(second)
    expect(second.get_by_test_id("mission-untold")).to_contain_text("u1 is lost")

    second.get_by_role("button", name="Send again").click()

    for each in (page, second):
        expect(each.get_by_test_id("mission-untold")).to_be_hidden()
    assert mission.types().count("uav_lost") == 1
    context.close()


def test_after_a_lost_connection_it_goes_on_with_what_has_happened(browser, service):
    mission = Mission(service).search_ends()
    known = mission.read()["last_number"]
    context = browser.new_context()
    page = context.new_page()
    asked = []

    def refuse(route):
        asked.append(route.request.headers["last-event-id"])
        route.abort()

    page.route("**/stream", refuse)
    page.goto(f"{service.url}/#/missions/{mission.id}")
    ready(page)
    link = page.get_by_test_id("mission-link")
    expect(link).to_have_text("not connected")
    page.wait_for_selector("li[data-number]", state="attached")
    mission.tell("go", type="clock", at=1)
    mission.tell("lost", type="uav_lost", uav_id="u2")
    assert [each["number"] for each in state(page, "openMission")["events"]] == list(range(known, 0, -1))
    page.unroute("**/stream")
    expect(link).to_have_text("live")
    at_the_newest(page, mission)
    expect(page.locator("[data-testid=mission-UAVs] tr[data-uav=u2]")).to_contain_text("lost")
    numbers = [each["number"] for each in state(page, "openMission")["events"]]
    assert numbers == list(range(mission.read()["last_number"], 0, -1))
    assert set(asked) == {str(known)}
    context.close()


def test_a_mission_that_is_deleted_says_so(page, service):
    page.expected_troubles.append("404")
    mission = Mission(service).search_ends().open(page)
    mission.delete()
    expect(page.get_by_test_id("mission-trouble")).to_contain_text("may have been deleted")
    page.get_by_role("button", name="All missions").click()
    expect(page.get_by_test_id("missions-status")).to_be_visible()


def test_a_slow_service_is_shown_of_the_newest_moment_only(page, service):
    Mission(service).search_ends().open(page)
    held, asked = [], []

    def hold_the_first(route):
        asked.append(float(route.request.url.partition("at=")[2]))
        held.append(route) if len(asked) == 1 else route.continue_()

    page.route("**/state?at=*", hold_the_first)
    with page.expect_request("**/state?at=*"):
        look_at(page, 1)
    for at in (2, 3):
        look_at(page, at)
    held[0].continue_()
    expect(page.get_by_test_id("mission-moment")).to_contain_text("planned for 3")
    # What was asked first is heard to its end; nothing between is asked for.
    assert asked == [1, 3]
    uav = page.locator("[data-testid=mission-UAVs] tr[data-uav=u1]")
    assert value(uav) == pytest.approx(60 - 3 * 2)


def test_what_remains_is_opened_as_a_problem(page, service):
    mission = Mission(service).search_ends().open(page)
    mission.tell("go", type="clock", at=4.6)
    at_the_newest(page, mission)
    page.get_by_role("button", name="Open what remains as a problem").click()
    expect(page.locator("#view-problem")).to_be_visible()
    opened = state(page, "problem")
    remains = mission.read()["state"]["problem"]
    assert opened["start_plan"] == remains["start_plan"]
    assert [uav["dis"] for uav in opened["uavs"]] == [uav["dis"] for uav in remains["uavs"]]
    answer = show_answer(page, service.url, algorithm="local_search", time_limit_s=0.2)
    assert answer["reward"] >= mission.read("/plan")["reward"] - 1e-9
    page.locator("body").press("Control+z")
    assert state(page, "problem") != opened


def test_two_dispatchers_fly_a_whole_day(browser, service):
    """Each does a part of the work; both have the same on screen, and it is what the service has."""
    problem = example_problem("paper-5x10")
    problem = {key: problem[key] for key in problem if key not in {"algorithm", "time_limit_s"}}
    mission = Mission(service, problem, time_limit_s=0.3)
    contexts = [browser.new_context() for _ in range(2)]
    pages = [context.new_page() for context in contexts]
    troubles = []
    for page in pages:
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.goto(f"{service.url}/#/missions/{mission.id}")
        ready(page)
    first, second = pages

    def accept(page):
        mission.search_ends()
        if any(each["status"] == "open" for each in mission.read("/proposals")["proposals"]):
            page.get_by_role("button", name="Accept").click()
            expect(page.get_by_role("button", name="Accept")).to_have_count(0)

    def both_have_the_same():
        for page in pages:
            at_the_newest(page, mission)
        # Tables are drawn a frame after the state has come.
        end = time.monotonic() + WITHIN_S
        while (tables := [shown(page) for page in pages])[0] != tables[1]:
            assert time.monotonic() < end, tables
            first.wait_for_timeout(20)

    def shown(page):
        return [page.get_by_test_id(f"mission-{name}").inner_text() for name in ("UAVs", "stops ahead")]

    accept(first)
    both_have_the_same()
    for hour in range(3):
        page, other = (first, second) if hour % 2 else (second, first)
        while not (unreported := [each for each in mission.read()["state"]["done"] if not each["reported"]]):
            page.get_by_role("button", name="Next event").click()
            page.get_by_role("button", name="Move the clock here").click()
            expect(page.get_by_role("button", name="Move the clock here")).to_be_hidden()
            both_have_the_same()
        done = unreported[-1]
        other.locator("summary", has_text="Stops done").evaluate(
            "(each) => { each.parentElement.open = true; }"
        )
        other.get_by_role("button", name=f"Report {done['uav_id']} at {done['target_id']}").first.click()
        tell(other)
        expect(page.locator("[data-testid=mission-log] li[data-type=visit_done]")).to_have_count(hour + 1)
        both_have_the_same()
    flying = next(route["uav_id"] for route in mission.read("/plan")["routes"] if route["stops"])
    select(first, "uavs", flying)
    first.locator("#mission-acts button[data-type=uav_lost]").click()
    tell(first)
    expect(second.locator(f"[data-testid=mission-UAVs] tr[data-uav={flying}]")).to_contain_text("lost")
    accept(second)
    both_have_the_same()
    # The day ends when nobody flies any more.
    routes = mission.read("/plan")["routes"]
    ends = max(route["landing"]["time"] for route in routes if route["landing"])
    look_at(first, math.ceil(ends + 1))
    first.get_by_role("button", name="Move the clock here").click()
    expect(second.get_by_test_id("mission-clock")).to_contain_text(f"{math.ceil(ends + 1)} of")
    both_have_the_same()
    second.reload()
    ready(second)
    expect(second.get_by_test_id("mission-UAVs")).to_be_visible()
    both_have_the_same()
    told = mission.read("/replay")
    assert [each["number"] for each in told["events"]] == list(range(1, len(told["events"]) + 1))
    assert (
        told["events"][-1]["state"]
        == mission.read()["state"]
        == state(second, "openMission")["head"]["state"]
    )
    assert mission.types().count("visit_done") == 3
    assert troubles == []
    for context in contexts:
        context.close()


WORDS = """
    const { doing, stopsAhead, brought } = await load("missions/doing.js");
    const { happened, effectOf } = await load("missions/wording.js");
    const { state, plan } = given;
    return {
        doing: state.problem.uavs.map((uav, i) => doing(uav, plan.routes[i], state, (place) => place)),
        ahead: stopsAhead(state.problem, plan).map(({ uav, place, begin }) => [uav.id, place, begin]),
        brought: [...brought(plan)],
        said: given.told.map((each) => [happened(each), effectOf(each)]),
    };
"""


def test_what_uavs_do_and_what_events_did_in_words():
    at_home = {"x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [1]}
    aloft = {**at_home, "x_c": 1, "y_c": 0, "dis": 1, "available_from": 5}
    uavs = [
        {**aloft, "id": "flies"},
        {**aloft, "id": "works", "available_from": 6},
        {**at_home, "id": "waits", "available_from": 5},
        {**aloft, "id": "gone"},
        {**aloft, "id": "back"},
        {**at_home, "id": "idle", "available_from": 5},
        {**at_home, "id": "late", "available_from": 7},
    ]
    visit = {"step": 1, "distance": 3, "delivered": [1]}
    at_8 = {**visit, "target_id": "a", "arrival_time": 8, "begin_time": 8, "departure_time": 8}
    at_9 = {**visit, "target_id": "b", "arrival_time": 8, "begin_time": 9, "departure_time": 9}
    stops = {"flies": [at_8], "waits": [at_9], "works": [{**at_9, "arrival_time": 9}]}
    routes = [
        {
            "uav_id": uav["id"],
            "stops": stops.get(uav["id"], []),
            "landing": {"time": 12 if uav["id"] == "back" else 5},
        }
        for uav in uavs
    ]
    problem = {"uavs": uavs, "targets": [{"id": "a", "loadlist": [2]}, {"id": "b", "loadlist": [2]}]}
    done = [{"uav_id": "works", "target_id": "a", "time": 4, "amounts": [1]}]
    broken = {"uav_id": "u", "target_id": "a", "says": "no range is left"}
    told = [
        {"type": "visit_done", "event": {"uav_id": "u", "target_id": "a", "delivered": [2]}},
        {"type": "uav_lost", "event": {"uav_id": "u"}, "effect": {"broken": [broken], "late": []}},
        {"type": "telemetry", "event": {"positions": [1, 2]}, "passed_over": 2},
    ]
    given = {
        "state": {"clock": 5, "problem": problem, "done": done, "lost": ["gone"]},
        "plan": {"routes": routes},
        "told": told,
    }
    found = run_module(WORDS, json.loads(json.dumps(given)))
    assert found["doing"] == [
        "to a, there at 8",
        "at a until 6",
        "takes off at 6 to b",
        "lost",
        "flies home, there at 12",
        "at its base",
        "waits until 7",
    ]
    assert found["ahead"] == [["flies", "a", 8], ["works", "b", 9], ["waits", "b", 9]]
    assert found["brought"] == [["a", [1]], ["b", [2]]]
    assert found["said"] == [
        ["u visited a, unloaded 2", ""],
        ["u is lost", "u does not stop at a: no range is left"],
        ["2 positions", "2 were older than what is known"],
    ]
