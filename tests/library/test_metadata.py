"""What checkpoints of strangers say of themselves: refused with a reason, or stored and listed for ever."""

import json

import numpy as np
import pytest
from safetensors.numpy import save
from sqlalchemy import text

from app.api.library_models import policy_list, policy_model
from app.domain.errors import InvalidCheckpoint
from app.library.entries import new_policy
from app.library.summary import SUMMARY_SPACE, task_summary
from app.simulation.generator import generate
from policy_store.database import Database
from policy_store.library import PolicyLibrary

TASK = generate("uniform", 2, 3, 2, np.random.default_rng(0))
SOUND = {"architecture": "net-1", "algorithm": "qmix", "seed": 5, "metrics": {"reward": 1.5}}


def file(written):
    return save({"w": np.arange(3, dtype=np.float32)}, {"checkpoint": written})


def nested(depth):
    return "[" * depth + "1" + "]" * depth


@pytest.fixture
def library(tmp_path):
    database = Database(f"sqlite:///{tmp_path / 'library.sqlite3'}")
    opened = PolicyLibrary(database)
    opened.migrate()
    opened.database = database
    yield opened
    database.dispose()


@pytest.mark.parametrize(
    ("field", "written"),
    [
        ("metrics", "NaN"),
        ("metrics", '{"reward": NaN}'),
        ("metrics", '{"reward": Infinity}'),
        ("metrics", '{"reward": 1e999}'),
        ("metrics", '{"reward": ' + "9" * 400 + "}"),
        ("metrics", '{"reward": ' + "9" * 5000 + "}"),
        ("metrics", '{"reward": [1, 2]}'),
        ("metrics", '{"reward": {"a": 1}}'),
        ("metrics", '{"reward": "' + "x" * 300 + '"}'),
        ("metrics", '{"' + "x" * 300 + '": 1}'),
        ("metrics", "[1]"),
        ("metrics", '"much"'),
        ("metrics", "{" + ",".join(f'"m{number}": 1' for number in range(101)) + "}"),
        *[("metrics", '{"a": ' + nested(depth) + "}") for depth in (15, 300, 980, 20_000)],
        *[("notes", nested(depth)) for depth in (17, 300, 980, 20_000)],
        *[("format", nested(depth)) for depth in (300, 980)],
        ("algorithm", '""'),
        ("algorithm", '"' + "x" * 129 + '"'),
        ("algorithm", r'"\ud800"'),
        ("algorithm", "null"),
        ("architecture", '""'),
        ("architecture", r'"a\u0000"'),
        ("notes", r'"half \udc00"'),
        ("notes", r'{"half \udc00": 1}'),
        ("notes", r'"\u0000"'),
        ("seed", "true"),
        ("seed", "1.5"),
        ("seed", '"5"'),
        ("seed", str(2**63)),
    ],
    ids=lambda each: each[:30],
)
def test_what_cannot_be_stored_and_sent_again_is_refused(field, written):
    parts = {name: json.dumps(value) for name, value in SOUND.items()} | {field: written}
    content = "{" + ",".join(f'"{name}": {value}' for name, value in parts.items()) + "}"
    with pytest.raises(InvalidCheckpoint) as refused:
        new_policy("a town", TASK, file(content))
    assert 0 < len(refused.value.detail) < 500


def test_what_is_sound_is_listed(library):
    told = {**SOUND, "seed": 2**63 - 1, "metrics": {"a": 1, "b": 0.5, "c": "text", "d": None, "e": True}}
    deepest = json.loads("[" * 14 + "]" * 14)
    policy = library.add(new_policy("a town", TASK, file(json.dumps({**told, "notes": deepest}))))
    shown = json.loads(policy_model(policy).model_dump_json())
    assert shown["metrics"] == told["metrics"]
    assert shown["metadata"]["notes"] == deepest


@pytest.mark.parametrize("column", ["metrics", "metadata", "task"])
@pytest.mark.parametrize(
    "stored",
    [*('{"a": ' + nested(depth) + "}" for depth in (300, 980, 9000)), "{", "7", '{"a": NaN}'],
    ids=lambda each: each[:10] + str(len(each)),
)
def test_a_row_that_is_bad_already_breaks_nothing(library, column, stored):
    for name in ("bad", "sound"):
        library.add(new_policy(name, TASK, file(json.dumps({**SOUND, "name": name})), policy_id=name))
    with library.database.write() as connection:
        spoilt = f"UPDATE policies SET {column} = :stored WHERE id = 'bad'"
        connection.execute(text(spoilt), {"stored": stored})

    page = json.loads(policy_list(library.page(10)).model_dump_json())
    assert [policy["id"] for policy in page["policies"]] == ["sound", "bad"]
    near = library.nearest(SUMMARY_SPACE, task_summary(TASK), 2)
    assert {neighbour.policy.id for neighbour in near} == {"bad", "sound"}
    assert json.loads(policy_model(library.get("bad")).model_dump_json())["id"] == "bad"
    library.delete("bad")
    assert library.count() == 1


def test_a_vector_that_is_bad_already_breaks_no_look_up(library):
    for name in ("shorter", "not-finite", "sound", "sound-too"):
        library.add(new_policy(name, TASK, file(json.dumps({**SOUND, "name": name})), policy_id=name))
    with library.database.write() as connection:
        connection.execute(
            text("UPDATE feature_vectors SET vector = :v, dimension = 1 WHERE policy_id = 'shorter'"),
            {"v": np.zeros(1, "<f4").tobytes()},
        )
        connection.execute(
            text("UPDATE feature_vectors SET vector = :v WHERE policy_id = 'not-finite' AND space = :space"),
            {"v": np.full(28, np.nan, "<f4").tobytes(), "space": SUMMARY_SPACE},
        )
    near = library.nearest(SUMMARY_SPACE, task_summary(TASK), 9)
    assert {neighbour.policy.id for neighbour in near} == {"sound", "sound-too"}
