"""What is said of a plan first, in hours, kilometres and materials, and how a remedy is applied."""

import pytest
from dashboard_steps import begin_again, go, open_problem, show_answer, state
from page_modules import run_module
from playwright.sync_api import expect

UAV = {"x_s": 0, "y_s": 0, "speed": 100, "voyage": 900, "loadlist": [5, 2]}
AREA = {"level": 1, "loadlist": [3, 1], "service_time": 0.25}
NAMED = {
    "crs": "wgs84",
    "uavs": [{**UAV, "id": "u", "name": "Kestrel"}],
    "targets": [
        {**AREA, "id": "a", "x": 1, "y": 0, "name": "Village"},
        {**AREA, "id": "b", "x": 2, "y": 0, "name": "Town"},
    ],
    "materials": [{"name": "cholera kits"}, {"name": "food"}],
    "objective": {"distance_weight": 0.0001},
}


@pytest.fixture
def page(shared_page):
    """One page for all tests: each begins with the problem that a new page has."""
    return begin_again(shared_page)


@pytest.fixture
def planned(page, service):
    """The page with a plan of two visits, of which the second lacks a unit, and the answer."""
    open_problem(page, NAMED)
    answer = show_answer(page, service.url)
    assert [stop["target_id"] for stop in answer["routes"][0]["stops"]] == ["a", "b"]
    go(page, "answer")
    return page, answer


def figure(page, name):
    return page.locator(f"#figures [data-figure='{name}']")


def test_the_first_figures_are_those_that_people_ask_for(planned):
    page, answer = planned
    (route,) = answer["routes"]
    last = route["stops"][-1]
    titles = page.locator("#figures > [data-figure]").evaluate_all(
        "all => all.map((each) => each.dataset.figure)"
    )
    assert titles == ["Areas served", "Delivered", "Last delivery", "All home", "Flown", "How sure"]
    expect(figure(page, "Areas served")).to_contain_text("1 of 2")
    expect(figure(page, "Delivered")).to_contain_text("5 of 6 cholera kits, 83 %")
    expect(figure(page, "Delivered")).to_contain_text("2 of 2 food, 100 %")
    unloaded = figure(page, "Last delivery").locator("data").get_attribute("value")
    assert float(unloaded) == pytest.approx(last["arrival_time"] + AREA["service_time"])
    home = float(figure(page, "All home").locator("data").get_attribute("value"))
    assert home == pytest.approx(float(unloaded) + route["return_distance"] / UAV["speed"])
    hours, minutes = divmod(round(home * 60), 60)
    expect(figure(page, "All home")).to_contain_text(f"+{hours}:{minutes:02d}")
    flown = route["distance"] + route["return_distance"]
    assert float(figure(page, "Flown").locator("data").get_attribute("value")) == pytest.approx(flown)
    expect(figure(page, "Flown")).to_contain_text("km")
    expect(figure(page, "How sure")).to_contain_text("not proven")


def test_a_bound_says_how_sure_the_plan_is(page, service):
    open_problem(page, NAMED)
    answer = show_answer(page, service.url, algorithm="local_search", time_limit_s=1, bound=True)
    go(page, "answer")
    assert answer["gap"] is not None
    says = "the best that there is" if answer["gap"] < 1e-5 else "% of the best"
    expect(figure(page, "How sure")).to_contain_text(says)


def test_times_are_of_the_day_once_it_is_known_when_the_plan_begins(planned):
    page, answer = planned
    arrival = answer["routes"][0]["stops"][0]["arrival_time"]
    cell = page.locator("#routes tr[data-target-id=a] data").first
    minutes = round(arrival * 60)
    expect(cell).to_have_text(f"+{minutes // 60}:{minutes % 60:02d}")
    page.locator("input[name=begins]").fill("2026-03-01T23:30")
    later = 23 * 60 + 30 + minutes
    expect(cell).to_have_text(f"{later // 60 % 24:02d}:{later % 60:02d} +1 d")
    ticks = page.locator(".timeline .tick").all_inner_texts()
    assert ticks[0] == "00:00 +1 d"
    page.wait_for_selector("html[data-kept=true]")
    page.reload()
    page.wait_for_selector("html[data-ready]")
    assert page.locator("input[name=begins]").input_value() == "2026-03-01T23:30"
    open_problem(page, NAMED)
    show_state = page.evaluate("async () => (await import('/dashboard/js/units.js')).beginOnTheWall()")
    assert show_state is None


def test_materials_have_their_names_wherever_there_are_amounts(planned):
    page, _ = planned
    expect(page.locator("#routes tr[data-target-id=a]")).to_contain_text("3 cholera kits")
    expect(page.locator("#unmet li[data-target-id=b]")).to_contain_text(
        "lacks 1 cholera kits of 3 cholera kits"
    )
    title = page.locator(".timeline .visit").first.get_attribute("title")
    assert title.endswith(": 3 cholera kits, 1 food")
    page.locator(".symbol.targets[data-id=a]").hover()
    expect(page.locator(".leaflet-tooltip")).to_contain_text("needs 3 cholera kits, 1 food")


def test_a_remedy_is_applied_as_one_step_of_undo(planned):
    page, answer = planned
    (unmet,) = answer["unmet"]
    assert unmet["relaxation"]["more_load"] == [1, 0]
    entry = page.locator("#unmet li[data-target-id=b]")
    expect(entry).to_contain_text("Would help: 1 cholera kits more aboard Kestrel")
    before = state(page, "problem")
    entry.get_by_role("button", name="Apply for b").click()
    assert state(page, "problem")["uavs"][0]["loadlist"] == [6, 2]
    applied = entry.locator("button[data-remedy]")
    expect(applied).to_have_text("Applied")
    expect(applied).to_be_disabled()
    page.locator("body").press("Control+z")
    assert state(page, "problem") == before
    expect(applied).to_have_text("Apply")
    expect(applied).to_be_enabled()


def test_a_visit_that_would_help_is_put_into_the_plan(page, service):
    idle = {**NAMED, "uavs": [{**UAV, "id": "u"}, {**UAV, "id": "v"}]}
    open_problem(page, idle)
    show_answer(page, service.url)
    plan = {
        "routes": [
            {"uav_id": each["id"], "stops": [], "distance": 0, "return_distance": 0} for each in idle["uavs"]
        ]
    }
    helped = {
        "target_id": "a",
        "remaining": [3, 1],
        "code": "not_chosen",
        "reason": "one more visit would earn",
        "uav_id": "v",
        "step": 1,
        "remedy": "v flies there first",
        "relaxation": None,
        "reward_change": 0.9,
    }
    page.evaluate(
        """async ([plan, helped]) => {
            const { get, set } = await import("/dashboard/js/state.js");
            set({ answer: { ...get().answer, ...plan, unmet: [helped] } });
        }""",
        [plan, helped],
    )
    go(page, "answer")
    page.get_by_role("button", name="Add the visit to Village").click()
    expect(page.locator("#draft-routes tr[data-uav-id=v][data-at] td").nth(1)).to_have_text("Village")
    expect(page.locator("#draft")).to_have_attribute("data-judged", "legal")


def test_a_long_answer_is_narrowed_down_and_ordered(page, service):
    answer = show_answer(page, service.url)
    go(page, "answer")
    page.locator("input[name=find]").fill("site-17")
    flown = {route["uav_id"] for route in answer["routes"] if "site-17" in str(route["stops"])}
    expect(page.locator("#routes tr.head")).to_have_count(len(flown))
    rows = page.locator(".timeline li[data-uav-id]").evaluate_all(
        "all => all.map((each) => each.dataset.uavId)"
    )
    assert set(rows) == flown
    expect(page.locator("input[name=find]")).to_be_focused()
    page.locator("input[name=find]").fill("")
    page.locator("select[name=order]").select_option("late")
    uavs = {uav["id"]: uav for uav in state(page, "problem")["uavs"]}
    areas = {area["id"]: area for area in state(page, "problem")["targets"]}

    def home(route):
        last = route["stops"][-1]
        service_time = areas[last["target_id"]].get("service_time", 0)
        return last["arrival_time"] + service_time + route["return_distance"] / uavs[route["uav_id"]]["speed"]

    late = sorted((route for route in answer["routes"] if route["stops"]), key=home, reverse=True)
    expect(page.locator("#routes tr.head")).to_have_count(len(late))
    heads = page.locator("#routes tr.head button").all_inner_texts()
    assert heads == [route["uav_id"] for route in late]


MOMENTS = """
    const { roundMoments, momentText, durationText } = await load("units.js");
    const { set, get } = await load("state.js");
    const [globe, plane] = [{ crs: "wgs84" }, { crs: "local" }];
    const steps = [roundMoments(globe, 3.98), roundMoments(plane, 7)];
    const words = [momentText(globe, 1.698), durationText(globe, 0.51), momentText(plane, 1.698)];
    set({ problem: globe, begins: { opened: get().opened, at: "2026-03-01T07:50" } });
    const ofTheDay = [roundMoments(globe, 2).map((at) => momentText(globe, at)), momentText(globe, 20)];
    return [...steps, ...words, ...ofTheDay];
"""


def test_axes_are_in_round_steps():
    hours, plane, moment, duration, number, of_the_day, tomorrow = run_module(MOMENTS)
    assert hours == [0, 0.5, 1, 1.5, 2, 2.5, 3, 3.5]
    assert plane == [0, 1, 2, 3, 4, 5, 6, 7]
    assert (moment, duration, number) == ("+1:42", "0:31 h", "1.698")
    assert of_the_day == ["08:00", "08:15", "08:30", "08:45", "09:00", "09:15", "09:30", "09:45"]
    assert tomorrow == "03:50 +1 d"


AMOUNTS = """
    const { amountsText } = await load("materials.js");
    const problem = (loadlist, materials) => ({ uavs: [], targets: [{ loadlist }], materials });
    const said = (amounts, materials) => amountsText(problem(amounts, materials), amounts);
    return [
        said([1]), said([24]), said([1, 4]), said([0, 0]), said([2, 3], [{ name: "red cells" }, {}]),
        said([7], [{ name: "water, l" }]),
    ];
"""


def test_amounts_say_what_they_are_of():
    assert run_module(AMOUNTS) == [
        "1 unit",
        "24 units",
        "1 material 1, 4 material 2",
        "nothing",
        "2 red cells, 3 material 2",
        "7 water, l",
    ]


def test_where_nobody_can_fly_why_is_said_first_and_staying_at_home_is_the_best(page, service):
    near = {**NAMED, "uavs": [{**UAV, "id": "u", "voyage": 1}]}
    open_problem(page, near)
    answer = show_answer(page, service.url, algorithm="auto", time_limit_s=20)
    assert {unmet["code"] for unmet in answer["unmet"]} == {"out_of_range"}
    go(page, "answer")
    says = "2 areas: No UAV that carries any of it has the range to fly there, not even directly."
    expect(page.locator("#nobody-flies li")).to_have_text([says])
    expect(figure(page, "How sure")).to_contain_text("No plan earns more: that is proven.")
    open_problem(page, NAMED)
    show_answer(page, service.url)
    expect(page.locator("#nobody-flies")).to_have_count(0)
