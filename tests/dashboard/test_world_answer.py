"""Detours, zones, wind, waiting and names on the page."""

import pytest
from dashboard_steps import go, open_problem, ready, show_answer
from page_modules import run_module
from playwright.sync_api import expect

UAV = {"x_s": 0, "y_s": 0, "speed": 2, "voyage": 60, "loadlist": [9]}
AREA = {"level": 1, "loadlist": [3]}
PROBLEM = {
    "uavs": [{**UAV, "id": "u", "name": "Kestrel", "available_from": 1}],
    "targets": [
        {**AREA, "id": "a", "x": 8, "y": 0, "earliest": 9, "service_time": 0.5, "name": "Village"},
        {**AREA, "id": "b", "x": 9, "y": 0, "earliest": 12},
    ],
    "no_fly_zones": [{"id": "z", "polygon": [[4, -3], [5, -3], [5, 4], [4, 4]], "name": "Airport"}],
    "wind": {"speed": 0.5, "towards": 90},
    "objective": {"distance_weight": 0.001},
    "crs": "local",
}
ANSWER = {
    "distance_weight": 0.001,
    "routes": [
        {
            "uav_id": "u",
            "distance": 20.0,
            "return_distance": 12.0,
            "stops": [
                {
                    "target_id": "a",
                    "step": 1,
                    "arrival_time": 6.0,
                    "distance": 10.0,
                    "delivered": [3.0],
                    "begin_time": 9.0,
                    "departure_time": 9.5,
                    "range_left": 50.0,
                    "endurance_left": None,
                    "path": [[0, 0], [4, -3], [8, 0]],
                },
                {
                    "target_id": "b",
                    "step": 2,
                    "arrival_time": 10.0,
                    "distance": 1.0,
                    "delivered": [3.0],
                    "begin_time": 12.0,
                    "departure_time": 12.0,
                    "range_left": 49.0,
                    "endurance_left": None,
                    "path": None,
                },
            ],
            "landing": {"time": 20.0, "path": [[9, 0], [5, 4], [4, 4], [0, 0]]},
        }
    ],
    "unmet": [],
    "makespan": 20.0,
    "changes": 0,
}
STILL = {name: value for name, value in PROBLEM.items() if name != "wind"}


@pytest.fixture
def page(shared_page):
    """One page for all tests: each begins by opening a problem, which replaces what another has left."""
    ready(shared_page)
    go(shared_page, "problem")
    return shared_page


@pytest.fixture
def shown(page, service):
    """The page with a plan for the problem, and the answer."""
    ready(page)
    open_problem(page, PROBLEM)
    answer = show_answer(page, service.url)
    go(page, "answer")
    return page, answer


def test_the_map_has_ways_zones_wind_and_names(shown):
    page, answer = shown
    (route,) = answer["routes"]
    corners = len(route["stops"][0]["path"]) + len(route["landing"]["path"]) - 2
    assert corners > 3
    drawn = page.locator("path.route").get_attribute("d")
    assert drawn.count("L") == corners + 1
    expect(page.locator("path.no-fly-zone")).to_have_attribute("data-zone-id", "z")
    expect(page.locator(".wind")).to_have_text("wind 0.5 towards 90°")
    page.locator(".symbol.targets").first.hover()
    expect(page.locator(".leaflet-tooltip")).to_contain_text("Village")
    page.evaluate(
        "async () => { const { edit } = await import('/dashboard/js/problem.js');"
        " edit(() => ({ no_fly_zones: [], wind: undefined })); }"
    )
    expect(page.locator("path.no-fly-zone")).to_have_count(0)
    expect(page.locator(".wind")).to_have_count(0)


def test_the_table_and_the_timeline_say_who_waits(shown):
    page, answer = shown
    head, first, second = page.locator("#routes tbody tr").all()
    expect(head).to_contain_text("Kestrel")
    expect(first).to_contain_text("Village")
    expect(first).to_contain_text("on the ground, begins 9")
    expect(second).to_contain_text("begins 12")
    assert "on the ground" not in second.inner_text()
    expect(page.locator('[data-figure="Makespan"] data')).to_have_attribute(
        "value", str(answer["makespan"]).removesuffix(".0")
    )
    expect(page.locator('[data-figure="Changes"]')).to_contain_text("0")
    titles = page.locator(".timeline .wait").evaluate_all("all => all.map((each) => each.title)")
    assert len(titles) == 2
    assert titles[0].startswith("waits for Village on the ground until ")
    assert titles[1] == "waits for b in the air until 12"
    expect(page.locator(".timeline button").first).to_have_text("Kestrel")


def test_a_plan_without_a_world_shows_nothing_of_it(page, service):
    ready(page)
    area = {"id": "a", "x": 8, "y": 0, **AREA}
    plain = {"uavs": [{**UAV, "id": "u"}], "targets": [area], "objective": {"distance_weight": 0.001}}
    open_problem(page, {**plain, "crs": "local"})
    show_answer(page, service.url)
    go(page, "answer")
    expect(page.locator("path.route")).to_have_count(1)
    for gone in (".wind", ".timeline .wait", "path.no-fly-zone", '[data-figure="Makespan"]'):
        expect(page.locator(gone)).to_have_count(0)


def test_when_something_happens_by_the_answers_own_times():
    """It waits on the ground from 1 to 4, flies for 5, serves until 9.5, waits again from 10 to 12."""
    code = """
        const { allTimes, course } = await load("times.js");
        return course(given.problem, allTimes(given.problem, given.answer));
    """
    found = run_module(code, {"problem": STILL, "answer": ANSWER})
    assert found == {"begin": 1, "end": 20, "moments": [1, 9, 9.5, 10, 12, 20]}
