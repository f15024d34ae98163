"""Errors of the service in the languages of the page: each sentence has its translations, with its values."""

import json

import pytest
from dashboard_steps import PATIENCE_MS, go, open_problem, ready
from page_modules import run_module
from page_texts import DASHBOARD, LANGUAGES, places
from playwright.sync_api import expect
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from said_sentences import said_sentences

from app.api.plan_formats.waypoints import UnreadableFlight, read_flight_file
from app.api.problem_details import problem_response
from app.domain.said import said, to_record
from app.field_errors import in_words

CODES = [path.stem for path in LANGUAGES]
COMPUTED = [
    "api/problem_models.py",
    "domain/fields.py",
    "domain/problem_rules.py",
    "field_errors.py",
    "field_errors.py",
]
"""Calls whose sentence is no literal: what lists of items are called, and the two tables of field errors."""

SPOKEN = """
    const { speak } = await load("texts.js");
    const said = await load("said.js");
    speak(given.tag, {}, given.ofService);
    return given.calls.map(([name, ...values]) => said[name](...values));
"""


def of_service(code):
    return json.loads((DASHBOARD / "languages" / "service" / f"{code}.json").read_text())


def spoken(code, *calls, tag=None):
    return run_module(SPOKEN, {"tag": tag or code, "ofService": of_service(code), "calls": calls})


def test_every_sentence_is_a_literal_whose_places_are_its_values():
    found = said_sentences()
    assert found.computed == COMPUTED
    assert {sentence: places(sentence) for sentence in found.values} == found.values


@pytest.mark.parametrize("code", CODES)
def test_every_sentence_and_every_type_has_a_translation_with_the_same_places(code):
    errors = of_service(code)["errors"]
    assert errors.keys() == said_sentences().texts()
    assert {text: places(text) for text in errors} == {text: places(each) for text, each in errors.items()}
    assert list(errors) == sorted(errors)


class Model(BaseModel):
    """A value of each kind that a check of fields tells apart."""

    model_config = ConfigDict(extra="forbid")

    number: float = Field(default=1, gt=0, lt=1e6)
    positive: float = Field(default=1, ge=1e-100)
    closed: float = Field(default=1, ge=0.5, le=9.5, allow_inf_nan=False)
    whole: int = 1
    text: str = Field(default="ab", min_length=2, max_length=4, pattern="^[a-z]+$")
    flag: bool = True
    items: list[int] = Field(default=[1], min_length=1, max_length=2)
    table: dict[str, int] = {}


WRONG = [
    {"number": 0},
    {"positive": -0.5},
    {"positive": 1e-200},
    {"number": 2e6},
    {"closed": 0.25},
    {"closed": 10},
    {"closed": float("inf")},
    {"whole": 1.5},
    {"whole": None},
    {"whole": "x"},
    {"text": 3},
    {"text": "a"},
    {"text": "abcde"},
    {"text": "AB"},
    {"flag": 7},
    {"items": []},
    {"items": [1, 2, 3]},
    {"items": {}},
    {"table": []},
    {"numbr": 1},
    {"nothing like it": 1},
]


def test_what_pydantic_finds_has_a_sentence():
    for body in WRONG:
        with pytest.raises(ValidationError) as refused:
            Model.model_validate(body)
        (error,) = refused.value.errors()
        text = in_words(error, list(Model.model_fields))
        assert to_record(text).keys() == {"detail", "sentence", "values"}, body


def test_numbers_are_written_as_the_language_writes_them():
    beyond = {"type": "less_than_equal", "input": 12345.5, "ctx": {"le": 0.25}, "loc": ("speed",)}
    tiny = said("{value} is not in {low:g}..{high:g}", value=180.0000001, low=1e-9, high=1e12)
    calls = [["said", to_record(text)] for text in (in_words(beyond), tiny)]
    assert spoken("fr", *calls, tag="fr-FR") == [
        "vaut 12\u202f345,5, doit être au plus 0,25",
        "180,0000001 n’est pas entre 1E\u22129 et 1\u202f000\u202f000\u202f000\u202f000",
    ]
    assert spoken("es", *calls, tag="es-MX")[0] == "es 12,345.5, debe ser como máximo 0.25"


def test_an_error_without_a_translation_stays_english():
    plain = {"detail": "something else"}
    unknown = {"detail": "7 odd things", "sentence": "{count} odd things", "values": {"count": 7}}
    assert spoken("fr", ["said", plain], ["said", unknown]) == ["something else", "7 odd things"]


def test_what_is_wrong_with_a_flight_file_is_said_within_its_name():
    with pytest.raises(UnreadableFlight) as unread:
        read_flight_file("QGC WPL 110\n0 1 0 16 0 0 0 0 -91.5 34 0 1\n")
    why = to_record(said("{file}: {why}", file="a.waypoints", why=unread.value.detail))
    assert why["detail"] == "a.waypoints: line 2: latitude -91.5 is not in -90..90"
    assert spoken("fr", ["said", why]) == [
        "a.waypoints\xa0: ligne 2\xa0: latitude −91,5 n’est pas entre −90 et 90"
    ]


def test_a_request_is_refused_in_the_words_of_its_first_field_or_of_its_type():
    first = {"pointer": "/uavs/0/speed", **to_record(said("is missing"))}
    problem = {"title": "The database does not answer", "detail": "in English"}
    assert spoken(
        "es",
        ["saidOfProblem", {**problem, "errors": [first]}],
        ["saidOfProblem", problem],
        ["saidOfProblem", {**problem, **to_record(said("the service is stopping"))}],
        ["saidOfProblem", {"detail": "in English"}],
    ) == [
        "/uavs/0/speed: falta",
        "La base de datos no responde (in English)",
        "el servicio se está deteniendo",
        "in English",
    ]


def test_an_answer_has_the_sentence_of_a_refusal_beside_its_text():
    body = json.loads(
        problem_response("job-not-found", said("there is no job {id!r}", id="\ud800"), "/").body
    )
    assert body["detail"] == "there is no job '\\ud800'"
    assert (body["sentence"], body["values"]) == ("there is no job {id}", {"id": "\\ud800"})
    assert body["title"] in of_service("fr")["errors"]


def test_the_page_says_in_its_language_what_the_service_refuses(browser, service):
    with browser.new_context(viewport={"width": 1366, "height": 900}, locale="fr-FR") as context:
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        page.goto(service.url)
        ready(page)
        uav = {"x_s": 0, "y_s": 0, "speed": 1, "voyage": 9, "loadlist": [3]}
        area = {"id": "area-1", "x": 1.5, "y": 1, "level": 2, "loadlist": [3]}
        problem = {"uavs": [{**uav, "id": "a"}, {**uav, "id": "b", "speed": -1.5}], "targets": [area]}
        open_problem(page, problem, "un essai")
        go(page, "allocate")
        page.locator("#allocate-form button.primary").click()
        refused = page.locator("#violations li")
        expect(refused).to_contain_text("b, vitesse vaut −1,5, doit être supérieur à 0")
