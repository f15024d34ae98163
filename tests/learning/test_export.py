"""Agents exported to ONNX: ONNX Runtime plays the same episodes as torch, on every shape."""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

import app.learning
from app.cli import application
from app.learning.checkpoints.checkpoint import decode
from app.learning.checkpoints.export import ExtraNotInstalled, to_onnx
from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.episode import Actor
from app.learning.parameters import QmixParameters
from app.learning.qmix import Qmix
from app.learning.universal.episodes.observation import (
    look,
    look_again,
    nearness,
    new_gains,
    observe,
    scales,
)
from app.learning.universal.episodes.rollout import play
from app.learning.universal.network.architecture import (
    OWN_FEATURES,
    PAIR_FEATURES,
    QMIX_UNIVERSAL_1,
    RIVAL_FEATURES,
)
from app.learning.universal.network.on_board import OWN_NAMES, PAIR_NAMES, RIVAL_NAMES, UniversalOnBoard
from app.library.seeding import shipped_policies
from app.simulation.arrays import compile_problem
from app.simulation.generator import FAMILIES, generate
from app.simulation.simulator import act, end_step, new_episodes
from app.solvers.protocol import SolverContext
from app.solvers.stop import never

onnxruntime = pytest.importorskip("onnxruntime", reason="the extra onnx is not installed")

CASES = Path(__file__).parents[1] / "cases"
SHAPES = ((1, 1, 1), (1, 4, 2), (5, 10, 3), (7, 3, 6), (12, 25, 2))


@pytest.fixture(scope="module")
def checkpoint():
    """Weights that were trained, and shipped until 2026, so that episodes are flown in earnest."""
    return (CASES / "universal-3.safetensors").read_bytes()


@pytest.fixture(scope="module")
def policy(checkpoint):
    return decode(checkpoint).network


@pytest.fixture(scope="module")
def model(checkpoint):
    return to_onnx(checkpoint)


@pytest.fixture(scope="module")
def session(model):
    return start(model)


def start(model):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def fly(session, policy, problem):
    """Play an episode as the computers on board do: each UAV feeds what it sees, and acts.

    Yields the inputs and outputs of every turn; the plan is returned.
    """
    arrays = compile_problem(problem)
    m, n, _ = arrays.shape
    episodes, gains = new_episodes(arrays, 1), new_gains(arrays, 1)
    look(arrays, episodes, gains)
    hidden = [np.zeros((1, policy.config.width), np.float32)] * m
    distances = nearness(arrays, scales(arrays)[0])[0]
    plan = np.full((problem.max_steps, m), n)
    for step in range(problem.max_steps):
        if episodes.done[0]:
            break
        gains.acted[:] = False
        for i in range(m):
            gains.acted[0, :i] = True
            if episodes.ret[0, i]:
                continue
            pair, own = np.empty((n, PAIR_FEATURES), np.float32), np.empty(OWN_FEATURES, np.float32)
            rivals = np.empty((n, m, RIVAL_FEATURES), np.float32)
            observe(arrays, episodes, gains, 0, i, pair, own, rivals)
            fed = dict(
                zip(
                    UniversalOnBoard.INPUTS,
                    (pair[None], own[None], rivals[None], distances, hidden[i]),
                    strict=True,
                )
            )
            given = dict(zip(UniversalOnBoard.OUTPUTS, session.run(None, fed), strict=True))
            yield fed, given
            hidden[i], action = given["new_hidden"], int(given["action"][0])
            plan[step, i] = action
            act(arrays, episodes, 0, i, action)
            look_again(arrays, episodes, gains, 0, i, action)
        end_step(arrays, episodes, 0)
    return plan


def collect(turns):
    """Run a generator to its end; what it yielded, and what it returned."""
    found = []
    while True:
        try:
            found.append(next(turns))
        except StopIteration as end:
            return found, end.value


@pytest.mark.parametrize("shape", SHAPES)
def test_onnx_runtime_plays_the_same_episodes_as_torch(session, policy, shape):
    flown = 0
    for family in FAMILIES:
        problem = generate(family, *shape, np.random.default_rng([7, *family.encode()]))
        turns, plan = collect(fly(session, policy, problem))
        played = play(policy.agent, compile_problem(problem), np.zeros(1, np.int64)).plans[0]
        assert np.array_equal(plan, played[: len(plan)])
        flown += int((plan < problem.n_targets).sum())
        for fed, given in turns:
            with torch.inference_mode():
                tensors = [torch.from_numpy(array) for array in fed.values()]
                expected = UniversalOnBoard(policy.agent)(*tensors)
            for name, tensor in zip(UniversalOnBoard.OUTPUTS, expected, strict=True):
                # Log-odds are values times some fifty.
                near = 1e-3 if name == "logits" else 2e-5
                np.testing.assert_allclose(given[name], tensor.numpy(), rtol=1e-4, atol=near, err_msg=name)
    assert flown > 0


def test_only_allowed_visits_are_taken_whatever_they_are_worth(session, policy):
    rng = np.random.default_rng(11)
    for _ in range(20):
        t, n, m = rng.integers(1, 9, 3)
        fed = {
            "pair": rng.normal(size=(t, n, PAIR_FEATURES)),
            "own": rng.normal(size=(t, OWN_FEATURES)),
            "rivals": rng.normal(size=(t, n, m, RIVAL_FEATURES)),
            "distances": rng.random((n, n)),
            "hidden": rng.normal(size=(t, policy.config.width)),
        }
        fed = {name: array.astype(np.float32) for name, array in fed.items()}
        allowed = rng.random((t, n)) < 0.3
        fed["pair"][:, :, 0] = allowed
        values, logits, action, _ = session.run(None, fed)
        assert np.array_equal(np.isfinite(logits), np.pad(allowed, ((0, 0), (0, 1)), constant_values=True))
        assert np.isfinite(values).all()
        assert np.array_equal(action, np.where(np.isfinite(logits), logits, -np.inf).argmax(axis=1))
        assert all(a == n or allowed[i, a] for i, a in enumerate(action))


def test_the_model_says_what_it_is_and_tells_nothing_of_this_machine(model, session, checkpoint):
    said = session.get_modelmeta().custom_metadata_map
    about = json.loads(said["checkpoint"])
    assert about["architecture"] == QMIX_UNIVERSAL_1
    assert said["sha256"] == hashlib.sha256(checkpoint).hexdigest()
    assert json.loads(said["columns"])["pair"] == list(PAIR_NAMES)
    assert decode(checkpoint).metadata["features"] == about["features"]
    shapes = {each.name: each.shape for each in session.get_inputs()}
    assert shapes["rivals"] == ["turns", "targets", "uavs", RIVAL_FEATURES]
    assert b"site-packages" not in model
    assert b".py" not in model


def test_columns_have_names_and_the_names_are_explained():
    counts = tuple(map(len, (PAIR_NAMES, OWN_NAMES, RIVAL_NAMES)))
    assert counts == (PAIR_FEATURES, OWN_FEATURES, RIVAL_FEATURES)
    explained = (Path(app.learning.__file__).parent / "ON_BOARD.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:3] for line in explained.splitlines() if line.startswith("| ")]
    listed = {(number.strip(), name.strip(" `")) for number, name in rows}
    for names in (PAIR_NAMES, OWN_NAMES, RIVAL_NAMES):
        assert listed >= {(str(number), name) for number, name in enumerate(names)}


@pytest.fixture(scope="module")
def task():
    return generate("uniform", 4, 6, 2, np.random.default_rng(12))


@pytest.fixture(scope="module")
def learned(task):
    """A checkpoint for one size."""
    parameters = QmixParameters(mode="paper", n_epochs=30, learning_starts=8, lr=5e-3)
    return Qmix(parameters, SolverContext()).solve(task, 1, never, lambda _progress: None).checkpoint


@pytest.fixture(scope="module")
def paper_model(learned):
    return to_onnx(learned)


def test_agents_of_the_paper_are_exported_too(task, learned, paper_model):
    session, network = start(paper_model), decode(learned).network
    environment = SwarmEnvironment(task)
    played = Actor(environment, network).play_greedily()
    assert played.length > 1
    m, n_actions, own = task.n_uavs, task.n_targets + 1, environment.sizes.own_features
    hidden = np.zeros((m, network.agent.hidden_dim), np.float32)
    last = np.zeros((m, n_actions), np.float32)
    states, before = None, None
    for step in range(played.length):
        state = played.states[step]
        rows, common = state[: m * own].reshape(m, own), state[m * own :]
        values, action, hidden = session.run(
            None,
            {
                "observation": np.concatenate((rows, np.tile(common, (m, 1))), axis=1),
                "last_action": last,
                "uav": np.eye(m, dtype=np.float32),
                "allowed": played.allowed[step],
                "hidden": hidden,
            },
        )
        with torch.inference_mode():
            expected, states = network.step(
                torch.from_numpy(state[None]),
                None if before is None else torch.from_numpy(before[None]),
                states,
            )
        np.testing.assert_allclose(values, expected[0].numpy(), rtol=1e-4, atol=1e-5)
        masked = np.where(played.allowed[step], expected[0].numpy(), -np.inf)
        assert np.array_equal(action, masked.argmax(axis=1))
        before = played.actions[step].copy()
        last = np.eye(n_actions, dtype=np.float32)[before]


def test_without_the_extra_the_error_names_it(checkpoint, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxscript", None)
    with pytest.raises(ExtraNotInstalled, match=r"onnxscript.*pip install 'uav-allocator\[onnx\]'"):
        to_onnx(checkpoint)


def test_the_command_writes_the_model_of_a_file_or_of_a_policy_in_the_library(tmp_path, learned, paper_model):
    file, out = tmp_path / "policy.safetensors", tmp_path / "agent.onnx"
    file.write_bytes(learned)

    def export(policy, *more):
        arguments = ["export", policy, "--out", str(out), "--data-dir", str(tmp_path), *more]
        return CliRunner().invoke(application, arguments)

    done = export(str(file))
    assert done.exit_code == 0, done.output
    assert start(out.read_bytes()).get_modelmeta().custom_metadata_map["sha256"] in done.output
    assert out.read_bytes() == paper_model

    missing = export("nobody")
    assert missing.exit_code == 1
    assert "nobody" in missing.output
    shipped = shipped_policies()[0]
    done = export(shipped.id, "--format", "checkpoint")
    assert done.exit_code == 0, done.output
    assert out.read_bytes() == shipped.checkpoint
    out.unlink()
    file.write_bytes(b"no checkpoint at all")
    assert export(str(file)).exit_code == 1
    assert not out.exists()
