"""Reasons, warnings and broken rules in the language of the page; the service says of a UAV what it says."""

import re

import numpy as np
import pytest
from page_modules import run_module
from page_texts import translations
from problems import random_problem
from worlds import random_sorties, random_world

from app.domain.allocation import UnmetCode
from app.domain.records import problem_to_record, to_record
from app.domain.warnings import CODES
from app.missions.effects import GONE
from app.simulation.breaches import NAMES
from app.simulation.explain import explain
from app.solvers.greedy import greedy_plan

SAID = """
    const texts = await load("texts.js");
    texts.speak(given.tag, given.texts);
    const { set } = await load("state.js");
    set({ fields: { settings: { max_steps: { default: 10 } } } });
    const { reasonText, ruleText, whyNobodyFlies } = await load("reasons.js");
    const { warningText } = await load("warnings.js");
    return {
        reasons: (given.unmet ?? []).map(({ problem, plan, unmet }) => reasonText(problem, plan, unmet)),
        warnings: (given.warnings ?? []).map((each) => warningText(given.problem, each)),
        rules: (given.rules ?? []).map((rule) => ruleText({ rule, says: "in English" })),
        why: given.plan ? whyNobodyFlies(given.problem, given.plan) : null,
    };
"""
LANGUAGES = {"en": {}, "fr-FR": translations("fr"), "pt-MZ": translations("pt"), "es-MX": translations("es")}
UAV = {"id": "u", "name": "Kestrel", "x_s": 0, "y_s": 0, "speed": 1.5, "voyage": 9, "loadlist": [1]}
AREA = {"id": "a", "name": "Town", "x": 1, "y": 0, "level": 1, "loadlist": [3], "skills": ["medic"]}
PROBLEM = {
    "crs": "wgs84",
    "uavs": [{**UAV, "dis": 12, "committed": ["a", "a"]}],
    "targets": [AREA],
    "wind": {"speed": 20.5, "direction": 0},
    "materials": [{"name": "food"}],
}
PLAN = {"routes": [{"uav_id": "u", "stops": []}], "unmet": []}
ENGLISH = "what the service says"


def entry(code, **more):
    unmet = {"target_id": "a", "remaining": [3], "code": code, "reason": ENGLISH, "uav_id": "u"}
    return {**unmet, "remedy": None, "relaxation": None, "reward_change": None, "verified": True, **more}


def said(tag, **given):
    return run_module(SAID, {"tag": tag, "texts": LANGUAGES[tag], "problem": PROBLEM, **given})


def pointer_of(code):
    """Where a warning of a code points to, in the problem above."""
    of_areas = ("deadline_passed", "earliest_after_deadline")
    field = "loadlist/0" if code in ("not_carried", "not_needed") else "x_s"
    return f"/targets/0/{field}" if code in of_areas else f"/uavs/0/{field}"


@pytest.mark.parametrize("tag", LANGUAGES)
def test_every_code_has_a_sentence_in_every_language_and_an_unknown_one_the_services(tag):
    codes = [code.value for code in UnmetCode]
    rules = sorted({*NAMES.values(), *GONE} - {"no_such_action"})
    found = said(
        tag,
        unmet=[{"problem": PROBLEM, "plan": PLAN, "unmet": entry(code)} for code in [*codes, "a_new_one"]],
        warnings=[
            {"pointer": pointer_of(code), "code": code, "detail": ENGLISH} for code in [*CODES, "a_new_one"]
        ],
        rules=[*rules, "a_new_one"],
    )
    assert found["reasons"].pop() == found["warnings"].pop() == ENGLISH
    assert found["rules"].pop() == "in English"
    for kind in ("reasons", "warnings", "rules"):
        assert len(set(found[kind])) == len(found[kind])
        assert not {ENGLISH, "in English"} & set(found[kind])
        assert not [text for text in found[kind] if re.search(r"[{}]|undefined|NaN", text)]
    if tag != "en":
        english = said("en", unmet=[{"problem": PROBLEM, "plan": PLAN, "unmet": entry(c)} for c in codes])
        assert not set(found["reasons"]) & set(english["reasons"])


def test_figures_and_names_stand_in_the_sentences_as_the_language_writes_them():
    unmet = [
        entry("wind"),
        entry("not_chosen", step=1, remedy="u flies there first", reward_change=0.125),
        entry("skills"),
    ]
    spent = {"pointer": "/uavs/0/dis", "code": "range_spent", "detail": ENGLISH}
    needed = {"pointer": "/targets/0/loadlist/0", "code": "not_carried", "detail": ENGLISH}
    asked = {
        "unmet": [{"problem": PROBLEM, "plan": PLAN, "unmet": each} for each in unmet],
        "warnings": [spent, needed],
    }
    assert said("fr-FR", **asked)["reasons"] == [
        "Un vent de 20,5 km/h est trop fort pour y aller, ou pour en revenir.",
        "Une visite de plus de Kestrel, avant toutes les autres, rapporterait 0,125 : "
        "un meilleur algorithme ou plus de temps la trouve.",
        "Aucun drone qui en porte n’a les aptitudes que la zone demande : medic.",
    ]
    assert said("es-MX", **asked)["warnings"] == [
        "Kestrel ha volado 12 km, más que su alcance de 9 km.",
        "Hay áreas que necesitan food, y ningún dron que se pueda enviar lo lleva ni lo puede cargar.",
    ]


def test_a_uav_that_the_page_names_is_one_that_the_service_names():
    rng = np.random.default_rng(5)
    given = []
    for number in range(240):
        draw = (random_problem, random_world, random_sorties)[number % 3]
        problem = draw(rng)
        answer = to_record(explain(problem, greedy_plan(problem)))
        body = problem_to_record(problem)
        given += [{"problem": body, "plan": answer, "unmet": unmet} for unmet in answer["unmet"]]
    texts = said("en", unmet=given)["reasons"]
    codes = {each["unmet"]["code"] for each in given}
    named = 0
    for each, text in zip(given, texts, strict=True):
        for uav in each["problem"]["uavs"]:
            if re.search(rf"{re.escape(uav['id'])}\b", text):
                named += 1
                assert re.search(rf"{re.escape(uav['id'])}\b", each["unmet"]["reason"]), (text, each["unmet"])
    assert len(codes) > 12
    assert named > 100


def test_where_nobody_flies_the_reasons_are_counted():
    unmet = [entry("out_of_range"), entry("no_supply"), entry("out_of_range")]
    plan = {**PLAN, "unmet": unmet}
    assert said("en", plan=plan)["why"] == [
        {
            "count": 2,
            "says": "No UAV that carries any of it has the range to fly there, not even directly.",
        },
        {"count": 1, "says": "No UAV that can be sent carries any of it, or can load any."},
    ]
    assert said("en", plan={**plan, "unmet": [*unmet, entry("not_worth_it")]})["why"] == []
    flown = [{"uav_id": "u", "stops": [{"target_id": "a", "step": 1}]}]
    assert said("en", plan={"routes": flown, "unmet": unmet})["why"] == []
