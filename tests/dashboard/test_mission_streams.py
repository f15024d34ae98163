"""Every tab has what happens elsewhere, and what is sent counts once, over connections that are lost."""

import pytest
from dashboard_steps import go, ready, state
from mission_steps import Mission, at_the_newest, select, tell, without_a_mission
from playwright.sync_api import expect


@pytest.fixture
def page(shared_page):
    yield from without_a_mission(shared_page)


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
