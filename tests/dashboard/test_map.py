"""The map: all of it in sight at every size, colours that stay, what is selected stands out."""

import re

import pytest
from dashboard_steps import go, open_problem, ready, show_answer
from playwright.sync_api import expect

IN_SIGHT = """() => {
    const map = document.getElementById("map").getBoundingClientRect();
    return [...document.querySelectorAll(".symbol.targets")].every((symbol) => {
        const { left, right, top, bottom } = symbol.getBoundingClientRect();
        return left >= map.left && right <= map.right && top >= map.top && bottom <= map.bottom;
    });
}"""
LOOKS = """() => Object.fromEntries([...document.querySelectorAll(".symbol.uavs")].map((symbol) => {
    const { style, classList } = symbol.querySelector("svg");
    const pattern = [...classList].find((name) => name.startsWith("pattern-"));
    return [symbol.dataset.id, [style.getPropertyValue("--own"), pattern].join(" ")];
}))"""


@pytest.mark.parametrize("size", [(1280, 800), (820, 1180), (390, 844)])
def test_all_areas_stay_in_sight_while_the_curve_grows(page, size):
    page.set_viewport_size({"width": size[0], "height": size[1]})
    ready(page)
    go(page, "allocate")
    page.wait_for_function(IN_SIGHT)
    page.select_option("select[name=algorithm]", "ga")
    page.fill("input[name=time_limit_s]", "")
    page.locator("#parameters").evaluate("details => { details.open = true; }")
    page.fill("#parameters input[name=iteration]", "1000000")
    page.click("#start")
    expect(page.locator("#reward-chart .uplot")).to_be_visible()
    page.wait_for_function(IN_SIGHT)
    page.click("#cancel")
    page.wait_for_selector("#figures")
    page.wait_for_function(IN_SIGHT)


def test_the_lines_of_coordinates_fill_a_map_that_grew(page):
    ready(page)
    go(page, "problem")
    page.locator("#view-problem").get_by_role("button", name="Empty", exact=True).click()
    go(page, "allocate")
    page.wait_for_function(
        """() => {
            const drawn = document.querySelector(".graticule").getBoundingClientRect();
            const map = document.getElementById("map").getBoundingClientRect();
            return Math.abs(drawn.height - map.height) < 2 && Math.abs(drawn.width - map.width) < 2;
        }"""
    )


def test_colours_stay_with_their_uavs_and_differ(page):
    ready(page)
    uav = {"x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [1]}
    uavs = [{**uav, "id": f"u{i}", "x_s": i} for i in range(24)]
    area = {"id": "a", "x": 5, "y": 5, "level": 1, "loadlist": [1]}
    open_problem(page, {"uavs": uavs, "targets": [area]})
    expect(page.locator(".symbol.uavs")).to_have_count(24)
    before = page.evaluate(LOOKS)
    assert len(set(before.values())) == 24

    page.evaluate("async () => (await import('/dashboard/js/problem.js')).remove('uavs', 'u3')")
    expect(page.locator(".symbol.uavs")).to_have_count(23)
    assert page.evaluate(LOOKS) == {name: look for name, look in before.items() if name != "u3"}
    page.evaluate("async () => (await import('/dashboard/js/problem.js')).place('uavs', { x: 1, y: 1 })")
    expect(page.locator(".symbol.uavs")).to_have_count(24)
    after = page.evaluate(LOOKS)
    assert {name: look for name, look in after.items() if name in before} == {
        name: look for name, look in before.items() if name != "u3"
    }
    assert len(set(after.values())) == 24
    page.wait_for_selector("html[data-kept=true]")
    page.reload()
    ready(page)
    assert page.evaluate(LOOKS) == after


def test_the_order_of_the_selected_uavs_stops_is_not_dimmed(page, service):
    ready(page)
    answer = show_answer(page, service.url, algorithm="greedy")
    route = next(route for route in answer["routes"] if route["stops"])
    page.evaluate(
        "async (id) => (await import('/dashboard/js/state.js')).select({ kind: 'uavs', id })", route["uav_id"]
    )
    opacity = "(all) => all.map((each) => getComputedStyle(each).opacity)"
    own = page.locator(f".order[data-uav-id='{route['uav_id']}']").evaluate_all(opacity)
    others = page.locator(f".order:not([data-uav-id='{route['uav_id']}'])").evaluate_all(opacity)
    assert own == ["1"] * len(route["stops"])
    assert set(others) == {"0.35"}


def test_the_scale_covers_no_label(shared_page):
    page = shared_page
    ready(page)
    page.wait_for_selector(".leaflet-control-scale-line")
    assert page.evaluate(
        """() => {
            const scale = document.querySelector(".leaflet-control-scale-line").getBoundingClientRect();
            return [...document.querySelectorAll(".graticule text")].every((label) => {
                const box = label.getBoundingClientRect();
                const beside = box.right < scale.left || box.left > scale.right;
                return beside || box.bottom < scale.top || box.top > scale.bottom;
            });
        }"""
    )


def test_numbers_have_one_minus_sign(shared_page):
    page = shared_page
    ready(page)
    minus = page.evaluate(
        "async () => { const { shown } = await import('/dashboard/js/texts.js');"
        " return [-1, -82.27].map((value) => shown(value)); }"
    )
    assert minus == ["−1", "−82.27"]


def test_every_page_has_an_icon(shared_page, service):
    page = shared_page
    ready(page)
    answer = page.request.get(f"{service.url}/favicon.ico")
    assert answer.status == 200
    assert re.match("image/svg", answer.headers["content-type"])


def test_another_map_while_the_first_one_zooms_leaves_no_error(page):
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    ready(page)
    page.evaluate("""() => new Promise((resolve) => {
        document.querySelector(".leaflet-control-zoom-in").click();
        setTimeout(() => {
            const crs = document.querySelector("select[name=crs]");
            crs.value = crs.value === "local" ? "wgs84" : "local";
            crs.dispatchEvent(new Event("change", { bubbles: true }));
            setTimeout(resolve, 600);
        }, 120);
    })""")
    assert errors == []


def test_keys_before_the_map_is_made_leave_no_error(page):
    errors, held = [], []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.route("**/dashboard/settings.json", lambda route: held.append(route))  # noqa: PLW0108
    with page.expect_request("**/dashboard/settings.json"):
        page.reload(wait_until="commit")
    page.keyboard.press("Escape")
    page.keyboard.press("Control+z")
    for route in held:
        route.continue_()
    page.unroute("**/dashboard/settings.json")
    ready(page)
    assert errors == []
