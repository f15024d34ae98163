"""How a dispatcher begins: one button to plan, the rest under Advanced; fleets of a type, more like one."""

import pytest
from dashboard_steps import PATIENCE_MS, begin_again, go, open_problem, ready, state
from page_modules import MODULES, run_module
from playwright.sync_api import expect

TRUCK = {"id": "mid-2", "x_s": 34.8, "y_s": -19.8, "speed": 90, "voyage": 120, "loadlist": [3], "capacity": 5}
FIELD = {
    "crs": "wgs84",
    "uavs": [
        {
            **TRUCK,
            "name": "Kite",
            "x_c": 34.9,
            "y_c": -19.9,
            "dis": 12,
            "committed": ["a"],
            "skills": ["medic"],
        },
        {**TRUCK, "id": "mid-4"},
    ],
    "targets": [{"id": "a", "x": 34.7, "y": -19.6, "level": 1, "loadlist": [5]}],
    "bases": [{"id": "port", "x": 34.84, "y": -19.83, "name": "Port of Beira"}],
}


@pytest.fixture
def newcomer(browser, service):
    """A page on which *Advanced* was never opened."""
    context = browser.new_context(viewport={"width": 1366, "height": 900})
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(service.url)
    ready(page)
    yield page
    context.close()


def test_one_button_leads_from_the_problem_to_a_plan(newcomer):
    page = newcomer
    page.click("#plan")
    expect(page.locator("#job-status")).to_be_visible()
    expect(page.locator("select[name=algorithm]")).to_be_hidden()
    expect(page.locator("input[name=seed]")).to_be_hidden()
    expect(page.locator("#search")).to_have_text(
        "The search (auto) takes at most 5 s, and can be stopped before: the best plan so far is kept."
    )
    expect(page.locator("#view-answer")).to_be_visible()
    assert state(page, "answer")["algorithm"] == "auto"
    assert len(state(page, "past")) == 0


def test_what_is_advanced_is_found_open_by_who_opened_it(newcomer):
    page = newcomer
    go(page, "allocate")
    expect(page.locator("select[name=algorithm]")).to_be_hidden()
    page.click("#advanced > summary")
    page.select_option("select[name=algorithm]", "ga")
    page.fill("input[name=time_limit_s]", "")
    page.press("input[name=time_limit_s]", "Tab")
    expect(page.locator("#search")).to_have_text(
        "The search (ga) has no time limit: it ends by itself, or when you stop it."
    )
    page.reload()
    ready(page)
    go(page, "allocate")
    expect(page.locator("select[name=algorithm]")).to_be_visible()
    page.click("#advanced > summary")
    page.reload()
    ready(page)
    go(page, "allocate")
    expect(page.locator("select[name=algorithm]")).to_be_hidden()


def test_a_refusal_opens_what_is_advanced_at_its_field(newcomer):
    page = newcomer
    go(page, "allocate")
    page.click("#advanced > summary")
    page.fill("input[name=time_limit_s]", "-1")
    page.click("#advanced > summary")
    page.click("#start")
    expect(page.locator("[data-pointer='/time_limit_s'] .error")).to_be_visible()


FLEET = """
    const { fleetOf, uavsLike } = await load("fleet.js");
    const { TYPES } = await load("fleet_types.js");
    return {
        fleets: given.problems.map((problem) => fleetOf(problem, { name: "T", speed: 9, voyage: 8, load: 10 }, 2, { x: 1, y: 2 })),
        like: uavsLike(given.problems[0].uavs, given.problems[0].uavs[0], 3),
        types: TYPES,
    };
"""  # noqa: E501 - a line of JavaScript


def test_a_fleet_carries_what_its_type_can_lift_and_has_names_of_its_own():
    areas = [{"loadlist": [1, 1]}]
    weights = [{"weight": 3}, {"weight": 4}]
    found = run_module(
        FLEET,
        {
            "problems": [
                FIELD,
                {"uavs": [], "targets": areas},
                {"uavs": [], "targets": areas, "materials": weights},
                {"uavs": [{"id": "uav-1", "name": "T 1", "loadlist": [0]}], "targets": []},
            ]
        },
    )
    one, two, weighed, named = found["fleets"]
    assert [(uav["id"], uav["name"]) for uav in one] == [("uav-3", "T 1"), ("uav-4", "T 2")]
    assert one[0] == {
        "id": "uav-3", "name": "T 1", "x_s": 1, "y_s": 2, "speed": 9, "voyage": 8, "loadlist": [10],
    }  # fmt: skip
    assert two[0]["loadlist"] == [5, 5]
    # 5 kg a kind: one of 3 kg and one of 4 kg; of the 3 kg left, one more of the first.
    assert (weighed[0]["loadlist"], weighed[0]["capacity"]) == ([2, 1], 10)
    assert [(uav["id"], uav["name"]) for uav in named] == [("uav-2", "T 2"), ("uav-3", "T 3")]


def test_the_manual_has_the_figures_of_every_type():
    manual = (MODULES.parent / "README.md").read_text("utf-8")
    for each in run_module(FLEET, {"problems": [FIELD]})["types"]:
        assert f"| {each['name']} | {each['speed']} | {each['voyage']} | {each['load']} |" in manual


def test_more_like_one_begin_at_its_base_with_nothing_behind_them():
    like = run_module(FLEET, {"problems": [FIELD]})["like"]
    assert [uav["id"] for uav in like] == ["mid-3", "mid-5", "mid-6"]
    assert like[0] == {**TRUCK, "id": "mid-3", "skills": ["medic"]}


def test_a_fleet_is_added_at_a_base_and_where_the_map_is_clicked(shared_page):
    page = begin_again(shared_page)
    open_problem(page, FIELD)
    page.click("#fleet > summary")
    page.locator("select[name=fleet-type]").select_option(label="VTOL")
    page.locator("#fleet").get_by_label("How many").fill("3")
    page.locator("select[name=fleet-place]").select_option(label="Port of Beira")
    page.click("[data-add=fleet]")
    expect(page.locator("[data-table=uavs]")).to_have_text("UAVs 5")
    added = state(page, "problem")["uavs"][2:]
    assert [(uav["name"], uav["x_s"], uav["speed"], uav["voyage"], uav["loadlist"]) for uav in added] == [
        (f"VTOL {n}", 34.84, 100, 75, [4.5]) for n in (1, 2, 3)
    ]
    page.locator("body").press("Control+z")
    expect(page.locator("[data-table=uavs]")).to_have_text("UAVs 2")

    page.locator("select[name=fleet-place]").select_option(label="where I click on the map")
    page.click("[data-add=fleet]")
    page.locator("#map").click(position={"x": 60, "y": 120})
    expect(page.locator("[data-table=uavs]")).to_have_text("UAVs 5")
    page.locator("#map").click(position={"x": 90, "y": 150})
    expect(page.locator("[data-table=uavs]")).to_have_text("UAVs 5")

    page.locator("#fleet").get_by_label("How many").fill("many")
    page.click("[data-add=fleet]")
    expect(page.locator("#alerts .notice")).to_contain_text("“many”")
    page.click("#fleet > summary")


def test_more_of_the_selected_uav_are_added_in_one_step(shared_page):
    page = begin_again(shared_page)
    open_problem(page, FIELD)
    page.evaluate(
        "async () => (await import('/dashboard/js/state.js')).select({ kind: 'uavs', id: 'mid-4' })"
    )
    page.locator("#view-problem .card").get_by_label("More UAVs").fill("2")
    page.click("[data-add=like]")
    assert [uav["id"] for uav in state(page, "problem")["uavs"]] == ["mid-2", "mid-4", "mid-5", "mid-6"]
    page.locator("body").press("Control+z")
    assert len(state(page, "problem")["uavs"]) == 2


def test_the_first_uav_on_the_globe_can_fly_somewhere(shared_page):
    page = begin_again(shared_page)
    open_problem(page, {"crs": "wgs84", "uavs": [], "targets": []})
    page.evaluate("async () => (await import('/dashboard/js/problem.js')).place('uavs', { x: 1, y: 2 })")
    (uav,) = state(page, "problem")["uavs"]
    assert (uav["speed"], uav["voyage"], uav["loadlist"]) == (45, 15, [2.5])


@pytest.mark.parametrize(
    ("column", "text", "limit"),
    [
        ("speed", "-5", "it has to be more than 0"),
        ("y_s", "200", "it has to be from \u221290 to 90"),
        ("loadlist/0", "-1", "it has to be at least 0"),
    ],
)
def test_a_number_beyond_its_limits_is_marked_at_once(shared_page, column, text, limit):
    page = begin_again(shared_page)
    page.click("[data-table=uavs]")
    cell = page.locator(f"table[data-kind=uavs] tr[data-id=long-1] td[data-column='{column}']")
    cell.dblclick()
    page.keyboard.type(text)
    page.keyboard.press("Enter")
    expect(cell).to_have_attribute("title", limit)
    page.locator("body").press("Control+z")
    expect(page.locator("table[data-kind=uavs] [aria-invalid]")).to_have_count(0)
