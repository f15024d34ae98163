"""Allocating on the dashboard: the form is what the API describes, the answer on screen is its answer."""

import json

import httpx
import pytest
from playwright.sync_api import expect
from referee import replay


def open_example(page):
    expect(page.locator("html")).to_have_attribute("data-ready", "true")
    page.click("#tab-problem")
    page.click("[data-example=paper-5x10]")
    expect(page.locator("#problem-title")).to_contain_text("paper-5x10")
    expect(page.locator(".symbol.targets")).to_have_count(10)
    page.click("#tab-allocate")
    page.wait_for_selector("#start")
    return page


@pytest.fixture
def ready(page):
    """A page on which nothing was asked yet."""
    return open_example(page)


@pytest.fixture
def again(shared_page):
    """The page of other tests, with the problem alone: the answer goes with the problem before."""
    open_example(shared_page)
    expect(shared_page.locator("#figures")).to_have_count(0)
    return shared_page


def start(page, algorithm, limit="", parameters=None):
    page.select_option("select[name=algorithm]", algorithm)
    page.fill("input[name=time_limit_s]", limit)
    if parameters:
        page.locator("#parameters").evaluate("details => { details.open = true; }")
    for name, value in (parameters or {}).items():
        page.fill(f"#parameters input[name={name}]", value)
    page.click("#start")


def newest_job(service):
    summary = httpx.get(f"{service.url}/jobs?limit=1").json()["jobs"][0]
    return httpx.get(f"{service.url}/jobs/{summary['id']}").json()


def figure(page, title):
    return json.loads(page.locator(f"[data-figure='{title}'] data").get_attribute("value"))


def numbers(cell):
    return [json.loads(each.get_attribute("value")) for each in cell.locator("data").all()]


def test_every_parameter_of_every_algorithm_can_be_set(ready, service):
    for algorithm in httpx.get(f"{service.url}/algorithms").json()["algorithms"]:
        ready.select_option("select[name=algorithm]", algorithm["name"])
        names = ready.locator("#parameters :is(input, select)").evaluate_all(
            "all => all.map((each) => each.name)"
        )
        assert set(names) == set(algorithm["parameters"]["properties"])
        for name, value in algorithm["defaults"].items():
            shown = ready.locator(f"#parameters [name={name}]").input_value()
            assert shown == (
                "" if value is None else str(value).lower() if isinstance(value, bool) else shown
            )
            if isinstance(value, int | float) and not isinstance(value, bool):
                assert float(shown) == value


def test_the_answer_on_screen_is_the_services(again, service):
    page = again
    start(page, "ga", parameters={"iteration": "30"})
    page.wait_for_selector("#figures")
    job = newest_job(service)
    answer = job["result"]
    problem = httpx.get(f"{service.url}/examples/paper-5x10").json()

    assert answer["parameters"]["iteration"] == 30
    assert replay(problem, answer["assignment"])["reward"] == pytest.approx(answer["reward"])
    for title, name in (("Reward", "reward"), ("Satisfaction", "satisfaction"), ("Distance", "distance")):
        assert figure(page, title) == answer[name]
    assert figure(page, "λ") == answer["distance_weight"]
    assert figure(page, "Seconds") == answer["elapsed_s"]

    flown = [route for route in answer["routes"] if route["stops"]]
    on_map = {
        path.get_attribute("data-uav-id"): path.get_attribute("data-stops").split("\n")
        for path in page.locator("path.route").all()
    }
    assert on_map == {route["uav_id"]: [stop["target_id"] for stop in route["stops"]] for route in flown}
    rows = page.locator("#routes tr[data-step]").all()
    stops = [(route["uav_id"], stop) for route in flown for stop in route["stops"]]
    assert len(rows) == len(stops)
    for row, (uav_id, stop) in zip(rows, stops, strict=True):
        cells = row.locator("td")
        assert row.get_attribute("data-uav-id") == uav_id
        assert cells.nth(1).inner_text() == stop["target_id"]
        assert numbers(cells.nth(2)) == [stop["arrival_time"]]
        assert numbers(cells.nth(3)) == stop["delivered"]
    visits = page.locator(".timeline .visit").evaluate_all("all => all.map((each) => each.dataset.targetId)")
    assert visits == [stop["target_id"] for _, stop in stops]

    unmet = page.locator("#unmet > li").all()
    assert [item.get_attribute("data-target-id") for item in unmet] == [
        each["target_id"] for each in answer["unmet"]
    ]
    for item, expected in zip(unmet, answer["unmet"], strict=True):
        assert numbers(item) == expected["remaining"]
        assert item.get_attribute("data-code") == expected["code"]
        assert item.locator("p.hint").first.get_attribute("title") == expected["reason"]


def test_the_transferred_policy_is_named(again, service):
    start(again, "transfer_qmix", "1.5")
    again.wait_for_selector("#figures")
    source = newest_job(service)["result"]["source_policy"]
    shown = again.locator("#source")
    expect(shown).to_contain_text(source["name"])
    assert numbers(shown) == [source["distance"]]


def test_the_reward_climbs_live_and_stopping_keeps_the_best(again, service):
    page = again
    start(page, "ga", parameters={"iteration": "1000000"})
    page.wait_for_selector("path.route")
    expect(page.locator("#reward-chart .uplot")).to_be_visible()
    expect(page.locator("#job-status")).to_have_text("running")
    first = page.locator("#progress data").first.get_attribute("value")
    assert json.loads(first) <= newest_job(service)["progress"]["best_reward"]
    page.click("#cancel")
    page.wait_for_selector("#figures")
    job = newest_job(service)

    assert job["status"] == "cancelled"
    assert figure(page, "Reward") == job["result"]["reward"]


def test_refusals_stand_at_their_fields(ready):
    page = ready
    page.expected_troubles.append("422")
    start(page, "ga", limit="-1")
    place = page.locator("[data-pointer='/time_limit_s']")
    expect(place.locator("input")).to_have_attribute("aria-invalid", "true")
    expect(place.locator(".error")).to_contain_text("more than 0")

    page.fill("input[name=time_limit_s]", "1")
    page.locator("#parameters").evaluate("details => { details.open = true; }")
    page.fill("#parameters input[name=iteration]", "many")
    page.click("#start")
    expect(page.locator("[data-pointer='/parameters/iteration'] .error")).to_be_visible()
    expect(place.locator(".error")).to_be_hidden()


def test_a_refusal_of_the_problem_leads_to_its_cell(ready):
    page = ready
    page.expected_troubles.append("422")
    page.click("#tab-problem")
    page.click("[data-table=uavs]")
    page.locator("table[data-kind=uavs] tr[data-id=uav-2] td[data-column=speed]").dblclick()
    page.keyboard.type("-1")
    page.keyboard.press("Enter")
    page.click("#tab-allocate")
    page.click("#start")
    page.locator("#violations button").click()
    cell = page.locator("table[data-kind=uavs] tr[data-id=uav-2] td[data-column=speed]")
    expect(cell).to_have_attribute("aria-invalid", "true")
    expect(cell).to_be_focused()


def test_an_answer_that_is_out_of_date_says_so(again):
    page = again
    start(page, "greedy")
    page.wait_for_selector("#figures")
    expect(page.locator("#stale")).to_be_hidden()
    page.click("#tab-problem")
    page.locator(".symbol.targets").first.click()
    page.locator("#map").focus()
    page.keyboard.press("Delete")
    page.click("#tab-answer")
    expect(page.locator("#stale")).to_be_visible()


def test_the_keyboard_allocates_at_once_on_a_fresh_page(page):
    page.wait_for_selector("html[data-ready]")
    page.locator("body").press("Control+Enter")
    page.wait_for_selector("#figures")


def test_an_answer_by_another_algorithm_and_its_warnings_are_shown(again):
    page = again
    start(page, "greedy")
    page.wait_for_selector("#figures")
    expect(page.get_by_test_id("answered-by")).to_have_count(0)
    expect(page.get_by_test_id("warnings")).to_have_count(0)
    page.evaluate(
        """async () => {
            const { get, set } = await import("/dashboard/js/state.js");
            const detail = "area-4 is 8300 km from every base";
            const warnings = [{ pointer: "/targets/3/x", code: "far_away", detail }];
            set({ answer: { ...get().answer, algorithm: "auto", answered_by: "greedy", warnings } });
        }"""
    )
    expect(page.get_by_test_id("answered-by")).to_have_text("answered by greedy, not auto")
    expect(page.get_by_test_id("warnings")).to_contain_text("area-4 is 8300 km from every base")
    page.get_by_test_id("warnings").get_by_role("button").click()
    expect(page.locator("table[data-kind=targets] tr[data-id=area-4] td[data-column=x]")).to_be_focused()


def test_what_was_clicked_stays_under_the_pointer(ready):
    page = ready
    page.set_viewport_size({"width": 1280, "height": 500})
    start(page, "greedy")
    page.wait_for_selector("#figures")
    unmet = page.evaluate(
        """async () => {
            const { get, set } = await import("/dashboard/js/state.js");
            const { answer } = get();
            const visited = answer.routes.filter(({ stops }) => stops.length)[0].stops[0].target_id;
            const less = { target_id: visited, remaining: [1, 1, 1, 1], code: "loads_used", reason: "" };
            const unmet = [...answer.unmet, { ...answer.unmet[0], ...less }];
            set({ answer: { ...answer, unmet } });
            return visited;
        }"""
    )
    button = page.locator(f"#unmet li[data-target-id='{unmet}'] button[title]").last
    button.scroll_into_view_if_needed()
    before = button.bounding_box()
    button.click()
    expect(page.locator("#routes tr.chosen").first).to_be_attached()
    assert button.bounding_box() == before
    page.locator(f".symbol.targets[data-id='{unmet}']").dispatch_event("click")


def test_the_keyboard_alone_allocates(again):
    page = again
    page.select_option("select[name=algorithm]", "greedy")
    page.keyboard.press("Control+Enter")
    page.wait_for_selector("#figures")
    expect(page.locator("#tab-answer")).to_have_attribute("aria-selected", "true")
    page.locator("#tab-answer").focus()
    page.keyboard.press("ArrowLeft")
    expect(page.locator("#tab-allocate")).to_be_focused()


def test_the_bound_and_the_gap_to_it_are_shown_where_asked_for(again, service):
    page = again
    page.select_option("[data-pointer='/bound'] select", "true")
    start(page, "local_search", "2")
    page.wait_for_selector("[data-figure=Gap]", state="attached")
    answer = newest_job(service)["result"]
    assert (figure(page, "Bound"), figure(page, "Gap")) == (answer["bound"], answer["gap"])
    assert answer["bound"] >= answer["reward"]
