"""Missions on the page begin with what is on screen, are found again, and end."""

import httpx
import pytest
from dashboard_steps import go, open_problem, show_answer, state
from mission_steps import Mission, at_the_newest, without_a_mission
from playwright.sync_api import expect


@pytest.fixture
def page(shared_page):
    yield from without_a_mission(shared_page)


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


def test_a_mission_whose_answer_was_lost_is_begun_once(page, service):
    page.expected_troubles.append("ERR_FAILED")
    keys = []

    def lose_the_first_answer(route):
        if route.request.method != "POST":
            return route.continue_()
        keys.append(route.request.headers["idempotency-key"])
        if len(keys) > 1:
            return route.continue_()
        assert route.fetch().status == 201
        return route.abort()

    def begun():
        listed = httpx.get(f"{service.url}/missions?limit=100").json()["missions"]
        return [each["id"] for each in listed if each["name"] == "Only once"]

    page.route("**/missions", lose_the_first_answer)
    go(page, "missions")
    page.locator("#mission-form input[name=name]").fill("Only once")
    page.locator("#mission-form input[name=time_limit_s]").fill("0.2")
    start = page.get_by_role("button", name="Begin the mission")
    start.click()
    expect(page.locator("#mission-form .violations li", has_text="cannot be reached")).to_be_visible()
    start.click()
    expect(page.locator("#view-missions h2", has_text="Mission Only once")).to_be_visible()
    assert page.url.endswith(f"#/missions/{begun()[0]}")
    assert len(begun()) == 1
    # What is begun after that is another one.
    page.get_by_role("button", name="All missions").click()
    start.click()
    expect(page.locator("#view-missions h2", has_text="Mission Only once")).to_be_visible()
    assert len(begun()) == 2
    assert keys[0] == keys[1] != keys[2]


def test_a_mission_that_is_deleted_says_so(page, service):
    page.expected_troubles.append("404")
    mission = Mission(service).search_ends().open(page)
    mission.delete()
    expect(page.get_by_test_id("mission-trouble")).to_contain_text("may have been deleted")
    page.get_by_role("button", name="All missions").click()
    expect(page.get_by_test_id("missions-status")).to_be_visible()


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
