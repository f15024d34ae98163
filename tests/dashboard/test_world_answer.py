"""Detours, zones, wind, waiting and names on the page, and a mission that follows them."""

import math

import pytest
from dashboard_steps import go, open_problem, ready, show_answer, state
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
    first, second = page.locator("#routes tbody tr").all()
    expect(first).to_contain_text("Kestrel")
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


def test_the_mission_follows_the_way(shown):
    page, _ = shown
    go(page, "field")
    assert "Kestrel" in page.get_by_test_id("field-uavs").inner_text()
    page.locator("#field-time").fill("8.5")
    page.locator("#field-time").dispatch_event("change")
    expect(page.get_by_test_id("field-uavs")).to_contain_text("to Village")
    assert state(page, "mission")["clock"] == 8.5


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


def at(problem, *times):
    """What the UAV does at moments of the plan."""
    code = """
        const { uavAt } = await load("mid_mission.js");
        return given.times.map((time) => uavAt(given.problem, given.answer, 0, time));
    """
    return run_module(code, {"problem": problem, "answer": ANSWER, "times": times})


def test_where_a_uav_is_on_its_way():
    # It waits on the ground from 1 to 4, flies the 10 in 5, serves until 9.5, waits again from 10 to 12.
    before, under_way, serving, waiting, home = at(STILL, 3.0, 5.25, 9.25, 11.0, 16.0)
    assert (before["place"], before["doing"], before["flown"]) == ([0, 0], "waiting", 0)
    assert under_way["place"] == pytest.approx([2.0, -1.5])
    assert under_way["flown"] == pytest.approx(2.5)
    assert under_way["ahead"][1:] == [[4, -3], [8, 0]]
    assert (serving["place"], serving["doing"], serving["done"]) == ([8, 0], "unloading", 1)
    assert (waiting["place"], waiting["doing"], waiting["done"]) == ([9, 0], "waiting", 1)
    length = 2 * math.hypot(4, 4) + 1
    assert home["doing"] == "returning"
    assert home["place"] == pytest.approx([4.5, 4.0])
    assert home["flown"] == pytest.approx(11 + 12 / 2)
    assert length > 12  # the answer's lengths are taken, not the page's own


def test_in_wind_range_is_left_as_the_answer_says():
    windy = {**ANSWER["routes"][0]["stops"][0], "range_left": 45.0}
    answer = {**ANSWER, "routes": [{**ANSWER["routes"][0], "stops": [windy]}]}
    code = """
        const { uavAt } = await load("mid_mission.js");
        return [6.5, 9.2].map((time) => uavAt(given.problem, given.answer, 0, time).flown);
    """
    assert run_module(code, {"problem": PROBLEM, "answer": answer}) == pytest.approx([7.5, 15.0])


def test_the_problem_at_a_moment_has_its_times_on_the_same_clock():
    problem = {
        **STILL,
        "uavs": [
            {**STILL["uavs"][0], "endurance": 30, "available_until": 40, "committed": ["a", "b"]},
        ],
        "start_plan": [[1], [0]],
        "objective": {"change_weight": 0.1},
    }
    code = """
        const { problemAt, remainder, missionEnd, moments } = await load("mid_mission.js");
        const { problem, answer } = given;
        return [
            problemAt(problem, answer, 9.25), remainder(problem, answer, 5.25),
            missionEnd(problem, answer), moments(problem, answer),
        ];
    """
    now, rest, end, moments = run_module(code, {"problem": problem, "answer": ANSWER})
    (uav,) = now["uavs"]
    assert (uav["available_from"], uav["available_until"]) == (0, 30.75)
    assert (uav["airborne"], uav["committed"], uav["loadlist"]) == (5.25, ["b"], [6])
    assert [area["earliest"] for area in now["targets"]] == [0, 2.75]
    assert "start_plan" not in now
    assert now["objective"] == {"distance_weight": 0.001}
    (route,) = rest
    assert route["stops"][0]["path"] == [pytest.approx([2.0, -1.5]), [4, -3], [8, 0]]
    assert [stop["begin_time"] for stop in route["stops"]] == [3.75, 6.75]
    assert route["landing"]["time"] == 14.75
    assert end == 20
    assert moments == [0, 6, 9, 9.5, 10, 12, 20]
