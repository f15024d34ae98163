"""The map: UAVs that wait as one symbol, names that cover nothing, arrows, legend, what comes into sight."""

import pytest
from dashboard_steps import begin_again, open_problem, show_answer, state
from page_modules import run_module
from playwright.sync_api import expect

UAV = {"x_s": 34.8, "y_s": -19.8, "speed": 100, "voyage": 900, "loadlist": [5]}
BOXES = """(selector) => [...document.querySelectorAll(selector)]
    .filter((each) => getComputedStyle(each).visibility !== "hidden")
    .map((each) => each.getBoundingClientRect())
    .map(({ left, top, right, bottom }) => [left, top, right, bottom])"""
SELECT = "async ([kind, id]) => (await import('/dashboard/js/state.js')).select({ kind, id })"


@pytest.fixture
def page(shared_page):
    """One page for all tests: each begins with the problem that a new page has."""
    return begin_again(shared_page)


def meet(one, other, by=1):
    return (
        one[0] < other[2] - by
        and other[0] < one[2] - by
        and one[1] < other[3] - by
        and other[1] < one[3] - by
    )


def test_uavs_that_wait_at_one_place_are_one_symbol_with_their_number(page):
    uavs = state(page, "problem")["uavs"]
    start = page.locator(".symbol.starts")
    expect(start).to_have_count(1)
    expect(start.locator(".count")).to_have_text(str(len(uavs)))
    expect(page.locator(".symbol.uavs")).to_have_count(0)

    start.click()
    expect(page.locator(".crowd-list button")).to_have_text([uav["id"] for uav in uavs])
    page.locator(".crowd-list button").nth(2).click()
    assert state(page, "selection") == {"kind": "uavs", "id": uavs[2]["id"]}
    assert "selected" in start.get_attribute("class")
    expect(page.locator(".name.chosen")).to_have_text(uavs[2]["id"])

    page.evaluate(
        "async (id) => (await import('/dashboard/js/problem.js'))"
        ".update('uavs', id, { x_c: 35, y_c: -19, dis: 80 })",
        uavs[0]["id"],
    )
    expect(page.locator(".symbol.uavs")).to_have_count(1)
    expect(start.locator(".count")).to_have_text(str(len(uavs) - 1))


def test_a_base_has_the_number_of_the_uavs_that_wait_there(page):
    area = {"id": "a", "x": 35, "y": -19, "level": 1, "loadlist": [1]}
    base = {"id": "port", "x": 34.8, "y": -19.8, "name": "Port"}
    open_problem(page, {"crs": "wgs84", "uavs": [{**UAV, "id": "u"}], "targets": [area], "bases": [base]})
    expect(page.locator(".symbol.bases .count")).to_have_text("1")
    expect(page.locator(".symbol:is(.uavs, .starts)")).to_have_count(0)


def test_a_place_where_uavs_wait_is_dragged_as_one(page):
    before = state(page, "problem")["uavs"]
    page.evaluate("async () => (await import('/dashboard/js/problem.js')).edit(() => ({ targets: [] }))")
    box = page.locator(".symbol.starts").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60, y + 20, steps=5)
    page.mouse.up()
    after = state(page, "problem")["uavs"]
    assert len({(uav["x_s"], uav["y_s"]) for uav in after}) == 1
    assert after[0]["x_s"] > before[0]["x_s"]
    page.locator("body").press("Control+z")
    assert state(page, "problem")["uavs"] == before


def test_names_and_numbers_cover_nothing(page, service):
    show_answer(page, service.url)
    expect(page.locator(".name").first).to_be_attached()
    page.wait_for_timeout(200)
    names, numbers, symbols = (page.evaluate(BOXES, each) for each in (".name", ".order", ".symbol"))
    assert len(names) >= 5
    for kind in (names, numbers):
        assert not [(a, b) for n, a in enumerate(kind) for b in kind[:n] if meet(a, b)]
    assert not [(name, other) for name in names for other in symbols + numbers if meet(name, other, by=3)]


def test_arrows_point_where_uavs_fly(page, service):
    areas = [{"id": "east", "x": 36, "y": -19.8, "level": 1, "loadlist": [5]}]
    open_problem(
        page,
        {
            "crs": "wgs84",
            "uavs": [{**UAV, "id": "u"}],
            "targets": areas,
            "objective": {"distance_weight": 0.0001},
        },
    )
    show_answer(page, service.url)
    turned = page.locator(".arrow path").evaluate_all(
        "all => all.map((each) => each.getAttribute('transform'))"
    )
    angles = [abs(float(each.removeprefix("rotate(").removesuffix(")"))) for each in turned]
    assert angles == [pytest.approx(0, abs=2), pytest.approx(180, abs=2)]


def test_of_a_large_plan_the_selected_route_alone_has_numbers_and_arrows(page, service):
    uavs = [{**UAV, "id": f"u{i}", "x_s": 34 + i / 30} for i in range(90)]
    areas = [{"id": f"a{i}", "x": 34 + i / 30, "y": -19, "level": 1, "loadlist": [5]} for i in range(90)]
    open_problem(
        page, {"crs": "wgs84", "uavs": uavs, "targets": areas, "objective": {"distance_weight": 0.0001}}
    )
    answer = show_answer(page, service.url)
    expect(page.locator("path.route")).to_have_count(90)
    expect(page.locator(".order")).to_have_count(0)
    route = answer["routes"][7]
    page.evaluate(SELECT, ["uavs", route["uav_id"]])
    expect(page.locator(".order")).to_have_count(len(route["stops"]))
    assert page.locator(".arrow").count() == len(route["stops"]) + 1
    page.evaluate("async () => (await import('/dashboard/js/state.js')).select(null)")
    expect(page.locator(".order")).to_have_count(0)


def test_what_is_selected_comes_into_sight_and_the_button_brings_all_back(page):
    for _ in range(6):
        page.get_by_label("Zoom in").click()
    page.evaluate(SELECT, ["targets", "site-15"])
    expect(page.locator(".symbol.targets[data-id=site-15]")).to_be_in_viewport()
    expect(page.locator(".symbol.targets[data-id=site-17]")).not_to_be_in_viewport()
    page.get_by_label("Bring everything into sight").click()
    expect(page.locator(".symbol.targets[data-id=site-17]")).to_be_in_viewport()
    for _ in range(6):
        page.get_by_label("Zoom in").click()
    page.locator("#map").focus()
    page.keyboard.press("f")
    expect(page.locator(".symbol.targets[data-id=site-15]")).to_be_in_viewport()


def test_the_legend_says_what_symbols_mean(page):
    legend = page.locator(".legend")
    legend.locator("summary").press("Enter")
    expect(legend.locator("li").first).to_contain_text("Area")
    assert legend.locator("li").count() >= 8
    legend.locator("summary").press("Enter")


LAY_OUT = """
    const { layOut, Taken } = await load("label_layout.js");
    const taken = new Taken({ left: 0, top: 0, right: 300, bottom: 100 });
    const [wide, narrow] = [{ width: 400, height: 15 }, { width: 60, height: 15 }];
    const label = (x, y, ...sizes) => ({ x, y, half: 5, sizes });
    const spots = [label(40, 50, narrow), label(80, 50, narrow), label(290, 50, narrow)];
    for (const { x, y } of spots) taken.add({ left: x - 5, top: y - 5, right: x + 5, bottom: y + 5 });
    return layOut(taken, [...spots, label(180, 50, wide, narrow), label(2, 2, wide)]);
"""


def test_labels_are_where_there_is_room():
    left, right, edge, smaller, none = run_module(LAY_OUT)
    assert (left["left"], left["top"]) == (10, 56)
    assert (right["left"], right["top"]) == (87, 42.5)
    assert edge["left"] + 60 == 283
    assert smaller["size"] == 1
    assert none is None
