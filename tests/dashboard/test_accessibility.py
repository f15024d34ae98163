"""Every view and dialog of the dashboard against axe-core's rules of WCAG 2.2 (A, AA), and by keyboard."""

import httpx
import pytest
from axe_playwright_python.base import AXE_SCRIPT
from dashboard_steps import ADVANCED, PATIENCE_MS, begin_again, go, open_problem, ready, show_answer, state
from playwright.sync_api import expect

from app.api.openapi_examples import example_problem

RULES = {
    "resultTypes": ["violations"],
    "runOnly": {
        "type": "tag",
        "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"],
    },
}
AUDIT = """async (rules) => (await axe.run(rules)).violations.map(
    ({ id, nodes }) => [id, nodes.map(({ html }) => html.slice(0, 200))]
)"""
VIEWS = ("problem", "allocate", "answer", "compare", "missions", "library", "take-away", "recent")
FOCUSED = "document.activeElement.id || document.activeElement.textContent"


@pytest.fixture(scope="module")
def auditing(browser, service):
    """The dashboard in a context of its own: the page's policy would refuse the auditor's script."""
    context = browser.new_context(
        viewport={"width": 1366, "height": 900}, bypass_csp=True, reduced_motion="reduce"
    )
    context.set_default_timeout(PATIENCE_MS)
    context.add_init_script(ADVANCED)
    page = context.new_page()
    page.goto(service.url)
    page.evaluate(AXE_SCRIPT)
    yield page
    context.close()


@pytest.fixture
def audited(auditing):
    auditing.set_viewport_size({"width": 1366, "height": 900})
    auditing.emulate_media(color_scheme="light", reduced_motion="reduce")
    return begin_again(auditing)


def violations(page):
    """What axe-core finds, each with the elements it is about."""
    return page.evaluate(AUDIT, RULES)


@pytest.mark.parametrize(("width", "scheme"), [(1366, "light"), (820, "dark")])
def test_no_view_breaks_a_rule(audited, service, width, scheme):
    page = audited
    page.set_viewport_size({"width": width, "height": 1100})
    page.emulate_media(color_scheme=scheme)
    show_answer(page, service.url, algorithm="greedy")
    page.locator(".symbol.targets").first.click()
    faults = {}
    for view in VIEWS:
        go(page, view)
        page.wait_for_load_state("networkidle")
        page.locator(f"#view-{view} details").evaluate_all(
            "all => all.forEach((each) => { each.open = true; })"
        )
        faults[view] = violations(page)
    page.click("#key")
    faults["key"] = violations(page)
    page.click("#key-cancel")
    page.locator("#map").press("?")
    faults["keys"] = violations(page)
    page.keyboard.press("Escape")
    go(page, "problem")
    page.locator("#import").set_input_files(
        {"name": "list.csv", "mimeType": "text/csv", "buffer": b"name,lat,lon,need\nA,1,2,3\nB,1,east,3\n"}
    )
    faults["import"] = violations(page)
    page.keyboard.press("Escape")

    assert {view: found for view, found in faults.items() if found} == {}


def test_no_refusal_and_no_message_breaks_a_rule(audited):
    page = audited
    open_problem(page, {}, "nothing yet")
    go(page, "allocate")
    page.click("#start")
    expect(page.locator("#violations li")).to_have_count(2)
    page.locator("#import").set_input_files(
        {"name": "bad.csv", "mimeType": "text/csv", "buffer": b"kind,id\n?,a\n"}
    )
    expect(page.locator("#alerts .notice")).to_have_count(1)
    # A message goes after a while, unless something in it has the focus.
    close = page.get_by_label("Close this message")
    close.focus()

    assert violations(page) == []
    close.click()
    expect(page.locator("#alerts .notice")).to_have_count(0)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_neither_the_legend_nor_the_list_of_a_place_breaks_a_rule(audited, scheme):
    page = audited
    page.emulate_media(color_scheme=scheme)
    legend = page.locator(".legend summary")
    legend.click()
    page.locator(".symbol.starts").click()
    expect(page.locator(".crowd-list button").first).to_be_visible()
    found = violations(page)
    legend.click()
    page.locator(".leaflet-popup-close-button").click()

    assert found == []


def test_no_zone_breaks_a_rule(audited):
    page = audited
    page.evaluate(
        "async () => (await import('/dashboard/js/problem.js'))"
        ".addZone([[34.5, -19.5], [34.9, -19.5], [34.5, -19.9], [34.9, -19.9]])"
    )
    expect(page.locator("#zone-fault")).to_contain_text("crosses")
    selected = violations(page)
    page.click("[data-draw=zone]")
    page.keyboard.press("Space")
    expect(page.locator("#drawing-says")).to_have_text("1 corner.")

    assert (selected, violations(page)) == ([], [])


def test_no_plan_that_is_locked_or_changed_breaks_a_rule(audited, service):
    page = audited
    show_answer(page, service.url, algorithm="greedy")
    go(page, "answer")
    page.locator(".lock").nth(1).click()
    faults = [violations(page)]
    page.get_by_role("button", name="Change this plan").click()
    page.locator("#draft-routes button[data-act=Later]:not(:disabled)").first.click()
    expect(page.locator("#breaches li")).to_have_count(1)
    page.locator("#draft-routes button[data-act=Move]").first.click()
    faults.append(violations(page))
    page.get_by_role("button", name="Leave the plan as it was").click()
    page.get_by_role("button", name="Begin the next allocation with it").click()
    expect(page.locator("#begins-with li")).to_have_count(2)
    faults.append(violations(page))

    assert faults == [[], [], []]


def test_bases_and_answers_with_reloads_are_accessible(audited, service):
    page = audited
    uav = {"id": "u", "x_s": 0, "y_s": 0, "speed": 2, "voyage": 60, "loadlist": [3], "full_load": [4]}
    areas = [{"id": f"a{x}", "x": x, "y": 0, "level": 1, "loadlist": [3]} for x in (8, 14)]
    depot = {"id": "depot", "x": 10, "y": 0, "stock": [9], "turnaround": 1}
    open_problem(page, {"uavs": [uav], "targets": areas, "bases": [depot], "crs": "local"})
    answer = show_answer(page, service.url)
    assert len(answer["routes"][0]["stops"]) == 3
    go(page, "answer")
    faults = [violations(page)]
    page.get_by_role("button", name="Change this plan").click()
    faults.append(violations(page))
    go(page, "problem")
    page.locator("button[data-table=bases]").click()
    faults.append(violations(page))
    assert faults == [[], [], []]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_mission_breaks_a_rule(audited, service, scheme):
    page = audited
    page.emulate_media(color_scheme=scheme)
    problem = example_problem("cyclone-idai")
    problem = {key: problem[key] for key in problem if key not in {"algorithm", "time_limit_s"}}
    begun = {"problem": problem, "time_limit_s": 0.2, "name": "audited"}
    mission = httpx.post(f"{service.url}/missions", json=begun, timeout=60).raise_for_status().json()["id"]
    go(page, "missions")
    faults = [violations(page)]
    page.get_by_role("button", name="Open mission audited").first.click()
    expect(page.get_by_role("button", name="Accept")).to_be_visible()
    faults.append(violations(page))
    page.get_by_role("button", name="Accept").click()
    expect(page.locator("li[data-type=proposal_accepted]")).to_be_attached()
    page.locator("[data-testid=mission-UAVs] tbody button").first.click()
    page.route("**/events", lambda route: route.abort())
    for event in ("uav_lost", "visit_done"):
        page.locator(f"#mission-acts button[data-type={event}]").click()
        if event == "uav_lost":
            page.get_by_test_id("mission-happened").get_by_role("button", name="Tell").click()
            expect(page.get_by_test_id("mission-untold")).to_be_visible()
    page.unroute("**/events")
    page.locator("#view-missions details").evaluate_all("all => all.forEach((each) => { each.open = true; })")
    faults.append(violations(page))
    page.get_by_role("button", name="Discard").click()
    page.get_by_role("button", name="All missions").click()
    httpx.delete(f"{service.url}/missions/{mission}", timeout=60).raise_for_status()

    assert faults == [[], [], []]


def test_the_dialog_keeps_the_focus_and_gives_it_back(page):
    ready(page)
    page.locator("#key").press("Enter")
    expect(page.locator("#key-input")).to_be_focused()
    visited = set()
    for _ in range(8):
        page.keyboard.press("Tab")
        visited.add(page.evaluate(FOCUSED))
    page.keyboard.press("Shift+Tab")
    # The browser's own frame is on the way too; no element of the page has the focus then.
    inside = page.evaluate(
        "document.activeElement.closest('dialog') !== null || document.activeElement === document.body"
    )
    page.keyboard.press("Escape")

    assert inside
    assert {"key-input", "key-cancel", "Use key"} <= visited
    assert not visited & {f"tab-{view}" for view in VIEWS}
    expect(page.locator("#key")).to_be_focused()


def test_the_focus_goes_from_the_tabs_to_the_map_to_the_panel(page):
    ready(page)
    page.wait_for_selector("[data-example]")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    order = []
    for _ in range(60):
        page.keyboard.press("Tab")
        place = page.evaluate(
            "['tabs', 'map', 'dock', 'panel'].find((id) => document.activeElement.closest(`#${id}`)) ?? null"
        )
        if place is not None and place not in order:
            order.append(place)
    assert order == ["tabs", "map", "dock", "panel"]


def test_what_has_the_focus_is_seen(page):
    ready(page)
    for _ in range(12):
        page.keyboard.press("Tab")
        style = page.evaluate(
            "() => { const { outlineStyle, outlineWidth } = getComputedStyle(document.activeElement);"
            " return [outlineStyle, parseFloat(outlineWidth)]; }"
        )
        assert style[0] != "none"
        assert style[1] >= 1


def test_the_keyboard_alone_places_and_moves_an_area(page):
    ready(page)
    page.locator("[data-place=targets]").press("Enter")
    before = state(page, "problem")["targets"]
    page.locator("#map").focus()
    page.keyboard.press("Enter")
    page.keyboard.press("Escape")
    placed = state(page, "problem")["targets"][len(before) :]
    assert len(placed) == 1

    page.locator(f"table[data-kind=targets] tr[data-id='{placed[0]['id']}'] td").first.click()
    page.locator("#map").focus()
    page.keyboard.press("Alt+ArrowUp")
    assert state(page, "problem")["targets"][-1]["y"] > placed[0]["y"]


def test_the_reward_is_said_while_it_climbs_and_at_the_end(page):
    ready(page)
    go(page, "allocate")
    page.select_option("select[name=algorithm]", "ga")
    page.fill("input[name=time_limit_s]", "")
    page.locator("#parameters").evaluate("details => { details.open = true; }")
    page.fill("#parameters input[name=iteration]", "1000000")
    page.click("#start")
    said = page.locator("#reward-said[role=status]")
    expect(said).to_contain_text("The job is running, best reward")
    page.click("#cancel")
    page.wait_for_selector("#figures")
    expect(said).to_contain_text("The job is cancelled, best reward")


def test_motion_is_left_out_where_it_is_not_wanted(browser, service):
    context = browser.new_context(reduced_motion="reduce")
    page = context.new_page()
    page.goto(service.url)
    ready(page)
    before = page.locator(".leaflet-map-pane").get_attribute("class")
    page.get_by_label("Zoom in").click()

    assert "leaflet-zoom-anim" not in before
    assert page.evaluate("document.getAnimations().length") == 0
    context.close()
