"""What is said of errors: the English text, its sentence and its values, and what JSON holds of them."""

import copy
import json
import math
import pickle

from app.domain.said import from_record, noun, said, to_record


def test_a_text_knows_its_sentence_and_its_values():
    text = said(
        "{id!r} is {value}, not in {low:g}..{high:g}: {names}",
        id="a",
        value=180.0000001,
        low=0.0,
        high=1e12,
        names=["b", "c"],
    )
    assert text == "'a' is 180.0000001, not in 0..1e+12: b, c"
    assert text.sentence == "{id} is {value}, not in {low}..{high}: {names}"
    assert text.values == {"id": "a", "value": 180.0000001, "low": 0.0, "high": 1e12, "names": ["b", "c"]}


def test_json_holds_what_is_said_within_and_numbers_that_are_none():
    text = said("{count} {items}, {value}", count=0, items=noun("UAVs"), value=math.inf)
    record = json.loads(json.dumps(to_record(text), allow_nan=False))
    assert record == {
        "detail": "0 UAVs, inf",
        "sentence": "{count} {items}, {value}",
        "values": {
            "count": 0,
            "items": {"detail": "UAVs", "sentence": "UAVs", "values": {}},
            "value": "inf",
        },
    }
    again = from_record(record)
    assert again == text
    assert to_record(again) == record


def test_a_plain_text_has_no_sentence():
    assert to_record("broken") == {"detail": "broken"}
    assert from_record({"detail": "broken"}) == "broken"


def test_copies_keep_the_sentence():
    text = said("is {value}", value=3)
    for copied in (copy.deepcopy(text), pickle.loads(pickle.dumps(text))):
        assert to_record(copied) == to_record(text)
