"""Training the universal policy: demonstrations and own episodes in turn, resumable at any update.

Which shard, which problems and which random numbers an update uses follows from the seed and the update's
number alone, so a training that was stopped goes on as if it had not been.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import cast

import numpy as np
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from app.learning.compute.device import learning_device
from app.learning.universal.episodes.rollout import play
from app.learning.universal.episodes.turn_order import draw_orders, reorder, reorder_plans
from app.learning.universal.episodes.turns import of_uavs, replay_turns
from app.learning.universal.network.agent import UniversalAgent
from app.learning.universal.network.mixer import UniversalMixer
from app.learning.universal.training.demonstrations import Demonstrations, read_shard
from app.learning.universal.updates.learner import Batch, Learner, make_batch
from app.learning.universal.updates.optimiser import muon
from app.simulation.arrays import Integers, ProblemArrays
from app.simulation.replay import replay
from app.simulation.visit import ALLOWED

TURN_TOKENS = 20_000
"""Tokens an update sees, about: turns times targets."""

MIN_SHARE = 0.4
"""Where a single episode is longer than ``TURN_TOKENS`` by more than this share allows, only some of its UAVs
are learned from, and without the TD loss, which needs all of them."""

OWN_EVERY = 16
"""Every so many updates the policy learns from its own episodes instead of demonstrations."""

TD_EVERY = 4
"""Every so many updates the TD loss is added; it needs the target networks' values, so it is not cheap."""

WARM_UP = 200
"""Updates over which the learning rate rises, at most a tenth of all."""

SAVE_EVERY = 200
"""Updates between two states on disk."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """How to train.

    Attributes
    ----------
    updates
        Steps of the optimiser.
    lr
        Highest learning rate; it rises over some updates and falls as a half cosine to the end.
    td_weight
        Weight of the loss of QMIX beside the cross-entropy.
    seed
        Source of all randomness.
    """

    updates: int
    lr: float = 1e-2
    td_weight: float = 0.2
    seed: int = 123

    def share_of_lr(self, update: int) -> float:
        """Return what part of the learning rate an update takes."""
        rising = min(WARM_UP, max(1, self.updates // 10))
        return min(1.0, (update + 1) / rising) * (0.5 + 0.5 * float(np.cos(np.pi * update / self.updates)))


Watch = Callable[[int, dict[str, float]], None]


def unwatched(_update: int, _losses: dict[str, float]) -> None:
    """Nobody is told."""


def fit(
    agent: UniversalAgent,
    mixer: UniversalMixer,
    shards: list[Path],
    schedule: Schedule,
    state: Path,
    watch: Watch,
) -> None:
    """Train in place.

    Parameters
    ----------
    agent, mixer
        As initialised; replaced by what `state` holds if that exists. They learn on a GPU where there is one,
        and are on the processor before and afterwards.
    shards
        Files of demonstrations.
    schedule
        How long and how.
    state
        File that is written every ``SAVE_EVERY`` updates and at the end, and resumed from.
    watch
        Told the number of updates done and running means of the losses.
    """
    device = learning_device()
    agent.to(device)
    mixer.to(device)
    learner = Learner(agent, mixer, lr=schedule.lr, td_weight=schedule.td_weight, optimisers=muon)
    done = _resume(learner, state) if state.exists() else 0
    means: dict[str, float] = {}
    with ThreadPoolExecutor(1) as ahead:
        following = ahead.submit(_demonstrated, shards, schedule.seed, done, device)
        for update in range(done, schedule.updates):
            arrays, batch, whole = following.result()
            demonstrated = not whole or update % OWN_EVERY != OWN_EVERY - 1
            following = ahead.submit(_demonstrated, shards, schedule.seed, update + 1, device)
            if not demonstrated:
                batch = _own(agent, arrays, np.random.default_rng([schedule.seed, update, 1]), device)
            losses = learner.update(
                batch,
                schedule.share_of_lr(update),
                imitate=demonstrated,
                bootstrap=whole and update % TD_EVERY == TD_EVERY - 1,
            )
            for name, loss in losses.items():
                means[name] = 0.98 * means.get(name, loss) + 0.02 * loss
            if (update + 1) % SAVE_EVERY == 0 or update + 1 == schedule.updates:
                _save(learner, update + 1, state)
            watch(update + 1, means)
    agent.cpu()
    mixer.cpu()


@lru_cache(maxsize=256)
def _read(path: Path) -> Demonstrations:
    return read_shard(path)


def _demonstrated(
    shards: list[Path], seed: int, update: int, device: torch.device
) -> tuple[ProblemArrays, Batch, bool]:
    """Some demonstrations of a shard, and whether all turns are there; of large episodes it is some UAVs'."""
    rng = np.random.default_rng([seed, update, 0])
    shown = _read(shards[rng.integers(len(shards))])
    m, n, _ = shown.arrays.shape
    count = min(len(shown.rewards), max(1, TURN_TOKENS // (2 * m * n)))
    chosen = rng.choice(len(shown.rewards), count, replace=False)
    arrays = ProblemArrays(**{name: column[chosen] for name, column in shown.arrays._asdict().items()})
    arrays, plans = _in_random_order(arrays, shown.plans[chosen], rng)
    turns = replay_turns(arrays, np.arange(count), plans)
    share = TURN_TOKENS / (len(turns.action) * n)
    whole = share > MIN_SHARE
    if not whole:
        turns = of_uavs(turns, rng.permutation(m)[: max(1, round(share * m))])
    return arrays, make_batch(arrays, turns, device), whole


def _in_random_order(
    arrays: ProblemArrays, plans: Integers, rng: np.random.Generator
) -> tuple[ProblemArrays, Integers]:
    """Let the UAVs act in random orders, but for plans that are only legal in the order they have.

    Two UAVs that are at one target in the same step unload in the order in which they act.
    """
    count, _, m = plans.shape
    orders = draw_orders(count, m, rng)
    legal = replay(reorder(arrays, orders), reorder_plans(plans, orders), np.arange(count)).rule == ALLOWED
    orders = np.where(legal[:, None], orders, np.arange(m))
    return reorder(arrays, orders), reorder_plans(plans, orders)


def _own(
    agent: UniversalAgent, arrays: ProblemArrays, rng: np.random.Generator, device: torch.device
) -> Batch:
    problems = np.arange(len(arrays.max_steps))
    played = play(agent, arrays, problems, rng)
    return make_batch(arrays, replay_turns(arrays, problems, played.plans), device)


def _optimisers(learner: Learner) -> list[torch.optim.Optimizer]:
    return cast(list[torch.optim.Optimizer], learner.optimisers)  # those of muon


def _save(learner: Learner, done: int, path: Path) -> None:
    tensors = {f"networks.{name}": tensor for name, tensor in learner.networks.state_dict().items()}
    for place, optimiser in enumerate(_optimisers(learner)):
        for number, slots in optimiser.state_dict()["state"].items():
            tensors |= {f"optimiser.{place}.{number}.{name}": tensor for name, tensor in slots.items()}
    partial = path.with_suffix(".part")
    save_file(tensors, partial, {"updates": str(done)})
    os.replace(partial, path)


def _resume(learner: Learner, path: Path) -> int:
    tensors = load_file(path)
    networks = {
        name.removeprefix("networks."): t for name, t in tensors.items() if name.startswith("networks.")
    }
    learner.networks.load_state_dict(networks, strict=True)
    for place, optimiser in enumerate(_optimisers(learner)):
        slots: dict[int, dict[str, torch.Tensor]] = {}
        for name, tensor in tensors.items():
            if name.startswith(f"optimiser.{place}."):
                number, slot = name.split(".")[2:]
                slots.setdefault(int(number), {})[slot] = tensor
        groups = optimiser.state_dict()["param_groups"]
        optimiser.load_state_dict({"state": slots, "param_groups": groups})
    with safe_open(path, framework="pt") as file:
        return int(file.metadata()["updates"])
