"""The list of the keys, and what a finger has to hit."""

import pytest
from dashboard_steps import ADVANCED, PATIENCE_MS, begin_again, go, ready, show_answer
from playwright.sync_api import expect

SMALLEST_PX = 40
VIEWS = ("problem", "allocate", "answer", "take-away", "compare", "missions", "library", "recent")
SMALL = """(smallest) => [...document.querySelectorAll("button, .button, summary, select, .leaflet-bar a")]
    .filter((each) => each.checkVisibility())
    .map((each) => [each.outerHTML.slice(0, 90), each.getBoundingClientRect()])
    .filter(([, { width, height }]) => width < smallest - 0.5 || height < smallest - 0.5)
    .map(([says, { width, height }]) => `${says} ${width} x ${height}`)"""
CUT_OFF = """() => [...document.querySelectorAll("button")]
    .filter((each) => each.checkVisibility() && each.scrollWidth > each.clientWidth + 1)
    .map((each) => each.outerHTML.slice(0, 120))"""


@pytest.fixture
def page(shared_page):
    """One page for all tests."""
    return begin_again(shared_page)


def test_a_question_mark_shows_what_keys_do(page):
    page.locator("#map").press("?")
    shown = page.get_by_role("dialog", name="Keyboard")
    expect(shown).to_be_visible()
    expect(shown).to_contain_text("import the table that was copied")
    page.keyboard.press("Escape")
    expect(shown).to_be_hidden()
    page.get_by_role("button", name="Keyboard").click()
    expect(shown).to_be_visible()
    shown.get_by_role("button", name="Close").click()
    expect(shown).to_be_hidden()


def test_a_question_mark_that_is_typed_is_one(page):
    go(page, "problem")
    page.locator(".symbol.targets").first.click()
    name = page.locator("#view-problem .card input[name=name]")
    name.press("?")
    assert name.input_value().endswith("?")
    name.press("Enter")
    page.locator("table[data-kind=targets] td[data-column=level]").first.press("?")
    expect(page.locator("table[data-kind=targets] td input")).to_have_value("?")
    page.keyboard.press("Escape")
    expect(page.locator("#keys-dialog[open]")).to_have_count(0)


@pytest.mark.parametrize(("width", "locale"), [(390, "fr-FR"), (820, "en")])
def test_what_a_finger_has_to_hit_is_large_enough_and_not_cut_off(browser, service, width, locale):
    context = browser.new_context(
        has_touch=True, is_mobile=True, viewport={"width": width, "height": 1180}, locale=locale
    )
    context.set_default_timeout(PATIENCE_MS)
    context.add_init_script(ADVANCED)
    page = context.new_page()
    page.goto(service.url)
    ready(page)
    show_answer(page, service.url)
    page.locator(".symbol.targets").first.tap()
    found = {}
    for view in VIEWS:
        go(page, view)
        page.locator("summary").evaluate_all(
            "all => all.forEach((each) => { each.parentElement.open = true; })"
        )
        found[view] = [*page.evaluate(SMALL, SMALLEST_PX), *page.evaluate(CUT_OFF)]
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), view
    context.close()
    assert {view: small for view, small in found.items() if small} == {}
