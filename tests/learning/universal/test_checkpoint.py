"""Checkpoints of policies for every size: the same strictness as those for one size."""

import json

import numpy as np
import pytest
import torch
from safetensors.torch import load, save

from app.domain.errors import InvalidCheckpoint
from app.domain.records import problem_from_record
from app.learning.checkpoints.checkpoint import decode, encode, verify
from app.learning.pairwise.architecture import PairwiseConfig, expected_tensors
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.parameters import QmixParameters
from app.library.entries import new_policy
from app.library.summary import SUMMARY_SPACE
from app.simulation.generator import FAMILIES, generate


@pytest.fixture
def task():
    return generate("uniform", 3, 5, 2, np.random.default_rng(7))


@pytest.fixture
def data(policy, task) -> bytes:
    return encode(
        policy,
        config=policy.config,
        task=task,
        algorithm="qmix",
        seed=3,
        parameters=QmixParameters(),
        metrics={"updates": 10},
        name="every size",
        families=["uniform", "scarce"],
    )


def metadata_of(data):
    length = int.from_bytes(data[:8], "little")
    return json.loads(json.loads(data[8 : 8 + length])["__metadata__"]["checkpoint"])


def rewritten(data, *, tensors=None, **fields):
    metadata = {**metadata_of(data), **fields}
    return save(load(data) if tensors is None else tensors, {"checkpoint": json.dumps(metadata)})


def test_what_is_read_is_what_was_written(data, policy, task):
    checkpoint = decode(data)
    assert checkpoint.config == policy.config
    stored, original = checkpoint.network.state_dict(), policy.state_dict()
    assert stored.keys() == original.keys()
    assert all(torch.equal(stored[name], original[name]) for name in original)
    assert problem_from_record(checkpoint.metadata["task"]) == task
    assert checkpoint.metadata["architecture"] == "qmix-universal-2"
    assert checkpoint.metadata["features"] == "universal-2"
    assert (checkpoint.metadata["name"], checkpoint.metadata["families"]) == (
        "every size",
        ["uniform", "scarce"],
    )


def test_library_takes_it_in(data, task):
    policy = new_policy("a name", task, data)
    assert policy.architecture == "qmix-universal-2"
    assert SUMMARY_SPACE in policy.vectors
    assert policy.metadata["families"] == ["uniform", "scarce"]


@pytest.mark.parametrize("config", [PairwiseConfig(), PairwiseConfig(12, 3, 5), PairwiseConfig(4, 1, 1)])
def test_every_expected_tensor_is_one_of_the_networks(config):
    tensors = PairwisePolicy(config).state_dict()
    assert {name: (tuple(t.shape), "F32") for name, t in tensors.items()} == expected_tensors(config)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("size", [(1, 1, 1), (3, 40, 2), (40, 3, 7)])
def test_it_fits_a_task_of_any_size(data, family, size):
    verify(data, generate(family, *size, np.random.default_rng(1)))


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"features": "paper-1"}, "features is 'paper-1'"),
        ({"architecture": "qmix-paper-1"}, "features is 'universal-2'"),
        ({"config": {"width": 8, "layers": 2}}, "exactly the fields"),
        ({"config": {"width": 6, "layers": 2, "qmix_hidden_dim": 4}}, "width is 6, not a multiple of 4"),
        ({"config": {"width": 8, "layers": 10**6, "qmix_hidden_dim": 4}}, "layers is 1000000"),
        ({"config": {"width": 2**40, "layers": 2, "qmix_hidden_dim": 4}}, "width"),
        ({"config": {"width": 8, "layers": 3, "qmix_hidden_dim": 4}}, "is missing"),
        ({"config": {"width": 12, "layers": 2, "qmix_hidden_dim": 4}}, "is F32"),
    ],
)
def test_metadata_must_be_what_this_version_writes(data, task, fields, reason):
    with pytest.raises(InvalidCheckpoint, match=reason):
        verify(rewritten(data, **fields), task)


def change(name, function):
    def apply(tensors):
        tensors[name] = function(tensors[name]).contiguous()

    return apply


def huge(tensor):
    return torch.full_like(tensor, 3e38)


@pytest.mark.parametrize(
    ("mutate", "reason"),
    [
        (lambda tensors: tensors.pop("agent.sharpness"), "'agent.sharpness' is missing"),
        (lambda tensors: tensors.update(extra=torch.zeros(1)), "'extra' is not part"),
        (change("agent.uav_in.bias", lambda t: t[1:]), "'agent.uav_in.bias' is F32"),
        (change("mixer.out_bias.2.weight", lambda t: t.double()), "F64"),
        (change("agent.score.bias", lambda t: t * torch.nan), "not finite"),
        (change("agent.visit_in.weight", huge), "values of the task that are not finite"),
        (change("mixer.agent_weight.weight", huge), "values of the task that are not finite"),
    ],
)
def test_tensors_must_be_exactly_those_of_the_architecture(data, task, mutate, reason):
    tensors = load(data)
    mutate(tensors)
    with pytest.raises(InvalidCheckpoint, match=reason):
        verify(rewritten(data, tensors=tensors), task)
