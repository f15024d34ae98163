"""The checkpoint codec: networks to bytes and back.

A checkpoint is a safetensors file whose metadata is one JSON text under the key ``checkpoint``. Nothing in it
depends on the clock or the machine, so the same training gives the same bytes. Reading trusts nothing: the
container is checked, then format, architecture and sizes, then every tensor's name, shape, type and
finiteness, and only then a network is built.
"""

from __future__ import annotations

import json
import logging
import reprlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from safetensors.torch import load, save
from torch import Tensor

import app
from app.domain.errors import InvalidCheckpoint, InvalidProblem
from app.domain.problem import Problem
from app.domain.records import problem_to_record
from app.domain.said import said
from app.learning.pairwise import architecture as pairwise
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.learner import joint_values, make_decisions
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.pairwise.states import all_turns
from app.learning.paper import architecture as paper
from app.learning.paper.architecture import QmixConfig
from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.episode import EpisodeRecord
from app.learning.paper.networks import QmixNetwork
from app.learning.universal.episodes.observation import nearness, scales
from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.episodes.turns import replay_turns
from app.learning.universal.network import architecture as universal
from app.learning.universal.network.architecture import UniversalConfig
from app.library.entries import unacceptable
from app.simulation.arrays import Integers, compile_problem
from app.solvers.greedy import greedy_plan
from app.solvers.protocol import Parameters
from policy_store.checkpoint import read_container, require_finite, require_tensors
from policy_store.errors import InvalidContainer
from policy_store.soundness import read_object

FORMAT = 1
"""Version of the metadata's fields."""

_METADATA_KEY = "checkpoint"

_CHECKED_UAVS, _CHECKED_TARGETS = 16, 32
"""How much of a task a policy for every size is tried on."""

_log = logging.getLogger(__name__)

Config = QmixConfig | UniversalConfig | PairwiseConfig
AnySizeNetwork = UniversalPolicy | PairwisePolicy
Network = QmixNetwork | AnySizeNetwork
ANY_SIZE = (UniversalPolicy, PairwisePolicy)
"""Networks for problems of every size."""


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

    config: Config
    metadata: Mapping[str, Any]
    network: Network


@dataclass(frozen=True, slots=True)
class Architecture:
    """What the codec must know of an architecture.

    Attributes
    ----------
    features
        Version of the network inputs.
    config
        Class of the sizes; its ``from_record`` bounds them.
    tensors
        Shape and type of every tensor, from the sizes.
    build
        Makes the networks, from the sizes.
    values
        Makes one forward pass on a task, from the networks and their sizes, and returns all values that come
        out.
    """

    features: str
    config: type[Config]
    tensors: Callable[[Any], Mapping[str, tuple[tuple[int, ...], str]]]
    build: Callable[[Any], Network]
    values: Callable[[Any, Any, Problem], Sequence[Tensor]]


def encode(
    network: Network,
    *,
    config: Config,
    task: Problem,
    algorithm: str,
    seed: int,
    parameters: Parameters,
    metrics: Mapping[str, float | int],
    **more: object,
) -> bytes | None:
    """Write networks and what made them.

    Parameters
    ----------
    network
        Of the sizes of `config`.
    config, task, algorithm, seed, parameters
        What was trained on what, and how.
    metrics
        What came of it: ``reward`` of the best plan, ``epochs``, and more.
    more
        What else the metadata says, JSON-ready: ``name``, ``families`` it was trained on.

    Returns
    -------
    bytes
        The file; None where the training has diverged, and weights are not finite any more.
    """
    if not has_finite_weights(network):
        _log.warning("a training has diverged", extra={"algorithm": algorithm, "metrics": dict(metrics)})
        return None
    name = next(name for name, known in ARCHITECTURES.items() if isinstance(config, known.config))
    metadata = {
        **more,
        "format": FORMAT,
        "architecture": name,
        "features": ARCHITECTURES[name].features,
        "config": config.as_record(),
        "algorithm": algorithm,
        "task": problem_to_record(task),
        "seed": seed,
        "parameters": parameters.model_dump(mode="json"),
        "metrics": dict(metrics),
        "version": app.__version__,
    }
    return _pack({name: tensor.cpu() for name, tensor in network.state_dict().items()}, metadata)


def has_finite_weights(network: torch.nn.Module) -> bool:
    """Say whether every weight of a network is a finite number."""
    return all(bool(weights.isfinite().all()) for weights in network.state_dict().values())


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
        raise unacceptable(error) from error
    try:
        metadata = read_object(text or "")
    except ValueError as error:
        detail = said("its metadata {key!r} cannot be used: {why}", key=_METADATA_KEY, why=str(error))
        raise InvalidCheckpoint(detail) from None
    _require(metadata, "format", [FORMAT])
    _require(metadata, "architecture", list(ARCHITECTURES))
    _require(metadata, "features", [ARCHITECTURES[metadata["architecture"]].features])
    return metadata


def _require(metadata: Mapping[str, Any], field: str, known: Sequence[object]) -> None:
    value = metadata.get(field)
    if not any(type(value) is type(each) and value == each for each in known):
        raise InvalidCheckpoint(
            said(
                "its {field} is {value}, this version reads {known}",
                field=field,
                value=reprlib.repr(value),
                known=[repr(each) for each in known],
            )
        )


def decode(data: bytes) -> Checkpoint:
    """Read a checkpoint.

    Raises
    ------
    InvalidCheckpoint
        If anything in it is not exactly as its architecture needs it.
    """
    metadata = read_metadata(data)
    known = ARCHITECTURES[metadata["architecture"]]
    try:
        config = known.config.from_record(metadata.get("config"))
        container = read_container(data)
        require_tensors(container, known.tensors(config))
        require_finite(data, container)
    except InvalidContainer as error:
        raise unacceptable(error) from error
    except ValueError as error:
        # `str` of it has the text without its sentence.
        raise InvalidCheckpoint(error.args[0]) from error
    network = known.build(config)
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
    known = ARCHITECTURES[checkpoint.metadata["architecture"]]
    values = known.values(checkpoint.network, checkpoint.config, problem)
    if not all(each.isfinite().all() for each in values):
        raise InvalidCheckpoint(said("its networks give values of the task that are not finite"))


def _build_paper(config: QmixConfig) -> QmixNetwork:
    return QmixNetwork(config.sizes, config.drqn_hidden_dim, config.qmix_hidden_dim)


def _paper_values(network: QmixNetwork, config: QmixConfig, problem: Problem) -> Sequence[Tensor]:
    """Q values and Q_tot of the first step."""
    sizes = (problem.n_uavs, problem.n_targets, problem.n_materials)
    if (config.n_uavs, config.n_targets, config.n_materials) != sizes:
        raise InvalidCheckpoint(
            said(
                "its networks are for {uavs} UAVs, {targets} targets and {materials} materials, the task has "
                "{task_uavs}, {task_targets} and {task_materials}",
                uavs=config.n_uavs,
                targets=config.n_targets,
                materials=config.n_materials,
                task_uavs=sizes[0],
                task_targets=sizes[1],
                task_materials=sizes[2],
            )
        )
    try:
        environment = SwarmEnvironment(problem)
    except InvalidProblem as error:
        first = error.violations[0]
        detail = said(
            "its networks do not observe the task: {pointer}: {why}", pointer=first.pointer, why=first.detail
        )
        raise InvalidCheckpoint(detail) from error
    record = EpisodeRecord(environment.sizes, 1)
    environment.observe(record.states[0], record.allowed[0])
    with torch.inference_mode():
        states = torch.from_numpy(record.states)  # (1, D)
        values, _ = network.step(states, None, None)
        return values, network.mix(values.amax(dim=-1), states)


def _checked_part(problem: Problem) -> Problem:
    """Leave a part of a task that is quickly tried; every size fits a policy for every size."""
    # Without what refers to the rest.
    return replace(
        problem,
        uavs=tuple(
            replace(uav, committed=(), excluded=(), bases=None) for uav in problem.uavs[:_CHECKED_UAVS]
        ),
        targets=problem.targets[:_CHECKED_TARGETS],
        bases=(),
        start_plan=None,
        objective=replace(problem.objective, change_weight=0.0),
    )


def _greedy_actions(part: Problem) -> Integers:
    """Return the greedy rule's plan, (S, M)."""
    plan = np.full((part.max_steps, part.n_uavs), part.n_targets, np.int64)
    rows = greedy_plan(part).as_array()
    plan[: len(rows)] = rows
    return plan


@torch.inference_mode()
def _universal_values(policy: UniversalPolicy, _: UniversalConfig, problem: Problem) -> Sequence[Tensor]:
    """Q values of the turns of the greedy rule's plan, each as if it was the UAV's first, and a joint one."""
    part = _checked_part(problem)
    arrays = compile_problem(part)
    turns = replay_turns(arrays, np.zeros(1, np.int64), _greedy_actions(part)[None])
    pair, own, rivals = (torch.from_numpy(each) for each in (turns.pair, turns.own, turns.rivals))
    distance = torch.from_numpy(nearness(arrays, scales(arrays)[0]))
    agent = policy.agent
    tokens = agent.encode(pair, own, rivals, agent.bias(distance).expand(len(pair), -1, -1, -1))
    hidden = agent.remember(tokens, tokens.new_zeros(len(tokens), tokens.shape[-1]))
    values = agent.values(tokens, hidden)
    present = torch.ones(1, len(values), dtype=torch.bool)
    return values, policy.mixer(values.amax(dim=1)[None], hidden[None], present)


@torch.inference_mode()
def _pairwise_values(policy: PairwisePolicy, _: PairwiseConfig, problem: Problem) -> Sequence[Tensor]:
    """Q values of the decisions of the greedy rule's plan, and Q_tot of its steps."""
    part = _checked_part(problem)
    turns = all_turns(compile_problem(part), _greedy_actions(part))
    decisions = make_decisions([turns], torch.device("cpu"))
    values, hidden = policy.agent(decisions.batch.sight)
    acting = (torch.arange(len(decisions.uav)), decisions.uav)
    chosen = values[acting].gather(1, decisions.batch.action[acting][:, None])[:, 0]
    return values, joint_values(decisions, chosen, hidden[acting], policy.mixer)[0]


ARCHITECTURES: Mapping[str, Architecture] = {
    paper.QMIX_PAPER_1: Architecture(
        paper.PAPER_FEATURES_1, QmixConfig, paper.expected_tensors, _build_paper, _paper_values
    ),
    universal.QMIX_UNIVERSAL_1: Architecture(
        universal.UNIVERSAL_FEATURES_1,
        UniversalConfig,
        universal.expected_tensors,
        UniversalPolicy,
        _universal_values,
    ),
    pairwise.QMIX_UNIVERSAL_2: Architecture(
        pairwise.UNIVERSAL_FEATURES_2,
        PairwiseConfig,
        pairwise.expected_tensors,
        PairwisePolicy,
        _pairwise_values,
    ),
}
"""The architectures by name."""
