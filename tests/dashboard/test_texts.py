"""The page in French, Portuguese and Spanish: every text has its translations, and numbers are as there."""

import pytest
from dashboard_steps import PATIENCE_MS, go, open_problem, ready, state
from page_modules import run_module
from page_texts import LANGUAGES, places, source_texts, translations
from playwright.sync_api import expect

COMPUTED = ["fields.js", "language.js", "language.js"]
"""Calls whose text is no literal: names of fields, and the markup's texts and attributes."""

SPOKEN = """
    const texts = await load("texts.js");
    return given.map(([tag, file, calls]) => {
        texts.speak(tag, file);
        return calls.map(([name, ...values]) => texts[name](...values));
    });
"""
CODES = [path.stem for path in LANGUAGES]


def field_labels(openapi):
    """The names of all fields of the API as the page's forms write them."""
    properties = {
        name for schema in openapi["components"]["schemas"].values() for name in schema.get("properties", ())
    }
    return set(
        run_module(
            'const { titleOf } = await load("fields.js"); return given.map(titleOf);', sorted(properties)
        )
    )


@pytest.mark.parametrize("code", CODES)
def test_every_text_has_its_translation_and_none_is_left_over(code, openapi):
    source = source_texts()
    known = set(translations(code))
    assert source.computed == COMPUTED
    assert (source.plain.keys() | source.counted.keys()) - known == set()
    assert known - source.plain.keys() - source.counted.keys() - field_labels(openapi) == set()


def test_the_languages_translate_the_same_fields():
    assert CODES == ["es", "fr", "pt"]
    assert len({frozenset(translations(code)) for code in CODES}) == 1


@pytest.mark.parametrize("code", CODES)
def test_values_have_the_same_places_and_counts_their_plural_forms(code):
    source = source_texts()
    for text, translated in translations(code).items():
        if text in source.counted:
            # These languages have a form for millions too, for which `other` stands in.
            assert sorted(translated) == ["one", "other"], text
            assert places(translated["other"]) == places(text), text
            # A list needs no count beside it: only its verb has forms.
            for one in (translated["one"], source.counted[text]):
                assert places(one) | {"count"} == places(text) | {"count"}, text
        else:
            assert isinstance(translated, str), text
            assert places(translated) == places(text), text


@pytest.mark.parametrize("code", CODES)
def test_translations_are_in_order_so_that_changes_are_easy_to_read(code):
    assert list(translations(code)) == sorted(translations(code))


def test_counts_take_the_form_of_their_language():
    calls = [["tn", count, "{count} visit", "{count} visits"] for count in (0, 1, 2, 1_000_000)]
    english, french, spanish = run_module(
        SPOKEN,
        [["en", {}, calls], ["fr-FR", translations("fr"), calls], ["es-MX", translations("es"), calls]],
    )
    assert english == ["0 visits", "1 visit", "2 visits", "1,000,000 visits"]
    assert french == ["0 visite", "1 visite", "2 visites", "1\u202f000\u202f000 visites"]
    assert spanish == ["0 visitas", "1 visita", "2 visitas", "1,000,000 visitas"]


WRITTEN = [
    (["shown", 12345.678], "12,346", "12\u202f346"),
    (["shown", -0.25], "\u22120.25", "\u22120,25"),
    (["shown", 4321], "4321", "4321"),
    (["fixed", 98.456, 1], "98.5", "98,5"),
    (["betweenAmounts"], ", ", "; "),
    (["listed", ["a", "b", "c"]], "a, b, c", "a, b et c"),
    (["writtenNumber", 1.5], "1.5", "1,5"),
    (["t", "{count} of {end}", {"count": 0.5, "end": "0.5"}], "0.5 of 0.5", "0,5 of 0.5"),
]
"""What is shown: a call, and what comes of it in English and in French."""


@pytest.mark.parametrize(("tag", "at"), [("en", 1), ("fr-FR", 2)])
def test_numbers_and_lists_are_written_as_the_region_writes_them(tag, at):
    assert run_module(SPOKEN, [[tag, {}, [each[0] for each in WRITTEN]]]) == [[each[at] for each in WRITTEN]]


def test_a_decimal_comma_is_read_where_the_language_has_one():
    calls = [["plainNumber", text] for text in ("1,5", "\u22121,5", ",5", "1.5", "1,500,2", "a,5", "")]
    english, french = run_module(SPOKEN, [["en", {}, calls], ["fr", {}, calls]])
    assert english == [text for _, text in calls]
    assert french == ["1.5", "\u22121.5", ".5", "1.5", "1,500,2", "a,5", ""]


def test_a_text_without_a_translation_stays_english():
    calls = [
        ["t", "Ready"],
        ["tn", 1, "{count} visit", "{count} visits"],
        ["tn", 2, "{count} visit", "{count} visits"],
    ]
    assert run_module(SPOKEN, [["fr", {}, calls]]) == [["Ready", "1 visit", "2 visits"]]


VIEWS = ("problem", "allocate", "answer", "take-away", "compare", "missions", "library", "recent")
CUT_OFF = """(width) => [...document.querySelectorAll("button, h2, h3, p, label, summary, select")]
    .filter((each) => each.checkVisibility())
    .filter((each) => !each.closest(".scroll, #tabs, .dock, #map, .visually-hidden, .bar h1, .service"))
    .filter((each) => each.clientWidth > 0)
    .filter((each) => each.getBoundingClientRect().right > width || each.scrollWidth > each.clientWidth + 1)
    .map((each) => each.textContent.slice(0, 60))"""
"""Texts that are wider than their place or than the page; what is left out scrolls, or is not seen."""
SMALL = {
    "uavs": [{"id": "uav-1", "x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [3]}],
    "targets": [{"id": "area-1", "x": 1.5, "y": 1, "level": 2, "loadlist": [3]}],
}


@pytest.fixture
def french(browser, service):
    context = browser.new_context(viewport={"width": 1366, "height": 900}, locale="fr-FR")
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(service.url)
    ready(page)
    open_problem(page, SMALL, "un essai")
    yield page
    context.close()


def test_the_page_speaks_the_language_of_the_browser_or_the_one_that_is_chosen(french, service):
    page = french
    expect(page.locator("html")).to_have_attribute("lang", "fr")
    expect(page.locator("#problem-title")).to_have_text("un essai · 1 drone et 1 zone")
    expect(page.locator("#tab-compare")).to_have_text("Comparer")
    expect(page.locator("#key")).to_have_attribute("title", "Saisir une clé d’API")
    go(page, "problem")
    cell = page.locator('tr[data-id="area-1"] td[data-column="x"]')
    expect(cell).to_have_text("1,5")
    cell.dblclick()
    page.keyboard.type("2,25")
    page.keyboard.press("Enter")
    expect(cell).to_have_text("2,25")
    assert state(page, "problem")["targets"][0]["x"] == 2.25

    page.wait_for_selector('html[data-kept="true"]')
    page.get_by_label("Langue").select_option("EN")
    expect(page.locator("html")).to_have_attribute("lang", "en")
    ready(page)
    expect(page.locator("#tab-compare")).to_have_text("Compare")
    expect(cell).to_have_text("2.25")
    page.reload()
    ready(page)
    expect(page.locator("#tab-compare")).to_have_text("Compare")


def test_nothing_is_cut_off_on_a_phone(french):
    page = french
    page.set_viewport_size({"width": 390, "height": 844})
    for view in VIEWS:
        go(page, view)
        assert page.evaluate(CUT_OFF, 390) == [], view
        assert page.evaluate("document.documentElement.scrollWidth") == 390, view


def test_the_files_of_the_languages_are_served_as_what_they_are(french, service):
    for code in CODES:
        answer = french.request.get(f"{service.url}/dashboard/languages/{code}.json")
        assert answer.headers["content-type"].startswith("application/json")
        assert answer.json() == translations(code)
