"""Steps that several tests of the dashboard begin with."""

from __future__ import annotations

import json

import httpx
from playwright.sync_api import Page, expect

from app.api.openapi_examples import example_problem

PATIENCE_MS = 60_000
"""Only a failure waits as long; a machine with other work may need a part of it."""

QUICK = {"algorithm": "greedy"}

ADVANCED = "localStorage.setItem('dispatch-advanced', 'true')"
"""A script for pages of people who have opened what is advanced, and find it open again."""


def ready(page: Page) -> None:
    """Wait until the page has its first problem."""
    page.wait_for_selector("html[data-ready]")


def state(page: Page, key: str):
    """Read a key of the page's store."""
    return json.loads(
        page.evaluate(
            "async (key) => JSON.stringify((await import('/dashboard/js/state.js')).get()[key] ?? null)", key
        )
    )


def open_problem(page: Page, problem: dict, name: str = "a test") -> None:
    """Bring a problem on screen."""
    page.evaluate(
        "async ([problem, name]) => (await import('/dashboard/js/problem.js')).open(problem, name)",
        [problem, name],
    )


def begin_again(page: Page) -> Page:
    """Bring the problem on screen that a new page has, without an answer to it."""
    ready(page)
    go(page, "problem")
    open_problem(page, example_problem("cyclone-idai"), "cyclone-idai")
    return page


def show_answer(page: Page, service_url: str, **asked) -> dict:
    """Allocate the problem on screen by the API, and give the page the answer as if it had asked for it."""
    problem = state(page, "problem")
    body = {**problem, **(asked or QUICK)}
    answer = httpx.post(f"{service_url}/allocate", json=body, timeout=60).raise_for_status().json()
    page.evaluate(
        "async (answer) => { const { get, set } = await import('/dashboard/js/state.js');"
        " set({ answer, answerProblem: get().problem }); }",
        answer,
    )
    return answer


def go(page: Page, view: str) -> None:
    """Change to a view by its tab."""
    page.locator(f"#tab-{view}").click()
    expect(page.locator(f"#view-{view}")).to_be_visible()


def value(cell) -> float:
    """The exact number in a cell."""
    return float(cell.locator("data").first.get_attribute("value"))
