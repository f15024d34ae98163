"""What the page says of fields and of algorithms: the service's descriptions, in each of its languages."""

import json

import pytest
from dashboard_steps import ADVANCED, PATIENCE_MS, go, ready
from page_fields import shown_descriptions
from page_texts import DASHBOARD, LANGUAGES
from playwright.sync_api import expect

from app.solvers.registry import ALGORITHMS


@pytest.fixture(scope="module")
def shown(openapi):
    return shown_descriptions(openapi)


@pytest.mark.parametrize("code", [path.stem for path in LANGUAGES])
def test_every_description_has_its_translation_and_none_is_left_over(code, shown):
    fields = json.loads((DASHBOARD / "languages" / "service" / f"{code}.json").read_text())["fields"]
    assert fields.keys() == shown
    assert list(fields) == sorted(fields)
    assert all(each and each.strip() == each for each in fields.values())


@pytest.mark.parametrize("code", [path.stem for path in LANGUAGES])
def test_every_algorithm_has_its_summary(code):
    algorithms = json.loads((DASHBOARD / "languages" / "service" / f"{code}.json").read_text())["algorithms"]
    assert list(algorithms) == sorted(each.summary for each in ALGORITHMS.values())


def test_a_form_describes_its_fields_in_the_language_of_the_page(browser, service):
    with browser.new_context(viewport={"width": 1366, "height": 900}, locale="pt-MZ") as context:
        context.set_default_timeout(PATIENCE_MS)
        context.add_init_script(ADVANCED)
        page = context.new_page()
        page.goto(service.url)
        ready(page)
        go(page, "allocate")
        hint = page.locator("label[data-pointer='/time_limit_s'] .hint")
        expect(hint).to_contain_text("A resposta chega dentro deste tempo")
        expect(page.locator("#advanced")).to_contain_text("O melhor plano no tempo que há")
        english = json.loads((DASHBOARD / "languages" / "service" / "pt.json").read_text())["fields"]
        for view in ("problem", "allocate", "missions"):
            go(page, view)
            hints = page.locator(f"#view-{view} label[data-pointer] .hint").all_text_contents()
            assert [text for text in hints if any(text.startswith(each) for each in english)] == [], view
