"""Compare: what the page shows of several algorithms is what the API answered to each."""

import httpx
import pytest
from dashboard_steps import go, ready, state, value
from playwright.sync_api import expect
from referee import replay

CHOSEN = ("ga", "local_search", "greedy")


@pytest.fixture(scope="module")
def compared(shared_page):
    """The page with a comparison; who takes a plan of it comes last."""
    page = shared_page
    ready(page)
    go(page, "compare")
    for box in page.locator("#view-compare input[name=algorithm]").all():
        box.set_checked(box.get_attribute("value") in CHOSEN)
    page.locator("#compare-limit").fill("0.5")
    page.locator("#view-compare button[type=submit]").click()
    expect(page.get_by_test_id("compare-status")).to_have_text("3 of 3 algorithms have a plan.")
    return page


def test_numbers_are_the_services(compared, service):
    page = compared
    jobs = httpx.get(f"{service.url}/jobs?limit=3").json()["jobs"]
    answers = {}
    for job in jobs:
        answer = httpx.get(f"{service.url}/jobs/{job['id']}").json()["result"]
        answers[answer["algorithm"]] = answer

    assert set(answers) == set(CHOSEN)
    problem = state(page, "problem")
    best = max(answers.values(), key=lambda answer: answer["reward"])
    for name, answer in answers.items():
        cells = page.locator(f"[data-testid=compare-numbers] tr[data-algorithm={name}] td")
        assert replay(problem, answer["assignment"])["reward"] == pytest.approx(answer["reward"])
        shown = [value(cells.nth(i)) for i in (0, 2, 3, 4, 5)]
        expected = [answer[key] for key in ("reward", "satisfaction", "distance")]
        assert shown == [*expected, len(answer["unmet"]), answer["elapsed_s"]]
    marked = page.locator("[data-testid=compare-numbers] tr.best").first
    assert value(marked.locator("td").first) == best["reward"]


def test_curves_rise_to_the_reward_and_are_there_in_numbers(compared):
    page = compared
    assert page.get_by_test_id("compare-time").locator("canvas").count() == 1
    page.get_by_text("The curves in numbers").click()
    curves = {}
    for row in page.locator("#view-compare details tbody tr").all():
        name = row.locator("td").first.inner_text()
        curves.setdefault(name, []).append((value(row.locator("td").nth(1)), value(row.locator("td").nth(2))))

    assert set(curves) == set(CHOSEN)
    for name, points in curves.items():
        assert points == sorted(points)
        assert [reward for _, reward in points] == sorted(reward for _, reward in points)
        final = page.locator(f"[data-testid=compare-numbers] tr[data-algorithm={name}] td").first
        assert points[-1][1] == pytest.approx(value(final), rel=1e-12)


def test_plans_stand_side_by_side_and_one_can_be_taken(compared):
    page = compared
    cards = page.locator("#view-compare article.plan")
    expect(cards).to_have_count(3)
    boxes = [card.bounding_box() for card in cards.all()]
    assert len({round(box["y"]) for box in boxes}) == 1
    card = cards.filter(has=page.get_by_role("heading", name="greedy", exact=True))
    drawn = {line.get_attribute("data-uav") for line in card.locator("polyline").all()}

    card.get_by_role("button", name="Take this plan").click()

    answer = state(page, "answer")
    assert answer["algorithm"] == "greedy"
    assert drawn == {route["uav_id"] for route in answer["routes"] if route["stops"]}


def test_stopping_keeps_the_best_plan(page):
    ready(page)
    go(page, "compare")
    for box in page.locator("#view-compare input[name=algorithm]").all():
        box.set_checked(box.get_attribute("value") == "local_search")
    page.locator("#compare-limit").fill("600")
    page.locator("#view-compare button[type=submit]").click()
    expect(page.get_by_test_id("compare-time").locator("canvas")).to_have_count(1)

    # While the search keeps all cores busy, the browser may not draw two frames in a row for a minute.
    page.locator("#view-compare").get_by_role("button", name="Stop").click(force=True)

    expect(page.get_by_test_id("compare-status")).to_have_text("1 of 1 algorithms have a plan.")
    expect(page.locator("#view-compare article.plan")).to_have_count(1)
