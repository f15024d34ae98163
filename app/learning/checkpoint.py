"""The checkpoint codec: networks to bytes and back.

A checkpoint is a safetensors file whose metadata is one JSON text under the key ``checkpoint``. Nothing in it
depends on the clock or the machine, so the same training gives the same bytes. Reading trusts nothing: the
container is checked, then format, architecture and sizes, then every tensor's name, shape, type and
finiteness, and only then a network is built.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from safetensors.torch import load, save
from torch import Tensor

import app
from app.domain.errors import InvalidCheckpoint
from app.domain.problem import Problem
from app.domain.records import problem_to_record
from app.learning.architecture import PAPER_FEATURES_1, QMIX_PAPER_1, QmixConfig, expected_tensors
from app.learning.environment import SwarmEnvironment
from app.learning.episode import EpisodeRecord
from app.learning.networks import QmixNetwork
from app.solvers.protocol import Parameters
from policy_store.checkpoint import read_container, require_finite, require_tensors
from policy_store.errors import InvalidContainer

FORMAT = 1
"""Version of the metadata's fields."""

_METADATA_KEY = "checkpoint"


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A checkpoint that has been read and found good.

    Attributes
    ----------
    config
        Sizes of its networks.
    metadata
        Everything its metadata says.
    network
        The networks, with its weights.
    """

    config: QmixConfig
    metadata: Mapping[str, Any]
    network: QmixNetwork


def encode(
    network: QmixNetwork,
    *,
    config: QmixConfig,
    task: Problem,
    algorithm: str,
    seed: int,
    parameters: Parameters,
    metrics: Mapping[str, float | int],
) -> bytes:
    """Write networks and what made them.

    Parameters
    ----------
    network
        Of the sizes of `config`, its weights finite.
    config, task, algorithm, seed, parameters
        What was trained on what, and how.
    metrics
        What came of it: ``reward`` of the best plan, ``epochs``, and more.
    """
    metadata = {
        "format": FORMAT,
        "architecture": QMIX_PAPER_1,
        "features": PAPER_FEATURES_1,
        "config": config.as_record(),
        "algorithm": algorithm,
        "task": problem_to_record(task),
        "seed": seed,
        "parameters": parameters.model_dump(mode="json"),
        "metrics": dict(metrics),
        "version": app.__version__,
    }
    return _pack(dict(network.state_dict()), metadata)


def with_name(data: bytes, name: str) -> bytes:
    """Return a checkpoint of our own with a name for people in its metadata, as shipped ones have."""
    return _pack(load(data), {**read_metadata(data), "name": name})


def _pack(tensors: dict[str, Tensor], metadata: Mapping[str, Any]) -> bytes:
    text = json.dumps(metadata, sort_keys=True, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    return save(tensors, {_METADATA_KEY: text})


def read_metadata(data: bytes) -> dict[str, Any]:
    """Read what a checkpoint says about itself, without looking at its weights.

    Raises
    ------
    InvalidCheckpoint
        If it is no safetensors file with such metadata, or its format, architecture or feature version is
        another.
    """
    try:
        text = read_container(data).metadata.get(_METADATA_KEY)
    except InvalidContainer as error:
        raise InvalidCheckpoint(str(error)) from error
    try:
        metadata = None if text is None else json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InvalidCheckpoint(f"its metadata {_METADATA_KEY!r} is not JSON") from error
    if not isinstance(metadata, dict):
        raise InvalidCheckpoint(f"its metadata has no JSON object under {_METADATA_KEY!r}")
    for field, known in (
        ("format", FORMAT),
        ("architecture", QMIX_PAPER_1),
        ("features", PAPER_FEATURES_1),
    ):
        value = metadata.get(field)
        if type(value) is not type(known) or value != known:
            raise InvalidCheckpoint(f"its {field} is {value!r}, this version reads {known!r}")
    return metadata


def decode(data: bytes) -> Checkpoint:
    """Read a checkpoint.

    Raises
    ------
    InvalidCheckpoint
        If anything in it is not exactly as its architecture needs it.
    """
    metadata = read_metadata(data)
    try:
        config = QmixConfig.from_record(metadata.get("config"))
        container = read_container(data)
        require_tensors(container, expected_tensors(config))
        require_finite(data, container)
    except (ValueError, InvalidContainer) as error:
        raise InvalidCheckpoint(str(error)) from error
    network = QmixNetwork(config.sizes, config.drqn_hidden_dim, config.qmix_hidden_dim)
    network.load_state_dict(load(data), strict=True)
    return Checkpoint(config, metadata, network)


def verify(data: bytes, problem: Problem) -> None:
    """Check a checkpoint of a stranger against the task it is said to be of; one forward pass is made.

    Parameters
    ----------
    data
        The file.
    problem
        The source task.

    Raises
    ------
    InvalidCheckpoint
        If it cannot be read, has networks for another size, or values of the task that are not finite.
    """
    checkpoint = decode(data)
    config = checkpoint.config
    sizes = (problem.n_uavs, problem.n_targets, problem.n_materials)
    if (config.n_uavs, config.n_targets, config.n_materials) != sizes:
        raise InvalidCheckpoint(
            f"its networks are for {config.n_uavs} UAVs, {config.n_targets} targets and {config.n_materials} "
            f"materials, the task has {sizes[0]}, {sizes[1]} and {sizes[2]}"
        )
    environment = SwarmEnvironment(problem)
    record = EpisodeRecord(environment.sizes, 1)
    environment.observe(record.states[0], record.allowed[0])
    with torch.inference_mode():
        states = torch.from_numpy(record.states)  # (1, D)
        values, _ = checkpoint.network.step(states, None, None)
        total = checkpoint.network.mix(values.amax(dim=-1), states)
    if not (np.isfinite(values.numpy()).all() and np.isfinite(total.numpy()).all()):
        raise InvalidCheckpoint("its networks give values of the task that are not finite")
