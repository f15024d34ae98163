"""Library entries of checkpoints, and an empty library that begins with the shipped ones."""

import json
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save
from sqlalchemy import text

from app.domain.errors import InvalidCheckpoint
from app.domain.records import problem_to_record
from app.library import seeding
from app.library.description import description_space, task_description
from app.library.entries import new_policy
from app.simulation.generator import generate
from policy_store.database import Database
from policy_store.errors import InvalidPolicy, PolicyNotFound
from policy_store.library import PolicyLibrary


def task(seed=0):
    return generate("uniform", 2, 3, 2, np.random.default_rng(seed))


def checkpoint(problem, **changes):
    metadata = {
        "format": 1,
        "architecture": "net-1",
        "algorithm": "qmix",
        "config": {"n_uavs": 2},
        "task": problem_to_record(problem),
        "seed": 5,
        "metrics": {"reward": 1.5},
        **changes,
    }
    return save({"w": np.arange(3, dtype=np.float32)}, {"checkpoint": json.dumps(metadata)})


@pytest.fixture
def database(tmp_path):
    opened = Database(f"sqlite:///{tmp_path}/library.sqlite3")
    yield opened
    opened.dispose()


@pytest.fixture
def library(database):
    empty = PolicyLibrary(database)
    empty.migrate()
    return empty


@pytest.fixture
def shipped(tmp_path, monkeypatch):
    """A folder that stands where the shipped policies are."""
    folder = tmp_path / "seed"
    folder.mkdir()
    monkeypatch.setattr(seeding.resources, "files", lambda _package: tmp_path)
    return folder


def test_entry_says_what_the_checkpoint_says(library):
    problem = task()

    policy = library.add(new_policy("a town", problem, checkpoint(problem)))

    assert (policy.name, policy.architecture, policy.algorithm, policy.seed) == ("a town", "net-1", "qmix", 5)
    assert (policy.n_uavs, policy.n_targets, policy.n_materials) == (2, 3, 2)
    assert policy.metrics == {"reward": 1.5}
    assert policy.metadata["config"] == {"n_uavs": 2}
    assert policy.task == problem_to_record(problem)
    nearest = library.nearest(description_space(problem), task_description(problem), 1)
    assert [(item.policy.id, item.distance) for item in nearest] == [(policy.id, pytest.approx(0, abs=1e-10))]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"not a safetensors file",
        save({"w": np.zeros(1, np.float32)}),
        save({"w": np.zeros(1, np.float32)}, {"checkpoint": "no JSON"}),
        save({"w": np.zeros(1, np.float32)}, {"checkpoint": "[]"}),
        save({"w": np.zeros(1, np.float32)}, {"checkpoint": "[" * 5000}),
        save({"w": np.zeros(1, np.float32)}, {"checkpoint": "{}"}),
        save({"w": np.zeros(1, np.float32)}, {"checkpoint": '{"architecture": 1, "algorithm": "qmix"}'}),
    ],
)
def test_file_that_is_no_checkpoint(data):
    with pytest.raises(InvalidCheckpoint):
        new_policy("x", task(), data)


def test_name_that_cannot_be_stored():
    with pytest.raises(InvalidPolicy):
        new_policy("", task(), checkpoint(task()))


def test_shipped_policies_are_put_into_an_empty_library_once(library, database, shipped):
    problems = {"b-town": task(1), "a-town": task(2)}
    for name, problem in problems.items():
        (shipped / f"{name}.safetensors").write_bytes(checkpoint(problem, name=name.upper()))
    (shipped / "README.md").write_text("not a policy")

    assert seeding.seed_library(library, database) == 2
    assert seeding.seed_library(library, database) == 0

    for name, problem in problems.items():
        policy = library.get(name)
        assert policy.name == name.upper()
        assert policy.task == problem_to_record(problem)
        assert library.checkpoint(name) == (shipped / f"{name}.safetensors").read_bytes()
    assert library.count() == 2


def test_a_new_version_brings_its_policies_and_deleted_ones_stay_deleted(library, database, shipped):
    library.add(new_policy("own", task(), checkpoint(task()), policy_id="own"))
    (shipped / "a-town.safetensors").write_bytes(checkpoint(task()))
    assert seeding.seed_library(library, database) == 1

    library.delete("a-town")
    assert seeding.seed_library(library, database) == 0
    (shipped / "b-town.safetensors").write_bytes(checkpoint(task(1)))
    # Weights that are shipped anew under an old id are not put over those there are.
    (shipped / "a-town.safetensors").write_bytes(checkpoint(task(2)))
    assert seeding.seed_library(library, database) == 1
    assert seeding.seed_library(library, database) == 0
    with pytest.raises(PolicyNotFound):
        library.get("a-town")

    for policy_id in ("own", "b-town"):
        library.delete(policy_id)
    assert seeding.seed_library(library, database) == 0
    assert library.count() == 0


def test_an_id_that_somebody_has_taken_is_left_to_them(library, database, shipped):
    own = new_policy("own", task(), checkpoint(task()), policy_id="a-town")
    library.add(own)
    for name in ("a-town", "b-town"):
        (shipped / f"{name}.safetensors").write_bytes(checkpoint(task(7), name=name))
    assert seeding.seed_library(library, database) == 1
    assert library.get("a-town").name == "own"
    library.delete("a-town")
    assert seeding.seed_library(library, database) == 0


@pytest.mark.parametrize("used", [False, True])
def test_a_library_of_a_version_without_records_gets_only_what_is_new(database, shipped, used):
    """What it had seeded is not known, so all that could have been counts as deleted."""
    before = "uniform-5x10x3"
    for name in (before, "new-town"):
        (shipped / f"{name}.safetensors").write_bytes(checkpoint(task(), name=name))
    library = PolicyLibrary(database)
    library.migrate()
    with database.write() as connection:
        connection.execute(text("DROP TABLE seeded_policies"))
        connection.execute(text("UPDATE alembic_version_library SET version_num = '0001'"))
        if used:
            connection.execute(text("UPDATE library_revision SET revision = 35"))
    library.migrate()

    assert seeding.seed_library(library, database) == (1 if used else 2)
    assert library.count() == (1 if used else 2)
    assert library.get("new-town")


def test_what_was_shipped_before_there_were_records_is_known():
    folder = Path(seeding.__file__).parent / "seed"
    still = {file.stem for file in folder.glob("*.safetensors")}
    # The policies for every size have been replaced since, those for one size are the same.
    assert {name for name in seeding.SHIPPED_BEFORE if not name.startswith("universal-3")} <= still
    assert len(seeding.SHIPPED_BEFORE) == 35


def test_nothing_is_read_of_what_is_known(library, database, shipped):
    (shipped / "a-town.safetensors").write_bytes(checkpoint(task()))
    assert seeding.seed_library(library, database) == 1
    (shipped / "a-town.safetensors").write_bytes(b"damaged")
    assert seeding.seed_library(library, database) == 0


def test_one_damaged_file_keeps_all_out(library, database, shipped):
    (shipped / "a-town.safetensors").write_bytes(checkpoint(task()))
    (shipped / "b-town.safetensors").write_bytes(checkpoint(task(), task={"uavs": []}))

    with pytest.raises(InvalidCheckpoint, match=r"b-town\.safetensors"):
        seeding.seed_library(library, database)
    assert library.count() == 0


def test_without_shipped_policies_the_library_stays_empty(library, database, shipped):
    assert seeding.seed_library(library, database) == 0
    shipped.rmdir()
    assert seeding.seed_library(library, database) == 0
