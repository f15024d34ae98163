"""Fitting the policy for every size to demonstrations, resumable at any update.

Which demonstrations and which states of them an update uses follows from the seed and the update's number
alone, so a training that was stopped goes on as if it had not been.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from app.domain.problem import Problem
from app.learning.compute.device import learning_device
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.learner import Batch, Decisions, Learner, make_batch, make_decisions
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.pairwise.states import States, Turns, all_turns, some_states
from app.learning.universal.training.demonstrations import Demonstration
from app.learning.universal.updates.optimiser import muon
from app.simulation.arrays import Integers, compile_problem

BATCH_PAIRS = 20_000
"""Pairs of a UAV and an area that an update imitates in, about."""

TOKEN_PAIRS = 6
"""As many pairs cost what one UAV or area costs."""

PROBLEMS = 8
"""As many problems share a batch, at least, unless two states of each are more than fit in."""

DECISION_PAIRS = 14_000
"""Pairs in the whole episodes of an update with the TD loss, about."""

SMALL = 260
"""Pairs of a UAV and an area in problems whose whole episodes are learned from."""

TD_EVERY = 4
"""Every so many updates the TD loss is added; whole episodes are not cheap."""

UNLIKE = 0.2
"""How much like sizes are mixed: largest random addition to the difference of two sizes, in logarithms."""

WARM_UP = 200
"""Updates over which the learning rate rises, at most a tenth of all."""

SAVE_EVERY = 200
"""Updates between two states on disk."""

_STATE_PREFIXES = {"networks.0.0.": "agent.", "networks.0.1.": "mixer."}
"""Names of the policy's weights in a training's state, and in the policy."""


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
        Weight of the loss of QMIX beside the cross-entropy; no episodes are unfolded where it is 0.
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
    policy: PairwisePolicy,
    shown: Sequence[Demonstration],
    schedule: Schedule,
    state: Path,
    *,
    until: int | None = None,
    before: Path | None = None,
    watch: Watch = unwatched,
) -> None:
    """Train in place, all of a schedule or a part of it.

    Parameters
    ----------
    policy
        As initialised; replaced by what `state` holds if that exists, or else by what `before` does. It
        learns on a GPU where there is one, and is on the processor before and afterwards.
    shown
        What to learn from.
    schedule
        How long and how.
    state
        File that is written every ``SAVE_EVERY`` updates and at the end, and resumed from.
    until
        Number of the schedule's updates after which to end; all where None.
    before
        State of the part before, from which this one begins.
    watch
        Told the number of updates done and running means of the losses.
    """
    device, end = learning_device(), schedule.updates if until is None else until
    policy.to(device)
    learner = Learner(
        policy.agent, policy.mixer, lr=schedule.lr, td_weight=schedule.td_weight, optimisers=muon
    )
    begin = state if state.exists() else before
    done = 0 if begin is None else _resume(learner, begin)
    material = Material(shown, device)
    means: dict[str, float] = {}
    with ThreadPoolExecutor(1) as ahead:
        following = ahead.submit(material.of_update, schedule, done)
        for update in range(done, end):
            batch, decisions = following.result()
            following = ahead.submit(material.of_update, schedule, update + 1)
            losses = learner.update(schedule.share_of_lr(update), batch, decisions)
            for name, loss in losses.items():
                means[name] = 0.98 * means.get(name, loss) + 0.02 * loss
            if (update + 1) % SAVE_EVERY == 0 or update + 1 == end:
                _save(learner, update + 1, state)
            watch(update + 1, dict(means))
    policy.cpu()


def trained(state: Path, config: PairwiseConfig) -> PairwisePolicy:
    """Make a policy with the weights of a state that :func:`fit` wrote."""
    policy, tensors = PairwisePolicy.of_seed(config, 0), load_file(state)
    named = {
        new + name.removeprefix(old): tensor
        for old, new in _STATE_PREFIXES.items()
        for name, tensor in tensors.items()
        if name.startswith(old)
    }
    policy.load_state_dict(named, strict=True)
    return policy


def updates_done(state: Path) -> int:
    """Return after how many updates a state was written; 0 where there is none."""
    if not state.exists():
        return 0
    with safe_open(state, framework="pt") as file:
        return int(file.metadata()["updates"])


class Material:
    """Demonstrations as batches; those of a batch are of about one size, since all are padded to the largest.

    Parameters
    ----------
    shown
        The demonstrations, at least one.
    device
        Where tensors go.
    """

    def __init__(self, shown: Sequence[Demonstration], device: torch.device) -> None:
        self._shown, self._device = shown, device
        sizes = np.array([(p.n_uavs, p.n_targets, 1 + p.n_bases) for p in (each.problem for each in shown)])
        self._sizes = np.log(sizes)
        self._every = np.arange(len(shown))
        self._small = np.flatnonzero(sizes[:, :2].prod(axis=1) < SMALL)

    def of_update(self, schedule: Schedule, update: int) -> tuple[Batch, Decisions | None]:
        """Return what an update learns from: states, and every now and then whole episodes."""
        batch = self.batch(np.random.default_rng([schedule.seed, update, 0]))
        if not schedule.td_weight or update % TD_EVERY != TD_EVERY - 1:
            return batch, None
        return batch, self.decisions(np.random.default_rng([schedule.seed, update, 1]))

    def batch(self, rng: np.random.Generator) -> Batch:
        """Draw states of problems of about one size."""
        parts: list[States] = []
        # Of a few small problems all states that were drawn may be without a choice.
        while not parts:
            parts = list(self._states(rng))
        return make_batch(parts, self._device)

    def _states(self, rng: np.random.Generator) -> Iterator[States]:
        pairs = 0
        for each in self._alike(rng, self._every):
            one = _pairs(each.problem)
            count = max(2, BATCH_PAIRS // PROBLEMS // one)
            part = some_states(compile_problem(each.problem), each.plan, count, rng, each.first)
            if len(part.action):
                yield part
                pairs += one * len(part.action)
                if pairs >= BATCH_PAIRS:
                    return

    def decisions(self, rng: np.random.Generator) -> Decisions | None:
        """Unfold whole episodes of small problems of about one size; None where all problems are large."""
        parts: list[Turns] = []
        pairs = 0
        for each in self._alike(rng, self._small):
            part = all_turns(compile_problem(each.problem), each.plan)
            pairs += _pairs(each.problem) * len(part.step)
            if pairs > DECISION_PAIRS and parts:
                break
            if len(part.step):
                parts.append(part)
        return make_decisions(parts, self._device) if parts else None

    def _alike(self, rng: np.random.Generator, among: Integers) -> Iterator[Demonstration]:
        """Yield demonstrations among some, those first that are most like one that is drawn."""
        if not len(among):
            return
        apart = np.abs(self._sizes[among] - self._sizes[rng.choice(among)]).sum(axis=1)
        for k in among[np.argsort(apart + UNLIKE * rng.random(len(among)), kind="stable")]:
            yield self._shown[k]


def _pairs(problem: Problem) -> int:
    """Return what a state costs, in pairs of a UAV and an area."""
    m, places = problem.n_uavs, problem.n_targets + problem.n_bases
    return m * places + TOKEN_PAIRS * (m + places)


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
    return updates_done(path)
