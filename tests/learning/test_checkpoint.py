import json

import numpy as np
import pytest
import torch
from safetensors.torch import load, save

from app.domain.errors import InvalidCheckpoint
from app.domain.records import problem_from_record
from app.domain.said import to_record
from app.learning.checkpoints.checkpoint import decode, encode, verify
from app.learning.paper.architecture import QmixConfig
from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.episode import Actor
from app.learning.paper.learner import Learner
from app.learning.paper.networks import QmixNetwork
from app.learning.parameters import QmixParameters
from app.library.entries import new_policy
from app.simulation.generator import generate


@pytest.fixture
def config(problem) -> QmixConfig:
    return QmixConfig(problem.n_uavs, problem.n_targets, problem.n_materials, 16, 8)


@pytest.fixture
def write(problem, config):
    def write(network: QmixNetwork) -> bytes:
        return encode(
            network,
            config=config,
            task=problem,
            algorithm="qmix",
            seed=3,
            parameters=QmixParameters(drqn_hidden_dim=16, qmix_hidden_dim=8),
            metrics={"reward": 1.5, "epochs": 10},
        )

    return write


@pytest.fixture
def data(write, network) -> bytes:
    return write(network)


def metadata_of(data):
    length = int.from_bytes(data[:8], "little")
    return json.loads(json.loads(data[8 : 8 + length])["__metadata__"]["checkpoint"])


def rewritten(data, *, tensors=None, **fields):
    """The same file with other tensors or metadata; a field set to None is left out."""
    metadata = {key: value for key, value in {**metadata_of(data), **fields}.items() if value is not None}
    return save(load(data) if tensors is None else tensors, {"checkpoint": json.dumps(metadata)})


def test_what_is_read_is_what_was_written_and_bytes_repeat(data, write, network, config, problem):
    checkpoint = decode(data)
    assert checkpoint.config == config
    stored, original = checkpoint.network.state_dict(), network.state_dict()
    assert stored.keys() == original.keys()
    assert all(torch.equal(stored[name], original[name]) for name in original)
    assert problem_from_record(checkpoint.metadata["task"]) == problem
    assert checkpoint.metadata["parameters"]["n_epochs"] == 50_000
    assert (checkpoint.metadata["seed"], checkpoint.metadata["metrics"]["reward"]) == (3, 1.5)
    assert write(checkpoint.network) == data


def test_library_takes_it_in(data, problem):
    policy = new_policy("a name", problem, data)
    assert (policy.architecture, policy.algorithm, policy.seed) == ("qmix-paper-1", "qmix", 3)
    assert policy.metadata["config"] == metadata_of(data)["config"]


def test_loaded_networks_act_the_same_and_go_on_learning_the_same(data, network, problem, batch, learner):
    loaded = decode(data).network
    first = Actor(SwarmEnvironment(problem), network).play_greedily()
    second = Actor(SwarmEnvironment(problem), loaded).play_greedily()
    assert np.array_equal(first.actions[: first.length], second.actions[: second.length])
    other = Learner(loaded, lr=5e-4, gamma=0.9, grad_norm_clip=10.0)
    for _ in range(3):
        learner.update(batch)
        other.update(batch)
    for one, two in zip(network.parameters(), loaded.parameters(), strict=True):
        assert torch.equal(one, two)
        assert one.isfinite().all()


def test_good_checkpoint_is_verified(data, problem):
    verify(data, problem)


def test_task_of_another_size_is_refused(data):
    with pytest.raises(InvalidCheckpoint, match="3 UAVs, 5 targets and 2 materials, the task has 3, 6 and 2"):
        verify(data, generate("uniform", 3, 6, 2, np.random.default_rng(0)))


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"format": 2}, "format is 2"),
        ({"format": True}, "format is True"),
        ({"architecture": "other"}, "architecture is 'other'"),
        ({"features": None}, "features is None"),
        ({"config": None}, "exactly the fields"),
        ({"config": [1, 2]}, "exactly the fields"),
        ({"config": {"n_uavs": 3}}, "exactly the fields"),
    ],
)
def test_metadata_must_be_what_this_version_writes(data, problem, fields, reason):
    with pytest.raises(InvalidCheckpoint, match=reason) as refused:
        verify(rewritten(data, **fields), problem)
    assert "sentence" in to_record(refused.value.detail)


@pytest.mark.parametrize("value", [0, -1, 1.0, "3", True, 10**9, None])
def test_sizes_must_be_sensible_integers(data, problem, value):
    config = {**metadata_of(data)["config"], "drqn_hidden_dim": value}
    with pytest.raises(InvalidCheckpoint, match="drqn_hidden_dim"):
        verify(rewritten(data, config=config), problem)


def change(name, function):
    def apply(tensors):
        tensors[name] = function(tensors[name]).contiguous()

    return apply


def fill(*names):
    def apply(tensors):
        for name in names:
            tensors[name][:] = 1e38

    return apply


def spoil(value):
    def apply(tensor):
        tensor = tensor.clone()
        tensor.view(-1)[0] = value
        return tensor

    return apply


@pytest.mark.parametrize(
    ("mutate", "reason"),
    [
        (lambda tensors: tensors.pop("agent.fc2.bias"), "'agent.fc2.bias' is missing"),
        (lambda tensors: tensors.update(extra=torch.zeros(1)), "'extra' is not part"),
        (change("agent.fc1.weight", lambda t: t[:, 1:]), r"'agent.fc1.weight' is F32"),
        (change("mixer.value.weight", lambda t: t.double()), "F64"),
        (change("mixer.value.weight", lambda t: t.half()), "F16"),
        (change("agent.rnn.bias_hh", spoil(torch.nan)), "'agent.rnn.bias_hh' has 1 numbers not finite"),
        (change("agent.rnn.bias_hh", spoil(torch.inf)), "not finite"),
        (fill("agent.fc2.bias", "mixer.hypernetwork.bias"), "values of the task that are not finite"),
    ],
)
def test_tensors_must_be_exactly_those_of_the_architecture(data, problem, mutate, reason):
    tensors = load(data)
    mutate(tensors)
    with pytest.raises(InvalidCheckpoint, match=reason):
        verify(rewritten(data, tensors=tensors), problem)


@pytest.mark.parametrize(
    "broken",
    [
        b"",
        b"not a checkpoint at all",
        save({"a": torch.zeros(1)}),
        save({"a": torch.zeros(1)}, {"checkpoint": "{"}),
        save({"a": torch.zeros(1)}, {"checkpoint": "[" * 5000}),
        save({"a": torch.zeros(1)}, {"checkpoint": "[]"}),
    ],
)
def test_other_bytes_are_refused(broken, problem):
    with pytest.raises(InvalidCheckpoint) as refused:
        verify(broken, problem)
    assert "sentence" in to_record(refused.value.detail)


def test_every_truncation_is_refused(data, problem):
    for length in range(0, len(data), 997):
        with pytest.raises(InvalidCheckpoint):
            verify(data[:length], problem)
