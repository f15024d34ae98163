"""Visits that are locked: seen in the table and on the map, exported, and kept by the next allocation."""

import json

import pytest
from dashboard_steps import go, open_problem, ready, show_answer, state
from playwright.sync_api import expect

PROBLEM = {
    "crs": "local",
    "objective": {"distance_weight": 0.001},
    "uavs": [{"id": "u", "x_s": 0, "y_s": 0, "speed": 1, "voyage": 200, "loadlist": [20], "name": "Kestrel"}],
    "targets": [
        {"id": "a", "x": 10, "y": 0, "level": 1, "loadlist": [3], "name": "Village"},
        {"id": "b", "x": 20, "y": 0, "level": 1, "loadlist": [3]},
        {"id": "c", "x": 30, "y": 0, "level": 1, "loadlist": [3]},
        {"id": "d", "x": 40, "y": 0, "level": 1, "loadlist": [3]},
    ],
}
DETOUR = ["c", "a", "d", "b"]


def plan(page):
    return [stop["target_id"] for stop in state(page, "answer")["routes"][0]["stops"]]


def lock(page, order):
    return page.locator(f".lock[data-uav-id=u][data-at='{order - 1}']")


def committed(page):
    return state(page, "problem")["uavs"][0].get("committed", [])


def pressed(page):
    return page.locator(".lock").evaluate_all("all => all.map((each) => each.ariaPressed === 'true')")


@pytest.fixture
def page(shared_page):
    """One page for all tests: each begins by opening a problem, which replaces what another has left."""
    ready(shared_page)
    go(shared_page, "problem")
    return shared_page


def test_what_is_locked_is_seen_exported_and_kept(page, service):
    ready(page)
    open_problem(page, PROBLEM)
    show_answer(page, service.url)
    first = plan(page)
    go(page, "answer")
    lock(page, 3).click()
    assert committed(page) == first[:3]
    expect(page.locator("#locks-say")).to_contain_text("locked too")
    assert pressed(page) == [True, True, True, False]
    expect(page.locator(".order.locked")).to_have_count(3)
    expect(page.locator("#stale")).to_be_hidden()
    go(page, "allocate")
    expect(page.locator("[data-begins=locked]")).to_have_text("Keeps 3 locked visits of 1 UAV. Unlock all")
    go(page, "problem")
    with page.expect_download() as saved:
        page.click("[data-export=JSON]")
    assert json.loads(saved.value.path().read_text())["uavs"][0]["committed"] == first[:3]

    go(page, "answer")
    lock(page, 2).click()
    assert committed(page) == first[:1]
    expect(page.locator("#locks-say")).to_contain_text("unlocked too")
    expect(page.locator(".order.locked")).to_have_count(1)
    page.locator("body").press("Control+z")
    assert pressed(page) == [True, True, True, False]
    go(page, "allocate")
    page.get_by_role("button", name="Unlock all").click()
    assert committed(page) == []


def test_an_allocation_keeps_what_is_locked_though_it_costs_a_detour(page, service):
    ready(page)
    open_problem(page, PROBLEM)
    show_answer(page, service.url)
    go(page, "answer")
    page.get_by_role("button", name="Change this plan").click()
    page.evaluate(
        "async (visits) => (await import('/dashboard/js/drafting.js')).changeDraft([visits])", DETOUR
    )
    expect(page.locator("#draft")).to_have_attribute("data-judged", "legal")
    page.get_by_role("button", name="Keep this plan").click()
    lock(page, 3).press("Enter")
    assert committed(page) == DETOUR[:3]
    page.get_by_role("button", name="Change this plan").click()
    expect(page.locator("#draft-routes .chip", has_text="locked")).to_have_count(3)
    page.get_by_role("button", name="Leave the plan as it was").click()
    go(page, "allocate")
    page.select_option("select[name=algorithm]", "local_search")
    page.fill("input[name=time_limit_s]", "0.3")
    page.click("#start")
    expect(page.locator("#figures")).to_be_visible()
    assert plan(page) == DETOUR
    assert pressed(page) == [True, True, True, False]
    lock(page, 1).click()
    go(page, "allocate")
    page.click("#start")
    expect(page.locator("#figures")).to_be_visible()
    assert plan(page) != DETOUR


def test_what_is_promised_beside_the_plan_stays_promised(page, service):
    ready(page)
    short = {**PROBLEM, "uavs": [{**PROBLEM["uavs"][0], "loadlist": [6]}]}
    open_problem(page, short)
    show_answer(page, service.url)
    visits = plan(page)
    other = next(name for name in "abcd" if name not in visits)
    page.evaluate(
        "async (id) => (await import('/dashboard/js/problem.js')).update('uavs', 'u', { committed: [id] })",
        other,
    )
    go(page, "answer")
    lock(page, 1).click()
    assert committed(page) == [visits[0], other]
    lock(page, 1).click()
    assert committed(page) == [other]
