"""The largest problem that a service takes by default is reached and changed; a large answer has portions.

Portions are of a hundred UAVs, so that an answer with 220 has several.
"""

import json

import httpx
import numpy as np
from dashboard_steps import go, open_problem, ready, show_answer, state
from playwright.sync_api import expect

N_UAVS, N_TARGETS = 1000, 2000


def open_large(page, n_uavs, n_targets):
    rng = np.random.default_rng(3)
    places = rng.random((n_uavs + n_targets, 2)).round(4).tolist()
    problem = {
        "uavs": [
            {"id": f"uav-{i}", "x_s": x, "y_s": y, "speed": 1.0, "voyage": 0.2, "loadlist": [5.0]}
            for i, (x, y) in enumerate(places[:n_uavs], 1)
        ],
        "targets": [
            {"id": f"area-{j}", "x": x, "y": y, "level": 1.0, "loadlist": [4.0]}
            for j, (x, y) in enumerate(places[n_uavs:], 1)
        ],
    }
    page.set_default_timeout(120_000)
    ready(page)
    open_problem(page, problem, "large")


def test_every_row_can_be_reached_and_changed_and_few_are_there(page):
    open_large(page, N_UAVS, N_TARGETS)
    rows = page.locator("table[data-kind=targets] tr[data-id]")
    assert rows.count() < 300
    assert page.locator("table[data-kind=targets]").get_attribute("aria-rowcount") == str(N_TARGETS + 1)

    page.locator("#dock").evaluate("(dock) => dock.scrollTo(0, dock.scrollHeight)")
    last = page.locator(f"table[data-kind=targets] tr[data-id=area-{N_TARGETS}]")
    expect(last).to_be_visible()
    assert last.get_attribute("aria-rowindex") == str(N_TARGETS + 1)
    cell = last.locator("td[data-column=level]")
    cell.click()
    page.keyboard.type("0.5")
    page.keyboard.press("Enter")
    assert state(page, "problem")["targets"][-1]["level"] == 0.5
    page.keyboard.press("ArrowUp")
    assert page.evaluate("document.activeElement.closest('tr').dataset.id") == f"area-{N_TARGETS - 1}"

    page.evaluate(
        "async () => (await import('/dashboard/js/state.js')).select({ kind: 'targets', id: 'area-700' })"
    )
    expect(page.locator("table[data-kind=targets] tr[data-id=area-700]")).to_be_in_viewport()


def test_its_answer_is_shown_in_portions_and_the_selected_is_always_there(page, service):
    open_large(page, 220, 300)
    answer = show_answer(page, service.url, algorithm="greedy", time_limit_s=20)
    flown = [route for route in answer["routes"] if route["stops"]]
    assert len(flown) > 200
    go(page, "answer")
    expect(page.locator("#routes")).to_be_visible()
    expect(page.locator("path.route")).to_have_count(len(flown))
    assert {row.get_attribute("data-uav-id") for row in page.locator("#routes tr[data-step='1']").all()} == {
        route["uav_id"] for route in flown[:100]
    }
    page.locator("#routes .more").click()
    expect(page.locator("#routes th[scope=rowgroup]")).to_have_count(200)

    last = flown[-1]
    page.evaluate(
        "async (id) => (await import('/dashboard/js/state.js')).select({ kind: 'uavs', id })", last["uav_id"]
    )
    chosen = page.locator("#routes tr.chosen")
    assert [row.get_attribute("data-target-id") for row in chosen.all()] == [
        stop["target_id"] for stop in last["stops"]
    ]
    assert [
        json.loads(each.locator("data").nth(0).get_attribute("value"))
        for each in chosen.locator("td:nth-last-child(3)").all()
    ] == [stop["arrival_time"] for stop in last["stops"]]
    assert httpx.get(f"{service.url}/healthz").is_success
