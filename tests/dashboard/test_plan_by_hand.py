"""A plan that is changed by hand: judged at once, kept, taken along, begun with; and never lost."""

import json

import httpx
import pytest
from dashboard_steps import QUICK, go, open_problem, ready, show_answer, state, value
from playwright.sync_api import expect

UAV = {"speed": 1, "loadlist": [9]}
AREA = {"level": 1, "loadlist": [3]}
PROBLEM = {
    "crs": "local",
    "objective": {"distance_weight": 0.001},
    "uavs": [
        {**UAV, "id": "u", "x_s": 0, "y_s": 0, "voyage": 60, "name": "Kestrel"},
        {**UAV, "id": "v", "x_s": 0, "y_s": 10, "voyage": 14},
    ],
    "targets": [
        {**AREA, "id": "a", "x": 10, "y": 0},
        {**AREA, "id": "b", "x": 12, "y": 0, "name": "Village"},
        {**AREA, "id": "c", "x": 0, "y": 14},
    ],
}
PLAN = [["a", "b"], ["c"]]


def assignment(visits):
    index = {target["id"]: j for j, target in enumerate(PROBLEM["targets"])}
    steps = max(map(len, visits))
    return [[index[each[s]] if s < len(each) else 3 for each in visits] for s in range(steps)]


def evaluated(service, visits):
    body = {**PROBLEM, "assignment": assignment(visits)}
    return httpx.post(f"{service.url}/evaluate", json=body, timeout=60).json()


@pytest.fixture
def page(shared_page):
    """One page for all tests: each begins by opening a problem, which replaces what another has left."""
    ready(shared_page)
    go(shared_page, "problem")
    return shared_page


@pytest.fixture
def changing(page, service):
    """The page with a plan of two for `u` and one for `v`, which is being changed."""
    ready(page)
    open_problem(page, PROBLEM)
    answer = show_answer(page, service.url)
    assert [[stop["target_id"] for stop in route["stops"]] for route in answer["routes"]] == PLAN
    go(page, "answer")
    page.get_by_role("button", name="Change this plan").click()
    return page, answer


def act(page, uav, at, what):
    return page.locator(f"#draft-routes tr[data-uav-id={uav}][data-at='{at}'] button[data-act='{what}']")


def visits(page):
    return state(page, "draft")["visits"]


def judged(page, how):
    expect(page.locator("#draft")).to_have_attribute("data-judged", how)


def move(page, uav, at, to, place):
    act(page, uav, at, "Move").click()
    form = page.locator("#draft-routes form")
    form.locator("select[name=uav]").select_option(label=to)
    form.locator("input[name=place]").fill(str(place))
    form.get_by_role("button", name="Move", exact=True).click()


def test_a_visit_that_is_moved_is_judged_at_once_kept_and_taken_along(changing, service):
    page, answer = changing
    act(page, "u", 1, "Earlier").click()
    judged(page, "legal")
    assert visits(page) == [["b", "a"], ["c"]]
    there = evaluated(service, visits(page))
    figures = page.locator("#draft-says data")
    assert value(page.locator("#draft-says")) == there["reward"]
    assert float(figures.nth(1).get_attribute("value")) == pytest.approx(there["reward"] - answer["reward"])
    expect(act(page, "u", 0, "Later")).to_be_focused()
    expect(page.locator("path.route").first).to_have_attribute("data-stops", "b\na")
    arrives = page.locator("#draft-routes tr[data-uav-id=u][data-at='0'] .num data")
    expect(arrives).to_have_attribute("value", "12")

    page.get_by_role("button", name="Keep this plan").click()
    expect(page.locator("#draft")).to_have_count(0)
    kept = state(page, "answer")
    assert kept["assignment"] == assignment([["b", "a"], ["c"]])
    expect(page.locator("#source")).to_have_text("A plan that was changed by hand")
    expect(page.locator("[data-figure=Reward] data")).to_have_attribute("value", str(kept["reward"]))
    assert page.url.endswith(f"#/answer?job={kept['job_id']}")
    go(page, "take-away")
    with page.expect_download() as saved:
        page.locator("#view-take-away button[data-format=csv]").click()
    written = saved.value.path().read_bytes()
    served = httpx.get(f"{service.url}/jobs/{kept['job_id']}/plan", params={"format": "csv"})
    assert written == served.content
    page.locator("body").press("Control+z")
    assert state(page, "answer") == answer
    assert visits(page) == [["b", "a"], ["c"]]


def test_every_broken_rule_is_said_with_its_figures_and_undone(changing):
    page, answer = changing
    page.expected_troubles.append("422")
    move(page, "u", 1, "v", 1)
    judged(page, "refused")
    assert visits(page) == [["a"], ["b", "c"]]
    (said,) = page.locator("#breaches li").all_inner_texts()
    assert said.startswith("v, visit 1 (Village): ")
    assert said.endswith(": needs 31.24, has 14")
    expect(page.locator("#draft-routes tr.broken")).to_have_attribute("data-target-id", "b")
    expect(page.get_by_role("button", name="Keep this plan")).to_be_disabled()
    move(page, "u", 0, "v", 3)
    judged(page, "refused")
    expect(page.locator("#breaches li")).to_have_count(2)
    page.get_by_role("button", name="Take them out").click()
    judged(page, "legal")
    assert visits(page) == [[], ["c"]]
    page.locator("body").press("Control+z")
    judged(page, "refused")
    page.locator("body").press("Control+z")
    page.locator("body").press("Control+z")
    judged(page, "legal")
    assert visits(page) == PLAN
    page.get_by_role("button", name="Leave the plan as it was").click()
    expect(page.locator("#routes")).to_be_visible()
    assert state(page, "answer") == answer


def test_visits_are_removed_added_and_dragged(changing, service):
    page, _ = changing
    act(page, "v", 0, "Remove").click()
    judged(page, "legal")
    assert visits(page) == [["a", "b"], []]
    expect(page.locator("#unmet li")).to_have_attribute("data-target-id", "c")
    page.get_by_role("button", name="Add a visit to Kestrel").click()
    form = page.locator("#draft-routes form")
    form.locator("select[name=area]").select_option("c")
    form.locator("input[name=place]").fill("1")
    form.get_by_role("button", name="Add", exact=True).click()
    judged(page, "legal")
    assert visits(page) == [["c", "a", "b"], []]
    assert value(page.locator("#draft-says")) == evaluated(service, visits(page))["reward"]

    row = "#draft-routes tr[data-uav-id={}][data-at='{}']"
    page.locator(row.format("u", 2)).drag_to(page.locator(row.format("u", 0)))
    assert visits(page) == [["b", "c", "a"], []]
    page.locator(row.format("u", 1)).drag_to(page.locator("#draft-routes tr.head[data-uav-id=v]"))
    assert visits(page) == [["b", "a"], ["c"]]
    judged(page, "legal")


def test_the_next_allocation_begins_with_it_and_is_not_worse(changing):
    page, _ = changing
    act(page, "u", 1, "Earlier").click()
    judged(page, "legal")
    reward = value(page.locator("#draft-says"))
    page.get_by_role("button", name="Begin the next allocation with it").click()
    expect(page.locator("[data-begins=plan]")).to_contain_text("Begins with a plan of 3 visits")
    assert state(page, "problem")["start_plan"] == assignment([["b", "a"], ["c"]])
    page.select_option("select[name=algorithm]", "local_search")
    page.fill("input[name=time_limit_s]", "0.3")
    page.click("#start")
    expect(page.locator("#figures")).to_be_visible()
    answer = state(page, "answer")
    assert answer["reward"] >= reward
    assert answer["changes"] is not None
    news = page.locator("#news .notice", has_text="set aside")
    news.get_by_role("button", name="Undo").click()
    assert visits(page) == [["b", "a"], ["c"]]

    go(page, "problem")
    with page.expect_download() as saved:
        page.click("[data-export=JSON]")
    assert json.loads(saved.value.path().read_text())["start_plan"] == assignment([["b", "a"], ["c"]])
    go(page, "allocate")
    page.get_by_role("button", name="Begin anew").click()
    assert "start_plan" not in state(page, "problem")


def test_a_change_survives_a_reload_and_a_service_that_is_away(changing):
    page, _ = changing
    page.expected_troubles.append("ERR_FAILED")
    page.route("**/evaluate", lambda route: route.abort())
    act(page, "u", 0, "Remove").click()
    judged(page, "trouble")
    expect(page.locator("#draft-says")).to_contain_text("The service cannot be reached")
    assert visits(page) == [["b"], ["c"]]
    page.unroute("**/evaluate")
    page.get_by_role("button", name="Ask again").click()
    judged(page, "legal")
    page.wait_for_selector("html[data-kept=true]")
    page.reload()
    ready(page)
    judged(page, "legal")
    assert visits(page) == [["b"], ["c"]]
    page.locator("body").press("Control+z")
    assert visits(page) == PLAN


def test_another_plan_or_problem_takes_no_change_away(changing):
    page, _ = changing
    act(page, "u", 0, "Remove").click()
    judged(page, "legal")
    go(page, "allocate")
    page.select_option("select[name=algorithm]", QUICK["algorithm"])
    page.click("#start")
    expect(page.locator("#figures")).to_be_visible()
    assert state(page, "draft") is None
    page.locator("body").press("Control+z")
    assert visits(page) == [["b"], ["c"]]
    open_problem(page, {**PROBLEM, "max_steps": 4})
    assert state(page, "draft") is None
    page.locator("body").press("Control+z")
    assert visits(page) == [["b"], ["c"]]
    expect(page.locator("#draft")).to_be_visible()
