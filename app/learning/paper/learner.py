"""Lines 10 to 14 of Algorithm 1: the loss, the update, the target network."""

from __future__ import annotations

import copy
import time
from collections.abc import Iterator
from typing import cast

import torch
from torch import Tensor, nn

from app.learning.compute.functional_optimisers import RMSprop
from app.learning.paper.networks import ValueNetwork
from app.learning.paper.replay_buffer import Batch
from app.solvers.protocol import StopCriterion
from app.solvers.stop import never

_WORK_A_PART = 1_000_000
"""Numbers that one part of an update goes through, in and out of the network, about."""

_WORK_AN_AGENT = 400
"""Of them the hidden ones of an agent in a step."""


class Learner:
    """Trains a network on batches of episodes, whatever game they are of.

    Parameters
    ----------
    network
        A :class:`ValueNetwork`; its parameters, all of them, are changed by every update.
    lr, gamma, grad_norm_clip
        Learning rate, discount, and largest norm of the gradient.

    Attributes
    ----------
    network, target
        The network, and the target network: a copy of it as it is now.
    updates
        Updates made.
    """

    def __init__(self, network: nn.Module, lr: float, gamma: float, grad_norm_clip: float) -> None:
        self.network = network
        self.target = copy.deepcopy(network).requires_grad_(False)
        self.updates = 0
        self._gamma = gamma
        self._grad_norm_clip = grad_norm_clip
        self._parameters = list(network.parameters())
        self._optimiser = RMSprop(self._parameters, lr)
        self._part_s = 0.0

    def targets(self, batch: Batch) -> Tensor:
        """Eq. 5: the reward, and after steps that do not end the episode the discounted value of the next.

        The maximum of each agent is over the actions allowed at the beginning of the next step.

        Returns
        -------
        Tensor
            (T, B).
        """
        rewards = batch.rewards
        if len(rewards) == 1:
            return rewards
        network = cast(ValueNetwork, self.target)
        with torch.no_grad():
            values = network.unroll(batch.states, batch.actions)[1:]  # (T-1, B, M, A)
            best = values.masked_fill(~batch.allowed[1:], -torch.inf).amax(dim=-1)  # (T-1, B, M)
            total = network.mix(best, batch.states[1:])  # (T-1, B)
            # The last of T steps ends its episode or is padding: nothing follows it.
            goes_on = batch.filled[:-1] & ~batch.terminated[:-1]
            targets = rewards.clone()
            targets[:-1] += self._gamma * torch.where(goes_on, total, 0.0)
        return targets

    def loss(self, batch: Batch, played: Tensor | None = None) -> Tensor:
        """Eq. 4 with the square it lacks in print: mean squared TD error of the steps that were played.

        Parameters
        ----------
        batch
            The episodes.
        played
            How many steps of the whole batch were played, where these are only some of its episodes.
        """
        network = cast(ValueNetwork, self.network)
        values = network.unroll(batch.states, batch.actions)  # (T, B, M, A)
        taken = values.gather(-1, batch.actions.unsqueeze(-1)).squeeze(-1)  # (T, B, M)
        total = network.mix(taken, batch.states)  # (T, B)
        error = (total - self.targets(batch)) * batch.filled
        return error.square().sum() / (batch.filled.sum() if played is None else played)

    def update(self, batch: Batch, stop: StopCriterion = never) -> bool:
        """Take one step down the loss.

        A gradient that is not finite, which only rewards beyond the range of float32 make, changes nothing.

        Parameters
        ----------
        batch
            Large ones are worked off some episodes at a time, whose gradients add up to the batch's.
        stop
            Asked before each and within it; none is begun that would take longer than it leaves.

        Returns
        -------
        bool
            False if it was stopped: then nothing has changed.
        """
        self.network.zero_grad()
        played = batch.filled.sum()
        begun = 0.0
        for part in _parts(batch):
            if stop() or stop.seconds_left() < self._part_s:
                return False
            begun = time.monotonic()
            loss = self.loss(part, played)
            if stop():
                return False
            loss.backward()  # type: ignore[no-untyped-call]  # untyped in torch
            self._part_s = time.monotonic() - begun
        norm = nn.utils.clip_grad_norm_(self._parameters, self._grad_norm_clip, foreach=True)
        if torch.isfinite(norm):
            self._optimiser.step()
        self._part_s = time.monotonic() - begun
        self.updates += 1
        return True

    def update_target(self) -> None:
        """Copy the network's parameters to the target network."""
        self.target.load_state_dict(self.network.state_dict())


def _parts(batch: Batch) -> Iterator[Batch]:
    """Cut a batch into episodes that take some hundredths of a second; most batches are one part."""
    steps, episodes, agents, actions = batch.allowed.shape
    each = steps * (agents * (actions + _WORK_AN_AGENT) + batch.states.shape[2])
    size = max(1, _WORK_A_PART // each)
    for first in range(0, episodes, size):
        yield Batch(*(tensor[:, first : first + size] for tensor in batch))
