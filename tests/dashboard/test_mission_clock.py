"""The clock of a mission on the page, and moments that are looked at."""

import re

import pytest
from dashboard_steps import open_problem, ready, show_answer, state, value
from mission_steps import Mission, look_at, newest, without_a_mission
from playwright.sync_api import expect

from app.api.openapi_examples import example_problem


@pytest.fixture
def page(shared_page):
    yield from without_a_mission(shared_page)


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
