"""Plans that are proposed, and a day that two dispatchers fly by them."""

import math
import time

import pytest
from dashboard_steps import open_problem, ready, show_answer, state, value
from mission_steps import SMALL, Mission, at_the_newest, look_at, newest, select, tell, without_a_mission
from playwright.sync_api import expect
from referee import replay

from app.api.openapi_examples import example_problem

WITHIN_S = 10


@pytest.fixture
def page(shared_page):
    yield from without_a_mission(shared_page)


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


PROPOSED = """async () => {
    const { Proposals } = await import("/dashboard/js/missions/proposals.js");
    const uav = { id: "u", x_s: 0, y_s: 0, speed: 1, voyage: 9, loadlist: [1] };
    const area = { id: "a", name: "Town", x: 1, y: 1, level: 1, loadlist: [2] };
    const problem = { uavs: [uav], targets: [area] };
    const stops = [{ target_id: "a", step: 1 }, { base_id: "port", step: 2 }];
    const differences = { uavs: [{ uav_id: "u", before: [], after: stops }], visits_changed: 1 };
    const proposal = { number: 2, status: "open", gained: 0.5, routes: [], differences };
    const head = { id: "m", state: { problem }, planning: {} };
    const card = new Proposals(() => {});
    card.draw({ head, plan: { number: 1, routes: [] }, proposals: [proposal] });
    return card.element.querySelector("[data-testid=proposal-stops] tr[data-uav=u]").textContent;
}"""


def test_a_proposal_with_a_reload_names_the_base(shared_page):
    ready(shared_page)
    assert shared_page.evaluate(PROPOSED) == "uhomeTown → base port"
