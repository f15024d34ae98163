import hashlib
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime

import numpy as np
import pytest
from sqlalchemy import func, select, text, update

from policy_store.database import Database
from policy_store.errors import (
    CorruptCheckpoint,
    DuplicatePolicy,
    InvalidContainer,
    InvalidCursor,
    InvalidPolicy,
    InvalidVector,
    PolicyNotFound,
)
from policy_store.library import PolicyLibrary
from policy_store.tables import checkpoints, feature_vectors

SPACE = "task-description-1/5x10x3"


@pytest.fixture
def url(any_database_url: str) -> str:
    return any_database_url


def rows(database: Database, table) -> int:
    with database.read() as connection:
        return connection.execute(select(func.count()).select_from(table)).scalar_one()


def test_a_policy_comes_back_as_it_was_given(library: PolicyLibrary, url: str, new_policy) -> None:
    before = datetime.now(UTC)
    new = new_policy(
        name="Überflutung, 5×10",
        seed=2**63 - 1,
        task={"targets": [{"level": 0.1, "loadlist": (1, 2.5)}], "note": None},
        metrics={"reward": 2.4430000000000001, "epochs": 7700},
        metadata={"commit": "abc"},
        vectors={SPACE: [1.5, -2], "other-1": np.arange(3)},
    )
    added = library.add(new)
    after = datetime.now(UTC)

    again = Database(url)
    policy = PolicyLibrary(again).get(added.id)
    assert policy == added
    assert policy.id.startswith("pol_")
    assert len(policy.id) == 24
    assert policy.name == "Überflutung, 5×10"
    assert policy.seed == 2**63 - 1
    assert policy.task == {"targets": [{"level": 0.1, "loadlist": [1, 2.5]}], "note": None}
    assert policy.metrics == {"reward": 2.443, "epochs": 7700}
    assert policy.metadata == {"commit": "abc"}
    assert (policy.n_uavs, policy.n_targets, policy.n_materials) == (5, 10, 3)
    assert before <= policy.created_at <= after
    assert policy.created_at.tzinfo is UTC
    assert policy.checkpoint_sha256 == hashlib.sha256(new.checkpoint).hexdigest()
    assert policy.checkpoint_size == len(new.checkpoint)
    assert library.checkpoint(policy.id) == new.checkpoint
    vectors = library.vectors(policy.id)
    assert {space: vector.tolist() for space, vector in vectors.items()} == {
        SPACE: [1.5, -2.0],
        "other-1": [0.0, 1.0, 2.0],
    }
    again.dispose()


def test_adding_the_same_again_changes_nothing(library: PolicyLibrary, new_policy) -> None:
    first = library.add(new_policy(id="seed-1", metrics={"reward": 0.1 + 0.2}))
    assert library.add(new_policy(id="seed-1", metrics={"reward": 0.1 + 0.2})) == first
    assert library.count() == 1


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        ({"name": "another"}, ("name",)),
        ({"task": {}}, ("task",)),
        ({"seed": 0}, ("seed",)),
        ({"vectors": {SPACE: [1.0, 0.5]}}, ("vectors",)),
        ({"vectors": {}}, ("vectors",)),
        ({"weight": 2.0, "vectors": {SPACE: [1.0, 0.0]}}, ("checkpoint_sha256",)),
    ],
)
def test_another_policy_of_the_same_id_is_refused(library: PolicyLibrary, new_policy, change, fields) -> None:
    first = library.add(new_policy(id="seed-1"))
    with pytest.raises(DuplicatePolicy, match="'seed-1'") as refused:
        library.add(new_policy(**{"id": "seed-1", **change}))
    assert refused.value.fields == fields
    assert library.get("seed-1") == first
    assert library.count() == 1


def test_threads_that_add_the_same_id_add_it_once(library: PolicyLibrary, new_policy) -> None:
    new = new_policy(id="seed-1")
    with ThreadPoolExecutor(6) as threads:
        added = list(threads.map(lambda _: library.add(new), range(12)))
    assert all(policy == added[0] for policy in added)
    assert library.count() == 1


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("id", ""),
        ("id", "../etc"),
        ("id", "a" * 129),
        ("id", "a\n"),
        ("name", ""),
        ("name", "a" * 257),
        ("name", "\ud800"),
        ("name", "a\0b"),
        ("architecture", ""),
        ("algorithm", 5),
        ("n_uavs", 0),
        ("n_targets", True),
        ("n_materials", 2**31),
        ("seed", 2**63),
        ("seed", 1.0),
        ("task", []),
        ("task", {"x": float("nan")}),
        ("metrics", {"x": float("inf")}),
        ("metadata", {"x": object()}),
        ("metadata", {"x": "\udfff"}),
        ("vectors", {"": [1.0]}),
    ],
)
def test_fields_that_cannot_be_stored_are_refused(new_policy, field: str, value: object) -> None:
    with pytest.raises(InvalidPolicy) as refused:
        new_policy(**{field: value})
    assert refused.value.field == field
    str(refused.value).encode()


@pytest.mark.parametrize("vector", [[], [[1.0]], 1.0, [float("nan")], [float("inf")], [1e39]])
def test_vectors_that_cannot_be_compared_are_refused(new_policy, library: PolicyLibrary, vector) -> None:
    with pytest.raises(InvalidVector, match=SPACE):
        new_policy(vectors={SPACE: vector})
    with pytest.raises(InvalidVector, match=SPACE):
        library.nearest(SPACE, vector, 1)


def test_a_policy_cannot_be_changed_through_what_it_was_made_of(new_policy) -> None:
    task, vector = {"x": [1]}, np.ones(2, np.float32)
    new = new_policy(task=task, vectors={SPACE: vector})
    task["x"].append(2)
    vector[0] = 7
    assert new.task == {"x": [1]}
    assert new.vectors[SPACE].tolist() == [1.0, 1.0]
    with pytest.raises(ValueError, match="read-only"):
        new.vectors[SPACE][0] = 3


def test_a_space_has_one_dimension(library: PolicyLibrary, database: Database, new_policy) -> None:
    library.add(new_policy())
    with pytest.raises(InvalidVector, match="3 numbers, the space has 2"):
        library.add(new_policy(weight=2.0, vectors={SPACE: [1, 2, 3]}))
    with pytest.raises(InvalidVector, match="3 numbers, the space has 2"):
        library.nearest(SPACE, [1, 2, 3], 1)
    assert (library.count(), rows(database, checkpoints)) == (1, 1)


def test_what_is_no_safetensors_file_is_not_taken(library: PolicyLibrary, new_policy) -> None:
    with pytest.raises(InvalidContainer):
        library.add(new_policy(checkpoint=b"\x80\x04\x95pickle"))
    assert library.count() == 0


def test_what_is_not_there_is_not_found(library: PolicyLibrary) -> None:
    for method in (library.get, library.delete, library.checkpoint, library.vectors):
        with pytest.raises(PolicyNotFound, match="'pol_nothing'"):
            method("pol_nothing")


@pytest.mark.parametrize(
    "damage", [lambda data: data[:-1] + bytes([data[-1] ^ 1]), lambda data: data[:-1], lambda data: data * 0]
)
def test_a_damaged_checkpoint_is_detected(
    library: PolicyLibrary, database: Database, new_policy, damage
) -> None:
    damaged, other = library.add(new_policy()), library.add(new_policy(weight=2.0))
    data = library.checkpoint(damaged.id)
    with database.write() as connection:
        where = checkpoints.c.sha256 == damaged.checkpoint_sha256
        connection.execute(update(checkpoints).where(where).values(data=damage(data)))
    with pytest.raises(CorruptCheckpoint, match=damaged.checkpoint_sha256) as refused:
        library.checkpoint(damaged.id)
    assert refused.value.policy_id == damaged.id
    assert library.checkpoint(other.id) == new_policy(weight=2.0).checkpoint


def test_a_checkpoint_goes_with_the_last_policy_that_has_it(
    library: PolicyLibrary, database: Database, new_policy
) -> None:
    first, second = library.add(new_policy(name="a")), library.add(new_policy(name="b"))
    third = library.add(new_policy(weight=3.0))
    assert (rows(database, checkpoints), rows(database, feature_vectors)) == (2, 3)
    library.delete(first.id)
    assert library.checkpoint(second.id) == new_policy().checkpoint
    assert (rows(database, checkpoints), rows(database, feature_vectors)) == (2, 2)
    library.delete(second.id)
    assert (rows(database, checkpoints), rows(database, feature_vectors)) == (1, 1)
    library.delete(third.id)
    assert (rows(database, checkpoints), rows(database, feature_vectors), library.count()) == (0, 0, 0)


def test_a_callers_transaction_decides(library: PolicyLibrary, database: Database, new_policy) -> None:
    kept = library.add(new_policy(name="kept"))

    def change_and_fail() -> None:
        with database.write() as connection:
            library.add(new_policy(name="lost", weight=9.0), connection)
            library.delete(kept.id, connection)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        change_and_fail()
    assert [policy.name for policy in library.page(10).policies] == ["kept"]
    assert [n.policy.name for n in library.nearest(SPACE, [9, 0], 5)] == ["kept"]
    with database.write() as connection:
        library.add(new_policy(name="new", weight=9.0), connection)
        connection.execute(text("CREATE TABLE mine (x INTEGER)"))
    assert [n.policy.name for n in library.nearest(SPACE, [9, 0], 5)] == ["new", "kept"]


def test_pages_are_stable_while_policies_come_and_go(library: PolicyLibrary, new_policy) -> None:
    ids = [library.add(new_policy(name=str(number))).id for number in range(10)]
    seen, cursor = [], None
    for step in range(3):
        page = library.page(3, cursor)
        seen += [policy.id for policy in page.policies]
        cursor = page.next_cursor
        library.add(new_policy(name=f"late {step}"))
        if step == 0:
            library.delete(ids[9])  # shown already
            library.delete(ids[7])  # the one the cursor stands at
            library.delete(ids[5])  # not shown yet
    expected = [ids[9], ids[8], ids[7], ids[6], *ids[4::-1]]
    assert seen == expected
    assert cursor is None


def test_a_full_last_page_has_no_next(library: PolicyLibrary, new_policy) -> None:
    assert library.page(3).policies == ()
    for number in range(6):
        library.add(new_policy(name=str(number)))
    first = library.page(3)
    assert [policy.name for policy in first.policies] == ["5", "4", "3"]
    second = library.page(3, first.next_cursor)
    assert [policy.name for policy in second.policies] == ["2", "1", "0"]
    assert second.next_cursor is None


@pytest.mark.parametrize("cursor", ["", "x", "-1", "1.5", "٣", "9" * 19, "1 OR 1=1"])
def test_other_cursors_are_refused(library: PolicyLibrary, cursor: str) -> None:
    with pytest.raises(InvalidCursor):
        library.page(3, cursor)


def test_no_less_than_one_can_be_asked_for(library: PolicyLibrary) -> None:
    with pytest.raises(ValueError, match="limit is 0"):
        library.page(0)
    with pytest.raises(ValueError, match="k is 0"):
        library.nearest(SPACE, [1.0], 0)


def test_sizes_are_listed_once_in_order(library: PolicyLibrary, new_policy) -> None:
    assert library.sizes() == []
    for size in ((20, 5, 3), (5, 10, 3), (5, 10, 2), (5, 10, 3)):
        library.add(new_policy(n_uavs=size[0], n_targets=size[1], n_materials=size[2]))
    library.add(new_policy(n_uavs=7, architecture="pointer-1"))
    assert library.sizes() == [(5, 10, 2), (5, 10, 3), (7, 10, 3), (20, 5, 3)]
    assert library.sizes("pointer-1") == [(7, 10, 3)]
