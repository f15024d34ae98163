"""A policy that cannot be used costs nobody an answer: the next nearest is used, and none is registered."""

import base64
import json
from pathlib import Path

import numpy as np
import pytest
import torch
from referee import replay
from safetensors.torch import load, save
from sqlalchemy import text

from app.allocation import tasks
from app.api.job_kinds import TRAIN, job_kinds
from app.domain.errors import InvalidCheckpoint, InvalidParameters, NoCompatibleSource
from app.domain.records import problem_from_record, problem_to_record
from app.jobs.model import WorkResult
from app.jobs.worker import WorkContext
from app.learning.checkpoints.checkpoint import encode, read_metadata, verify
from app.learning.checkpoints.source_policies import SourcePolicies
from app.learning.parameters import QmixParameters, TransferQmixParameters
from app.learning.qmix import Qmix, qmix_config
from app.learning.transfer import TransferQmix
from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.network.architecture import QMIX_UNIVERSAL_1
from app.learning.universal.request import fine_tuning
from app.learning.universal.request.starts import policy_starts
from app.library.entries import new_policy
from app.missions.store import MissionStore
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate
from app.solvers.protocol import SolverContext
from app.solvers.stop import never
from policy_store.checkpoint import ContainerLimits
from policy_store.database import Database
from policy_store.errors import PolicyNotFound
from policy_store.library import PolicyLibrary

CASES = Path(__file__).parents[2] / "cases"
NAMES = ("near", "far", "farther")
SHORT = {"mode": "paper", "n_epochs": 20, "learning_starts": 5, "drqn_hidden_dim": 8, "qmix_hidden_dim": 4}


def task(seed=0, sizes=(4, 6, 2)):
    return generate("uniform", *sizes, np.random.default_rng(seed))


def checkpoint(policy, problem):
    return encode(
        policy,
        config=policy.config,
        task=problem,
        algorithm="qmix",
        seed=1,
        parameters=QmixParameters(),
        metrics={},
    )


def with_weights(data, value):
    """The same checkpoint, all its weights of one value."""
    tensors = {name: torch.full_like(tensor, value) for name, tensor in load(data).items()}
    return save(tensors, {"checkpoint": json.dumps(read_metadata(data))})


@pytest.fixture
def library(tmp_path):
    database = Database(f"sqlite:///{tmp_path / 'library.db'}")
    opened = PolicyLibrary(database)
    opened.migrate()
    opened.database = database
    yield opened
    database.dispose()


@pytest.fixture
def spoil(library, make_policy, monkeypatch):
    """Puts three policies into the library, the nearest of them spoilt in some way."""

    def fill(how, names=("near",)):
        for number, name in enumerate(NAMES):
            problem = task(number)
            data = checkpoint(make_policy(500 + number + 10 * len(how)), problem)
            if how == "not finite" and name in names:
                data = with_weights(data, float("nan"))
            if how == "of another shape" and name in names:
                tensors = load(data)
                tensors.popitem()
                data = save(tensors, {"checkpoint": json.dumps(read_metadata(data))})
            library.add(new_policy(name, problem, data, policy_id=name))
        if how == "a bit flipped":
            for name in names:
                sha256, data = library.get(name).checkpoint_sha256, bytearray(library.checkpoint(name))
                data[-1] ^= 1
                with library.database.write() as connection:
                    changed = "UPDATE checkpoints SET data = :data WHERE sha256 = :sha256"
                    connection.execute(text(changed), {"data": bytes(data), "sha256": sha256})
        if how == "deleted meanwhile":
            read = PolicyLibrary.checkpoint

            def gone(self, policy_id):
                if policy_id in names:
                    raise PolicyNotFound(policy_id)
                return read(self, policy_id)

            monkeypatch.setattr(PolicyLibrary, "checkpoint", gone)
        return library.database.url

    return fill


WAYS = ("not finite", "of another shape", "a bit flipped", "deleted meanwhile")


@pytest.mark.parametrize("how", WAYS)
def test_it_is_passed_over_everywhere(spoil, how):
    url, problem = spoil(how), task()
    policies = SourcePolicies(url)

    found = policies.shortlist(problem)
    assert sorted(source.policy.id for source in found) == ["far", "farther"]
    assert [source.policy.distance for source in found] == sorted(source.policy.distance for source in found)

    plans, source = policy_starts(problem, compile_problem(problem), url, 1, never)
    assert source.id == found[0].policy.id
    assert len(plans)

    parameters = TransferQmixParameters(n_epochs=0, samples=1, polish=False)
    solution = TransferQmix(parameters, SolverContext(url)).solve(problem, 1, never, lambda _progress: None)
    assert solution.source_policy.id in ("far", "farther")

    with pytest.raises(InvalidParameters, match="'near' cannot be used"):
        policies.asked_for("near", problem, config=qmix_config(problem, QmixParameters()), any_size=True)


def test_where_none_can_be_used_that_is_said(spoil):
    url = spoil("not finite", NAMES)
    with pytest.raises(NoCompatibleSource, match="3 that cannot"):
        SourcePolicies(url).shortlist(task())


def test_many_that_cannot_be_used_hide_none_that_can(library, make_policy):
    problem = task()
    library.add(new_policy("sound", task(3), checkpoint(make_policy(900), task(3)), policy_id="sound"))
    for number in range(25):
        data = with_weights(checkpoint(make_policy(number), problem), float("nan"))
        library.add(new_policy("x", problem, data, policy_id=f"spoilt-{number}"))
        changed = save(
            load(data),
            {"checkpoint": json.dumps({**read_metadata(data), "name": str(number)})},
        )
        library.add(new_policy("x", problem, changed, policy_id=f"also-spoilt-{number}"))
    found = SourcePolicies(library.database.url).shortlist(problem)
    assert [source.policy.id for source in found] == ["sound"]


def test_in_paper_mode_the_next_nearest_of_the_size_is_used(library):
    sizes, parameters = (2, 3, 2), QmixParameters(**SHORT)
    for name, seed in (("near", 1), ("far", 2)):
        problem = task(seed, sizes)
        learned = Qmix(parameters, SolverContext()).solve(problem, seed, never, lambda _p: None).checkpoint
        if name == "near":
            learned = with_weights(learned, float("inf"))
        library.add(new_policy(name, problem, learned, policy_id=name))
    problem = task(1, sizes)
    found = SourcePolicies(library.database.url).most_similar(problem, qmix_config(problem, parameters))
    assert found.policy.id == "far"


def test_what_has_diverged_is_no_checkpoint(make_policy, caplog):
    policy = make_policy(7)
    with torch.no_grad():
        next(policy.parameters()).view(-1)[0] = float("inf")
    assert checkpoint(policy, task()) is None
    assert "a training has diverged" in caplog.messages


def test_fine_tuning_that_diverges_is_stopped_and_leaves_a_plan(spoil, monkeypatch):
    url, problem, epochs = spoil("nothing"), task(), []
    tune = fine_tuning.FineTuning.epoch

    def diverge(tuning, *given, **named):
        epochs.append(1)
        plans = tune(tuning, *given, **named)
        if len(epochs) == 2:
            with torch.no_grad():
                next(tuning.policy.parameters()).fill_(float("nan"))
        return plans

    monkeypatch.setattr(fine_tuning.FineTuning, "epoch", diverge)
    parameters = TransferQmixParameters(n_epochs=9, samples=1, polish=False)
    solution = TransferQmix(parameters, SolverContext(url)).solve(problem, 1, never, lambda _progress: None)
    assert len(epochs) == 2
    assert solution.checkpoint is None
    assert replay(problem_to_record(problem), solution.plan.assignment)["reward"] > 0


def trained(how, monkeypatch, data):
    monkeypatch.setattr(tasks, "allocate", lambda _payload, _context: WorkResult({}, how(data)))
    payload = {"problem": problem_to_record(task())}
    return tasks.train(payload, WorkContext.in_process(lambda _progress: None))


def test_what_a_training_made_is_verified_before_it_is_registered(make_policy, monkeypatch, library):
    data = checkpoint(make_policy(11), task())
    assert trained(lambda sound: sound, monkeypatch, data).artifact == data
    for how in (lambda sound: with_weights(sound, float("nan")), lambda sound: with_weights(sound, 3e38)):
        with pytest.raises(InvalidCheckpoint):
            trained(how, monkeypatch, data)
    assert trained(lambda _sound: None, monkeypatch, data).artifact is None

    kinds = job_kinds(library, MissionStore(library.database), ContainerLimits(), None, None)
    register = next(kind for kind in kinds if kind.name == TRAIN).on_success

    class Job:
        kind, id, payload = TRAIN, "0" * 32, {"problem": problem_to_record(task()), "name": "x"}

    with library.database.write() as connection, pytest.raises(InvalidCheckpoint, match="diverged"):
        register(connection, Job(), WorkResult({}, None))


def test_the_case_that_poisoned_a_library(library):
    case = json.loads((CASES / "library-poison.json").read_text("utf-8"))
    begun, trains, asks = (
        case[f"step_{step}"] for step in ("1_POST_library", "2_POST_library", "3_POST_allocate")
    )

    def record(body):
        uavs = [{**uav, "ret": bool(uav["ret"])} for uav in body["uavs"]]
        objective = {
            "distance_weight": None,
            "return_to_base": True,
            "charge_return": False,
            "unloading": "greedy",
            **body["objective"],
        }
        targets = [{"deadline": None, "service_time": 0.0, **target} for target in body["targets"]]
        return {"uavs": uavs, "targets": targets, "max_steps": 5, "crs": "local", "objective": objective}

    source = record(begun["task"])
    data = base64.b64decode(begun["checkpoint"])
    verify(data, problem_from_record(source))
    library.add(new_policy("strange", problem_from_record(source), data, policy_id="strange"))
    means = {"library_url": library.database.url, "seed": 1, "algorithm": "transfer_qmix"}
    context = WorkContext.in_process(lambda _progress: None)
    learning = {**trains["train"]["parameters"], "source": "strange"}
    try:
        made = tasks.train({"problem": record(trains["task"]), "parameters": learning, **means}, context)
    except (InvalidCheckpoint, InvalidParameters):
        made = WorkResult({}, None)
    if made.artifact is not None:
        problem = problem_from_record(record(trains["task"]))
        library.add(new_policy("made of it", problem, made.artifact, policy_id="made"))

    asked = record(asks)
    done = tasks.allocate({"problem": asked, "parameters": asks["parameters"], **means}, context)
    assert replay(asked, done.result["assignment"])["reward"] == pytest.approx(done.result["reward"])
    assert library.get("strange").architecture == QMIX_UNIVERSAL_1
    assert isinstance(
        SourcePolicies(library.database.url).shortlist(problem_from_record(asked))[0].network, UniversalPolicy
    )
