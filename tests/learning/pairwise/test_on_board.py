"""The answer to a state as an ONNX model: ONNX Runtime plays the episodes that the service plays."""

import hashlib
import json

import numpy as np
import pytest
import torch

from app.learning.checkpoints.checkpoint import encode
from app.learning.checkpoints.export import to_onnx
from app.learning.pairwise.architecture import QMIX_UNIVERSAL_2, UNIVERSAL_FEATURES_2, PairwiseConfig
from app.learning.pairwise.features import UavFeature
from app.learning.pairwise.gains import begin_step, look, look_again, look_at, nearness, new_gains
from app.learning.pairwise.observation import observe
from app.learning.pairwise.on_board import COLUMNS, PairwiseOnBoard
from app.learning.pairwise.reference import PAGE, with_tables
from app.learning.pairwise.rollout import play
from app.learning.pairwise.seen import new_seen
from app.learning.parameters import TransferQmixParameters
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate
from app.simulation.simulator import act, end_step, new_episodes
from app.simulation.world_generator import WORLD_FAMILIES

onnxruntime = pytest.importorskip("onnxruntime", reason="the extra onnx is not installed")

ONE = np.zeros(1, np.int64)


@pytest.fixture(scope="module")
def policy(make_policy):
    return make_policy(2, PairwiseConfig(width=8, layers=1, qmix_hidden_dim=4))


@pytest.fixture(scope="module")
def checkpoint(policy):
    task = generate("uniform", 3, 5, 2, np.random.default_rng(1))
    return encode(
        policy,
        config=policy.config,
        task=task,
        algorithm="transfer_qmix",
        seed=1,
        parameters=TransferQmixParameters(),
        metrics={"reward": 0.0, "epochs": 0},
    )


@pytest.fixture(scope="module")
def session(checkpoint):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    model = to_onnx(checkpoint)
    assert b"site-packages" not in model
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def problems():
    for m, n, k in ((1, 1, 1), (1, 4, 2), (7, 3, 1), (5, 9, 3)):
        yield generate("uniform", m, n, k, np.random.default_rng([m, n]))
    for kind in ("sorties", "stock", "promised"):
        for seed in range(2):
            yield WORLD_FAMILIES[kind](3, 5, 2, np.random.default_rng([seed, *kind.encode()]))


def fly(session, problem):
    """Play an episode as the computers on board do, by the page; yield what went in and came out."""
    arrays = compile_problem(problem)
    m, n, _ = arrays.shape
    episodes, gains, seen = new_episodes(arrays, 1), new_gains(arrays, 1), new_seen(1, arrays)
    look(arrays, episodes, gains)
    distances = nearness(arrays, gains.span)[0]
    plan = np.full((problem.max_steps, m), n)

    def takes(step, i, action):
        plan[step, i] = action
        act(arrays, episodes, 0, i, action)
        look_again(arrays, episodes, gains, 0, i, action)

    for step in range(problem.max_steps):
        if episodes.done[0]:
            break
        begin_step(episodes, gains, 0)
        while True:
            for i in np.flatnonzero(~gains.acted[0]):
                if not np.isfinite(gains.net[0, i]).any() and not gains.reloads[0, i].any():
                    takes(step, i, n)
            if gains.acted[0].all():
                break
            observe(arrays, episodes, gains, 0, seen, 0)
            inputs = (*(part[0].copy() for part in seen), distances)
            fed = dict(zip(PairwiseOnBoard.INPUTS, inputs, strict=True))
            given = dict(zip(PairwiseOnBoard.OUTPUTS, session.run(None, fed), strict=True))
            yield fed, given
            takes(step, int(given["uav"][0]), int(given["action"][0]))
        end_step(arrays, episodes, 0)
        for i in range(m):
            look_at(arrays, episodes, gains, 0, i)
    return plan


def collect(turns):
    """Run a generator to its end; what it yielded, and what it returned."""
    found = []
    while True:
        try:
            found.append(next(turns))
        except StopIteration as end:
            return found, end.value


def test_onnx_runtime_plays_the_same_episodes_as_the_service(session, policy):
    flown = reloads = 0
    for problem in problems():
        answers, plan = collect(fly(session, problem))
        played = play(policy.agent, compile_problem(problem), ONE).plans[0]
        assert np.array_equal(plan, played)
        flown += int((plan < problem.n_targets).sum())
        reloads += int((plan > problem.n_targets).sum())
        for fed, given in answers:
            with torch.inference_mode():
                expected = PairwiseOnBoard(policy.agent)(*map(torch.from_numpy, fed.values()))
            for name, tensor in zip(PairwiseOnBoard.OUTPUTS, expected, strict=True):
                np.testing.assert_allclose(given[name], tensor.numpy(), rtol=1e-4, atol=1e-5, err_msg=name)
    assert flown > 20
    assert reloads > 0


def test_the_surest_that_has_not_acted_returns_or_takes_the_most_likely_place(session):
    rng, returned, asked = np.random.default_rng(11), 0, 0
    for number in range(20):
        m, n, d = (int(rng.integers(low, 7)) for low in (1, 1, 0))
        shapes = ((m,), (n,), (d,), (m, n), (m, d))
        fed = {
            name: rng.normal(size=(*shape, len(kind))).astype(np.float32)
            for (name, kind), shape in zip(COLUMNS.items(), shapes, strict=True)
        }
        fed["distances"] = rng.random((n + d, n + d), np.float32)
        visits, reloads = rng.random((m, n)) < 0.4, rng.random((m, d)) < 0.4
        acted = rng.random(m) < 0.4
        acted[number % m] = False
        fed["visits"][..., 0], fed["reloads"][..., 0] = visits, reloads
        fed["uavs"][:, UavFeature.ACTED] = acted
        values, logits, sureness, uav, action = session.run(None, fed)
        assert np.isfinite(values).all()
        assert np.array_equal(np.isfinite(logits), np.hstack((visits, np.ones((m, 1), bool), reloads)))
        chances = np.exp(logits - logits.max(axis=1, keepdims=True))
        chances /= chances.sum(axis=1, keepdims=True)
        places = np.delete(chances, n, axis=1)
        returns = (chances[:, n] >= 0.75) | (places.sum(axis=1) == 0)
        likeliest = places.max(axis=1, initial=0.0)
        expected = np.where(acted, -np.inf, np.log(np.where(returns, chances[:, n], likeliest)))
        returned, asked = returned + (returns & ~acted).sum(), asked + (~acted).sum()
        np.testing.assert_allclose(sureness, expected, atol=1e-5)
        assert sureness[uav[0]] == sureness.max()
        assert chances[uav[0], action[0]] == (chances[:, n] if returns[uav[0]] else likeliest)[uav[0]]
        assert returns[uav[0]] == (action[0] == n)
    assert 0 < returned < asked, "one of the two ways was never taken"


def test_the_model_says_what_it_is_and_what_its_columns_are(session, checkpoint):
    said = session.get_modelmeta().custom_metadata_map
    columns = json.loads(said["columns"])
    shapes = {each.name: each.shape for each in session.get_inputs()}
    assert {name: shape[-1] for name, shape in shapes.items() if name in columns} == {
        name: len(listed) for name, listed in columns.items()
    }
    assert columns["uavs"][UavFeature.ACTED] == "acted"
    about = json.loads(said["checkpoint"])
    assert (about["architecture"], about["features"]) == (QMIX_UNIVERSAL_2, UNIVERSAL_FEATURES_2)
    assert said["sha256"] == hashlib.sha256(checkpoint).hexdigest()
    assert shapes["visits"][:2] == ["uavs", "areas"]


def test_the_page_has_every_feature_as_it_is_declared():
    page = PAGE.read_text(encoding="utf-8")
    assert page == with_tables(page)
    rows = {line for line in page.splitlines() if line.startswith("| ")}
    for kind in COLUMNS.values():
        for feature in kind:
            assert f"| {int(feature)} | `{feature.name.lower()}` | {feature.meaning} |" in rows
        assert len({feature.meaning for feature in kind}) == len(kind)
