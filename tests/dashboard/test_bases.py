"""Bases, reloads and flights on the page."""

import pytest
from dashboard_steps import go, open_problem, ready, show_answer, state
from page_modules import run_module
from playwright.sync_api import expect

UAV = {"x_s": 0, "y_s": 0, "speed": 2, "voyage": 60, "loadlist": [3], "full_load": [4]}
AREA = {"level": 1, "service_time": 0.5}
PROBLEM = {
    "uavs": [{**UAV, "id": "u", "name": "Kestrel"}],
    "targets": [
        {**AREA, "id": "a", "x": 8, "y": 0, "loadlist": [3], "name": "Village"},
        {**AREA, "id": "b", "x": 14, "y": 0, "loadlist": [4], "earliest": 30},
    ],
    # A base may have the id of an area.
    "bases": [{"id": "a", "x": 10, "y": 0, "stock": [9], "turnaround": 1, "name": "Depot"}],
    "objective": {"distance_weight": 0.001},
    "crs": "local",
}


@pytest.fixture
def page(shared_page):
    """One page for all tests: each begins by opening a problem, which replaces what another has left."""
    ready(shared_page)
    go(shared_page, "problem")
    return shared_page


@pytest.fixture
def shown(page, service):
    """The page with a plan in which a UAV reloads, and the answer."""
    ready(page)
    open_problem(page, PROBLEM)
    answer = show_answer(page, service.url)
    assert [stop["kind"] for stop in answer["routes"][0]["stops"]] == ["visit", "reload", "visit"]
    go(page, "answer")
    return page, answer


def test_the_routes_have_reloads_and_flights(shown):
    page, answer = shown
    head, _, reload, last = page.locator("#routes tbody tr").all()
    expect(head).to_contain_text("2 flights")
    expect(head).to_contain_text("to base Depot")
    expect(reload).to_contain_text("base Depot")
    expect(reload).to_contain_text("loads 4")
    expect(reload).to_contain_text("flies on from 6.5")
    expect(last).to_contain_text("on the ground, begins 30")
    # Commitments come before all reloads.
    assert page.locator("#routes button.lock").count() == 1
    stocks = page.locator('#stocks tr[data-base-id="a"]')
    expect(stocks).to_contain_text("Depot")
    assert stocks.locator("data").evaluate_all("all => all.map((each) => each.value)") == ["9", "5"]
    assert answer["bases"] == [{"base_id": "a", "stock": [5.0]}]


def test_the_timeline_has_turnarounds(shown):
    page, _ = shown
    bars = page.locator('.timeline li[data-uav-id="u"] .track span')
    titles = bars.evaluate_all("all => all.map((each) => [each.className, each.title])")
    assert titles[:5] == [
        ["leg", "flight 1, to Village"],
        ["visit", "1. Village at 4: 3 units"],
        ["leg", "flight 1, to base Depot"],
        ["turnaround", "2. base Depot at 5.5: loads 4 units, takes off from 6.5"],
        ["wait", "waits for b on the ground until 28"],
    ]
    assert titles[5] == ["leg", "flight 2, to b"]


def test_the_map_has_a_line_a_flight_and_the_base(shown):
    page, _ = shown
    lines = page.locator("path.route").evaluate_all("all => all.map((each) => each.dataset.flight)")
    assert lines == ["1", "2"]
    assert page.locator(".order").all_inner_texts() == ["1", "2", "3"]
    expect(page.locator(".name[data-kind=bases]")).to_have_text("Depot9 units")
    page.locator(".symbol.bases").hover()
    expect(page.locator(".leaflet-tooltip")).to_contain_text("after the plan 5 units")


def test_a_plan_with_reloads_is_changed_by_hand_and_begun_with(shown):
    page, answer = shown
    page.expected_troubles.append("422")
    page.get_by_role("button", name="Change this plan").click()
    rows = page.locator("#draft-routes tr[data-at]")
    assert [row.locator("td").nth(1).inner_text() for row in rows.all()] == ["Village", "base Depot", "b"]
    page.get_by_role("button", name="Remove: base Depot, visit 2 of Kestrel").click()
    expect(page.locator("#draft")).to_have_attribute("data-judged", "refused")
    page.get_by_role("button", name="Add a visit to Kestrel").click()
    options = page.locator("select[name=area] option").all_inner_texts()
    assert options == ["Village", "b", "base Depot"]
    page.locator("select[name=area]").select_option(label="base Depot")
    page.locator("input[name=place]").fill("2")
    page.locator("tr.asked").get_by_role("button", name="Add").click()
    expect(page.locator("#draft")).to_have_attribute("data-judged", "legal")
    page.locator("#draft").get_by_role("button", name="Begin the next allocation with it").click()
    assert state(page, "problem")["start_plan"] == answer["assignment"][:3] == [[0], [3], [1]]


def test_bases_are_in_the_picture_of_each_plan(shown):
    page, _ = shown
    go(page, "compare")
    page.get_by_role("button", name="Compare", exact=True).click()
    expect(page.locator(".task-picture rect.depot").first).to_be_attached()


def test_bases_are_placed_edited_and_removed(page):
    ready(page)
    open_problem(page, PROBLEM)
    go(page, "problem")
    page.locator("button[data-place=bases]").click()
    page.locator("#map").click(position={"x": 300, "y": 200})
    bases = state(page, "problem")["bases"]
    assert [base["id"] for base in bases] == ["a", "base-2"]
    assert bases[1]["turnaround"] == 1
    grid = page.locator("table.grid[data-kind=bases]")
    expect(grid).to_be_visible()
    cell = grid.locator('tr[data-id="base-2"] td[data-column="stock/0"]')
    cell.dblclick()
    cell.locator("input").fill("12")
    cell.locator("input").press("Enter")
    assert state(page, "problem")["bases"][1]["stock"] == [12]
    cell.dblclick()
    cell.locator("input").fill("")
    cell.locator("input").press("Enter")
    assert "stock" not in state(page, "problem")["bases"][1]
    grid.get_by_role("button", name="Delete base-2").click()
    assert len(state(page, "problem")["bases"]) == 1


REFERENCES = """
    const { withAdded, withRemoved } = await load("references.js");
    const { problem, fields } = given;
    return [
        withRemoved(problem, fields, "bases", 0), withRemoved(problem, fields, "targets", 0),
        withAdded(problem, "targets", { id: "c" }),
    ];
"""


def test_what_names_a_base_follows_it():
    problem = {
        "uavs": [{"id": "u", "bases": ["p", "q"]}, {"id": "v"}],
        "targets": [{"id": "a"}, {"id": "b"}],
        "bases": [{"id": "p"}, {"id": "q"}],
        "start_plan": [[3, 0], [1, 4], [2, 1]],
    }
    fields = {
        "uavs": {"bases": {"type": "array", "items": {"type": "string"}, "idsOf": "bases"}},
        "targets": {},
    }
    gone, without, added = run_module(REFERENCES, {"problem": problem, "fields": fields})
    assert gone["uavs"][0]["bases"] == ["q"]
    assert gone["bases"] == [{"id": "q"}]
    assert gone["start_plan"] == [[1, 0], [2, 3], [2, 1]]
    assert without["start_plan"] == [[2, 1], [0, 3], [1, 0]]
    assert added["start_plan"] == [[4, 0], [1, 5], [3, 1]]
