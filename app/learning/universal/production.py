"""Making a policy for every size from nothing: demonstrations, training, metrics, the file for the library.

Every stage leaves files behind and goes on where it stopped. On two cores the defaults take about an hour.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import numpy as np
import torch
from pydantic import Field

from app.learning.checkpoint import encode
from app.learning.universal.architecture import UniversalConfig
from app.learning.universal.curriculum import Shard
from app.learning.universal.demonstrations import demonstrate, write_shard
from app.learning.universal.policy import UniversalPolicy
from app.learning.universal.rollout import play
from app.learning.universal.trainer import Schedule, fit, initial
from app.simulation.generator import FAMILIES, generate
from app.solvers.protocol import Parameters

Tell = Callable[[str, float, str], None]
"""Takes a stage, the share of it that is done, and a word about it."""

METRIC_SHAPE = (10, 20, 3)
"""M, N and K of the fresh problems on which a policy is measured, and of the task it is filed under."""

METRIC_MOVES = 400_000
"""Moves of the search whose plans the policy's are compared with."""

_FRESH = 1_000_003
"""Keeps the streams of the metrics' problems apart from those of the demonstrations."""


class UniversalTrainingParameters(Parameters):
    """What a training of a policy for every size is made with."""

    shards: int = Field(default=400, ge=1, description="Files of demonstrations, up to 64 problems each")
    updates: int = Field(default=6000, ge=1, description="Steps of the optimiser")
    lr: float = Field(default=2e-3, gt=0, description="Highest learning rate of Adam")
    td_weight: float = Field(default=0.2, ge=0, description="Weight of the TD loss beside the cross-entropy")
    width: int = Field(default=64, ge=4, multiple_of=4, description="Width of a token")
    layers: int = Field(default=2, ge=1, description="Attention layers")
    qmix_hidden_dim: int = Field(default=32, ge=1, description="Hidden units of the mixing network")
    metric_problems: int = Field(default=16, ge=1, description="Fresh problems a family to measure it on")
    seed: int = Field(default=123, ge=0, description="Source of all randomness")

    @property
    def config(self) -> UniversalConfig:
        """Sizes of the networks."""
        return UniversalConfig(self.width, self.layers, self.qmix_hidden_dim)

    @property
    def schedule(self) -> Schedule:
        """How the networks are fitted."""
        return Schedule(self.updates, self.lr, self.td_weight, self.seed)


def train_universal(
    file: Path, work: Path, parameters: UniversalTrainingParameters, workers: int, tell: Tell
) -> None:
    """Train a policy for every size and write it as a checkpoint.

    Parameters
    ----------
    file
        The checkpoint; its stem becomes the policy's id.
    work
        Folder of what the stages leave behind: demonstrations, and the state of the training.
    parameters
        What to train.
    workers
        Processes that make demonstrations, then threads that train.
    tell
        Told about progress.
    """
    work.mkdir(parents=True, exist_ok=True)
    shards = _demonstrations(work, parameters, workers, tell)
    state = work / "training.safetensors"
    before = torch.get_num_threads()
    torch.set_num_threads(workers)
    try:
        agent, mixer = initial(parameters.config, parameters.seed)
        fit(
            agent,
            mixer,
            shards,
            parameters.schedule,
            state,
            lambda update, losses: tell("training", update / parameters.updates, _words(losses)),
        )
    finally:
        torch.set_num_threads(before)
    write_policy(file, UniversalPolicy.of_training(state, parameters.config), parameters, tell)


def write_policy(
    file: Path, policy: UniversalPolicy, parameters: UniversalTrainingParameters, tell: Tell
) -> None:
    """Measure a trained policy on fresh problems of every family and write its checkpoint.

    Parameters
    ----------
    file
        The checkpoint, with everything in it that the library needs.
    policy, parameters
        What was trained, and how.
    tell
        Told about progress.
    """
    metrics: dict[str, float | int] = {"updates": parameters.updates}
    for number, family in enumerate(FAMILIES):
        metrics[f"greedy_ratio_{family}"] = round(greedy_ratio(policy, family, parameters.metric_problems), 4)
        tell("metrics", (number + 1) / len(FAMILIES), family)
    data = encode(
        policy,
        config=policy.config,
        task=generate("uniform", *METRIC_SHAPE, np.random.default_rng([parameters.seed, _FRESH])),
        algorithm="qmix",
        seed=parameters.seed,
        parameters=parameters,
        metrics=metrics,
        name="every family, every size",
        families=list(FAMILIES),
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_suffix(".part")
    partial.write_bytes(data)
    os.replace(partial, file)


def greedy_ratio(policy: UniversalPolicy, family: str, count: int) -> float:
    """Mean share of a searched plan's reward that greedy roll-outs earn on fresh problems of a family."""
    rng = np.random.default_rng([_FRESH, *family.encode()])
    problems = [generate(family, *METRIC_SHAPE, rng) for _ in range(count)]
    m, n, _ = METRIC_SHAPE
    shown = demonstrate(Shard(m, n, problems, METRIC_MOVES), rng)
    played = play(policy.agent, shown.arrays, np.arange(len(shown.rewards)))
    return float(np.mean(played.rewards / shown.rewards))


def _demonstrations(
    work: Path, parameters: UniversalTrainingParameters, workers: int, tell: Tell
) -> list[Path]:
    found: dict[int, Path] = {}
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = {
            pool.submit(write_shard, work, parameters.seed, number): number
            for number in range(parameters.shards)
        }
        for future in as_completed(futures):
            found[futures[future]] = future.result()
            tell("demonstrations", len(found) / parameters.shards, "")
    return [found[number] for number in range(parameters.shards)]


def _words(losses: dict[str, float]) -> str:
    return ", ".join(f"{name} {loss:.4f}" for name, loss in losses.items())
