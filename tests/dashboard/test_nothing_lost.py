"""Nothing is lost: reload, Back, a second tab, another problem, undo, a plan that is out of date."""

import json
import re

import httpx
import pytest
from dashboard_steps import begin_again, go, open_problem, ready, show_answer, state
from playwright.sync_api import expect

from app.api.openapi_examples import example_problem

KEPT = "html[data-kept=true]"


@pytest.fixture
def used(shared_page):
    """A page that other tests have used, with the problem that a new one has."""
    return begin_again(shared_page)


def level(page, name="site-1"):
    return next(target["level"] for target in state(page, "problem")["targets"] if target["id"] == name)


def set_level(page, value, name="site-1"):
    go(page, "problem")
    cell = page.locator(f"table[data-kind=targets] tr[data-id={name}] td[data-column=level]")
    cell.click()
    page.keyboard.type(str(value))
    page.keyboard.press("Enter")


def test_problem_and_plan_survive_a_reload(page, service):
    ready(page)
    set_level(page, 0.25)
    answer = show_answer(page, service.url, algorithm="greedy")
    go(page, "answer")
    kept = {key: state(page, key) for key in ("problem", "answer", "answerProblem", "colours")}
    page.wait_for_selector(KEPT)

    page.reload()
    ready(page)

    assert {key: state(page, key) for key in kept} == kept
    assert f"#/answer?job={answer['job_id']}" in page.url
    go(page, "take-away")
    expect(page.locator("#stale-export")).to_be_hidden()
    page.locator("body").press("Control+z")
    assert level(page) != 0.25
    page.locator("body").press("Control+Shift+z")
    assert level(page) == 0.25


def test_back_and_forward_go_between_the_views(page):
    ready(page)
    go(page, "allocate")
    go(page, "compare")
    page.go_back()
    expect(page.locator("#view-allocate")).to_be_visible()
    page.go_back()
    expect(page.locator("#view-problem")).to_be_visible()
    page.go_forward()
    expect(page.locator("#view-allocate")).to_be_visible()
    assert page.url.endswith("#/allocate")


def test_a_tab_that_was_closed_comes_back_and_two_tabs_keep_their_own(page, service):
    ready(page)
    set_level(page, 0.25)
    page.wait_for_selector(KEPT)
    context = page.context
    first = context.new_page()
    first.goto(service.url)
    ready(first)
    assert level(first) == 0.25

    set_level(first, 0.5)
    first.wait_for_selector(KEPT)
    set_level(page, 0.75)
    page.wait_for_selector(KEPT)
    for tab, value in ((first, 0.5), (page, 0.75)):
        tab.reload()
        ready(tab)
        assert level(tab) == value
    go(first, "recent")
    rows = first.locator("[data-testid=kept-problems] tbody tr")
    expect(rows).to_have_count(2)
    expect(rows.filter(has_text="this tab")).to_have_count(1)
    rows.get_by_role("button", name="Open").click()
    assert level(first) == 0.75
    first.locator("body").press("Control+z")
    assert level(first) == 0.5
    first.close()


def test_a_tab_that_was_duplicated_overwrites_nothing(page, service):
    ready(page)
    set_level(page, 0.25)
    page.wait_for_selector(KEPT)
    mission = page.evaluate("sessionStorage.getItem('dispatch-mission')")
    double = page.context.new_page()
    double.add_init_script(
        "sessionStorage.getItem('dispatch-mission')"
        f" ?? sessionStorage.setItem('dispatch-mission', '{mission}')"
    )
    double.goto(service.url)
    ready(double)
    assert level(double) == 0.25

    set_level(page, 0.5)
    page.wait_for_selector(KEPT)
    set_level(double, 0.75)
    double.wait_for_selector(KEPT)

    assert page.evaluate("sessionStorage.getItem('dispatch-mission')") != mission
    for tab, value in ((page, 0.5), (double, 0.75)):
        tab.reload()
        ready(tab)
        assert level(tab) == value
    double.close()


def test_the_largest_problem_survives_too(page):
    page.set_default_timeout(120_000)
    ready(page)
    uavs = [
        {"id": f"u{i}", "x_s": i, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [1] * 8} for i in range(1000)
    ]
    targets = [{"id": f"a{j}", "x": j, "y": 1, "level": 1, "loadlist": [1] * 8} for j in range(2000)]
    open_problem(page, {"uavs": uavs, "targets": targets}, "large")
    page.wait_for_selector(KEPT)
    page.reload()
    ready(page)
    assert state(page, "problem") == {"uavs": uavs, "targets": targets}


def test_leaving_is_asked_about_only_while_something_is_not_kept(page):
    ready(page)
    set_level(page, 0.25)
    page.wait_for_selector(KEPT)
    asked = """() => !window.dispatchEvent(new Event("beforeunload", { cancelable: true }))"""
    assert page.evaluate(asked) is False
    assert page.evaluate(
        f"""async () => {{
            const {{ update }} = await import("/dashboard/js/problem.js");
            update("targets", "site-1", {{ level: 0.5 }});
            return ({asked})();
        }}"""
    )
    page.wait_for_selector(KEPT)
    assert page.evaluate(asked) is False


def test_a_browser_that_keeps_nothing_says_so_and_asks(browser, service):
    context = browser.new_context()
    page = context.new_page()
    page.add_init_script("IDBFactory.prototype.open = () => { throw new Error('not here'); };")
    page.goto(service.url)
    ready(page)
    expect(page.locator("#alerts .notice")).to_contain_text("This browser keeps nothing (not here)")
    set_level(page, 0.25)
    assert page.evaluate("""() => !window.dispatchEvent(new Event("beforeunload", { cancelable: true }))""")
    context.close()


@pytest.mark.parametrize("how", ["[data-example=paper-5x10]", "button:text-is('Empty')", "file"])
def test_what_replaces_a_problem_can_be_undone(used, service, how):
    page = used
    ready(page)
    set_level(page, 0.25)
    answer = show_answer(page, service.url, algorithm="greedy")
    before = {key: state(page, key) for key in ("problem", "problemName", "answer", "answerProblem")}
    go(page, "problem")
    if how == "file":
        content = json.dumps(example_problem("paper-5x10")).encode()
        page.locator("#import").set_input_files(
            {"name": "new.json", "mimeType": "application/json", "buffer": content}
        )
        expect(page.locator("#problem-title")).to_contain_text("new")
    else:
        page.locator("#view-problem").locator(how).click()
        expect(page.locator("#problem-title")).not_to_contain_text("cyclone-idai")
    assert state(page, "answer") is None

    page.locator("#news .notice").get_by_role("button", name="Undo").last.click()

    assert {key: state(page, key) for key in before} == before
    go(page, "answer")
    expect(page.locator("[data-figure=Reward] data")).to_have_attribute("value", str(answer["reward"]))


def test_a_plan_that_is_refused_leaves_the_one_before(page, service):
    ready(page)
    page.expected_troubles.append("422")
    answer = show_answer(page, service.url, algorithm="greedy")
    go(page, "allocate")
    page.fill("input[name=time_limit_s]", "-1")
    page.click("#start")
    expect(page.locator("[data-pointer='/time_limit_s'] .error")).to_be_visible()
    assert state(page, "answer") == answer


def test_recent_plans_of_the_service_are_opened_with_their_problems(page, service):
    ready(page)
    problem = {**example_problem("paper-5x10"), "objective": {"unloading": "planned"}}
    asked = {**problem, "algorithm": "local_search", "parameters": {"moves": 10_000}}
    answer = httpx.post(f"{service.url}/allocate", json=asked, timeout=60).raise_for_status().json()
    go(page, "recent")
    row = page.locator(f"[data-testid=recent-plans] tr[data-job='{answer['job_id']}']")
    expect(row).to_contain_text("succeeded")

    row.get_by_role("button", name="Open").click()

    expect(page.locator("#view-answer")).to_be_visible()
    assert state(page, "answer") == answer
    opened = state(page, "answerProblem")
    assert opened == state(page, "problem")
    assert [uav["loadlist"] for uav in opened["uavs"]] == [uav["loadlist"] for uav in problem["uavs"]]
    assert opened["objective"] == problem["objective"]
    assert page.url.endswith(f"#/answer?job={answer['job_id']}")
    page.locator("body").press("Control+z")
    expect(page.locator("#problem-title")).to_contain_text("cyclone-idai")

    page.goto(f"{service.url}/#/take-away?job={answer['job_id']}")
    page.reload()
    ready(page)
    expect(page.get_by_test_id("take-status")).to_contain_text("This problem's crs is local")
    assert state(page, "answer") == answer


def test_a_job_that_runs_is_followed_on_after_a_reload(page, service):
    ready(page)
    go(page, "allocate")
    page.select_option("select[name=algorithm]", "ga")
    page.fill("input[name=time_limit_s]", "")
    page.locator("#parameters").evaluate("details => { details.open = true; }")
    page.fill("#parameters input[name=iteration]", "1000000")
    page.click("#start")
    expect(page.locator("#job-status")).to_have_text("running")
    page.wait_for_selector(KEPT)

    page.reload()
    ready(page)

    expect(page.locator("#view-allocate")).to_be_visible()
    expect(page.locator("#job-status")).to_have_text("running")
    page.click("#cancel")
    page.wait_for_selector("#figures")
    assert state(page, "answer")["algorithm"] == "ga"
    assert state(page, "answerProblem") == state(page, "problem")


def test_a_plan_that_is_out_of_date_says_so_and_asks_before_it_is_saved(page, service):
    ready(page)
    show_answer(page, service.url, algorithm="greedy")
    set_level(page, 0.25)
    go(page, "take-away")
    expect(page.locator("#stale-export")).to_be_visible()
    asked = []
    page.once("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
    page.locator("#view-take-away button[data-format=csv]").click()
    assert asked == ["The problem was changed after this plan. Save the plan as it was made?"]
    page.once("dialog", lambda dialog: dialog.accept())
    with page.expect_download():
        page.locator("#view-take-away button[data-format=csv]").click()
    page.once("dialog", lambda dialog: dialog.dismiss())
    page.get_by_test_id("print").click()
    assert len(page.context.pages) == 1
    page.locator("body").press("Control+z")
    expect(page.locator("#stale-export")).to_be_hidden()
    with page.expect_download():
        page.locator("#view-take-away button[data-format=csv]").click()


def test_symbols_move_in_the_problem_only(page, service):
    ready(page)
    show_answer(page, service.url, algorithm="greedy")
    before = state(page, "problem")
    go(page, "take-away")
    symbol = page.locator(".symbol[data-id=site-20]")
    drag(page, symbol)
    settled(page)
    symbol.click()
    expect(symbol).to_have_class(re.compile("selected"))
    page.locator("#map").focus()
    page.keyboard.press("Delete")
    page.keyboard.press("Alt+ArrowLeft")
    assert state(page, "problem") == before
    go(page, "problem")
    page.get_by_role("button", name="Fit map").click()
    drag(page, symbol)
    assert state(page, "problem") != before


def settled(page):
    """Wait until the map has its size, stands still and is drawn."""
    expect(page.locator(".leaflet-pan-anim, .leaflet-zoom-anim")).to_have_count(0)
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def drag(page, symbol):
    settled(page)
    at = symbol.bounding_box()
    page.mouse.move(at["x"] + at["width"] / 2, at["y"] + at["height"] / 2)
    page.mouse.down()
    page.mouse.move(at["x"] + 60, at["y"] - 30, steps=5)
    page.mouse.up()
