"""Identifiers in every script are taken; what does not stay in its place in a line is refused by name."""

import re
import unicodedata
from dataclasses import replace

import pytest
from cases import problem_of

from app.api.allocation_models import AllocationRequest
from app.domain.errors import InvalidProblem
from app.domain.identifiers import ID_PATTERN, MAX_ID_LENGTH, fault_of
from app.domain.problem import UAV, Problem, Target


@pytest.mark.parametrize("name", ["F1a-id-sinhala", "F1b-id-persian", "F1c-id-no-break-space"])
def test_names_in_everyday_spelling_are_taken(name):
    assert not problem_of(name).targets[0].id.isprintable()


@pytest.mark.parametrize(
    "identifier",
    [
        "می\u200cخواهم", "क्\u200dष", "Port\u00a0au\u00a0Prince", "Donau\u00addampf", "ירושלים\u200f (A)",
        "\U0001f469\u200d\U0001f469\u200d\U0001f467 Lager \U0001f1f2\U0001f1ff", "\ufeffbom", "a\u2028b",
        "\u2068Aïcha\u2069", "\u202aAB-1\u202c", "\u2067א \u202bב\u2069", "\ue000", "\u202c\u2069 stray ends",
        "\U00012000" * MAX_ID_LENGTH,
    ],
)  # fmt: skip
def test_text_of_any_script_is_taken(identifier):
    assert fault_of(identifier) is None
    assert re.match(ID_PATTERN, identifier)


@pytest.mark.parametrize(
    ("identifier", "said"),
    [
        ("", "0 characters, not in 1..100"),
        ("x" * 101, "101 characters, not in 1..100"),
        ("a\x07b", "'a\\x07b' has U+0007 as character 2, a control character"),
        ("line\nbreak", "U+000A as character 5, a control character"),
        ("a\x85", "U+0085 as character 2, a control character"),
        ("\x00", "U+0000 as character 1, a control character"),
        ("\ud83d", "U+D83D as character 1, half of a surrogate pair"),
        ("a\u202ecba", "U+202E RIGHT-TO-LEFT OVERRIDE as character 2, which makes the text after it"),
        ("\u202dabc\u202c", "U+202D LEFT-TO-RIGHT OVERRIDE as character 1"),
        ("ab\u2067c", "U+2067 RIGHT-TO-LEFT ISOLATE as character 3, which is not closed"),
        ("\u2066\u202a\u2069\u202b", "U+202B RIGHT-TO-LEFT EMBEDDING as character 4, which is not closed"),
        ("\u202a\u2069", "U+202A LEFT-TO-RIGHT EMBEDDING as character 1, which is not closed"),
    ],
)
def test_what_cannot_stand_in_a_line_is_refused_by_name(identifier, said):
    assert said in fault_of(identifier)


def test_only_control_characters_surrogates_and_direction_are_refused():
    for code in range(0x30000):
        character = chr(code)
        refused = unicodedata.category(character) in ("Cc", "Cs") or character in (
            "\u202a\u202b\u202d\u202e\u2066\u2067\u2068"
        )
        assert (fault_of(character) is not None) == refused, hex(code)


def test_a_problem_names_the_identifier_and_its_place():
    problem = Problem((UAV("u", 0, 0, 0, 0, 1.0, 1.0, (1.0,)),), (Target("a", 0, 0, 1.0, (1.0,)),))
    with pytest.raises(InvalidProblem) as refused:
        replace(problem, targets=(replace(problem.targets[0], id="a\tb"),))
    (violation,) = refused.value.violations
    assert violation.pointer == "/targets/0/id"
    assert "U+0009 as character 2" in violation.detail


def test_the_schema_has_the_pattern():
    schema = AllocationRequest.model_json_schema()["$defs"]
    for model in ("UAVModel", "TargetModel"):
        text = next(each for each in schema[model]["properties"]["id"]["anyOf"] if each["type"] == "string")
        assert text == {"type": "string", "minLength": 1, "maxLength": MAX_ID_LENGTH, "pattern": ID_PATTERN}
