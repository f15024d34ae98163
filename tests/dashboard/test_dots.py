"""Very many symbols are dots on a canvas; the one that is meant is an element, and does what others do."""

import pytest
from dashboard_steps import PATIENCE_MS, begin_again, go, open_problem, ready, state
from playwright.sync_api import expect

UAV = {"y_s": 30, "speed": 1, "voyage": 99, "loadlist": [1]}
PROBLEM = {
    "uavs": [{**UAV, "id": f"u-{n}", "x_s": 2 * n} for n in range(20)],
    "targets": [
        {"id": f"a-{n}", "x": n % 40, "y": n // 40, "level": 1 + n % 5, "loadlist": [1]} for n in range(640)
    ],
}
ELEMENTS = "#map .symbol:is(.targets, .uavs)"
PAINTED = """([x, y]) => {
    const canvas = document.querySelector("canvas.dots");
    const box = canvas.getBoundingClientRect();
    const at = [(x - box.left) * devicePixelRatio, (y - box.top) * devicePixelRatio];
    const [red, green, blue] = canvas.getContext("2d").getImageData(...at.map(Math.round), 1, 1).data;
    return [red, green, blue];
}"""


@pytest.fixture
def page(shared_page):
    # The map of another kind of positions is made anew, here without animations.
    shared_page.emulate_media(reduced_motion="reduce")
    page = begin_again(shared_page)
    open_problem(page, PROBLEM, "many")
    return page


def place_of(page, item, kind="targets"):
    """Where on the page a symbol is: selecting it makes it an element."""
    page.evaluate(
        "async ([kind, id]) => (await import('/dashboard/js/state.js')).select({ kind, id })", [kind, item]
    )
    box = page.locator(f"{ELEMENTS}[data-id='{item}']").bounding_box()
    page.evaluate("async () => (await import('/dashboard/js/state.js')).select(null)")
    expect(page.locator(f"{ELEMENTS}.selected")).to_have_count(0)
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_dots_are_painted_in_the_colours_of_what_they_stand_for(page):
    colours = page.evaluate(
        """() => ["--urgent-1", "--urgent-5", "--uav-3"].map((name) => {
            const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
            return text.slice(1).match(/../g).map((two) => parseInt(two, 16));
        })"""
    )
    places = [place_of(page, "a-40"), place_of(page, "a-44"), place_of(page, "u-3", "uavs")]
    assert [page.evaluate(PAINTED, place) for place in places] == colours
    assert page.locator(ELEMENTS).count() == 0


def test_the_dot_under_the_pointer_says_what_it_is_and_is_selected_by_a_click(page):
    here, there = place_of(page, "a-300"), place_of(page, "a-500")
    page.mouse.move(*here)
    expect(page.locator(ELEMENTS)).to_have_attribute("data-id", "a-300")
    expect(page.locator("#map .tip")).to_contain_text("a-300")
    page.mouse.move(*there)
    expect(page.locator(ELEMENTS)).to_have_attribute("data-id", "a-500")
    page.mouse.click(*there)
    assert state(page, "selection") == {"kind": "targets", "id": "a-500"}
    expect(page.locator(f"{ELEMENTS}.selected")).to_have_attribute("data-id", "a-500")
    page.mouse.move(*here)
    expect(page.locator(ELEMENTS)).to_have_count(2)
    page.mouse.move(here[0], here[1] - 6)
    page.mouse.move(10, 300)
    expect(page.locator(f"{ELEMENTS}:not(.selected)")).to_have_count(0)


def test_a_dot_is_dragged_and_nudged_where_the_problem_is_changed(page):
    x, y = place_of(page, "a-300")
    before = state(page, "problem")["targets"][300]
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y, steps=4)
    page.mouse.up()
    moved = state(page, "problem")["targets"][300]
    assert moved["x"] > before["x"]
    page.locator("#map").focus()
    page.keyboard.press("Alt+ArrowLeft")
    assert state(page, "problem")["targets"][300]["x"] < moved["x"]
    go(page, "allocate")
    x, y = place_of(page, "a-100")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y, steps=4)
    page.mouse.up()
    assert state(page, "problem")["targets"][100] == PROBLEM["targets"][100]


def test_dots_are_where_they_belong_after_a_pan_and_a_zoom(page):
    page.locator("#map .leaflet-control-zoom-in").click()
    x, y = place_of(page, "a-300")
    colour = page.evaluate(PAINTED, (x, y))
    page.mouse.move(x + 15, y + 8)
    page.mouse.down()
    page.mouse.move(x + 55, y + 38, steps=4)
    page.mouse.up()
    place = place_of(page, "a-300")
    assert place == pytest.approx((x + 40, y + 30), abs=1.5)
    assert page.evaluate(PAINTED, place) == colour
    page.mouse.move(*place)
    expect(page.locator(ELEMENTS)).to_have_attribute("data-id", "a-300")


def test_a_finger_selects_a_dot(browser, service):
    context = browser.new_context(
        has_touch=True, viewport={"width": 820, "height": 1180}, reduced_motion="reduce"
    )
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(service.url)
    ready(page)
    open_problem(page, PROBLEM, "many")
    page.touchscreen.tap(*place_of(page, "a-300"))
    expect(page.locator(f"{ELEMENTS}.selected")).to_have_attribute("data-id", "a-300")
    context.close()
