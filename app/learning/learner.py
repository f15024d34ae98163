"""Lines 10 to 14 of Algorithm 1: the loss, the update, the target network."""

from __future__ import annotations

import copy
from typing import cast

import torch
from torch import Tensor, nn

from app.learning.networks import ValueNetwork
from app.learning.replay_buffer import Batch


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
        self._optimiser = torch.optim.RMSprop(self._parameters, lr=lr, foreach=True)

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

    def loss(self, batch: Batch) -> Tensor:
        """Eq. 4 with the square it lacks in print: mean squared TD error of the steps that were played."""
        network = cast(ValueNetwork, self.network)
        values = network.unroll(batch.states, batch.actions)  # (T, B, M, A)
        taken = values.gather(-1, batch.actions.unsqueeze(-1)).squeeze(-1)  # (T, B, M)
        total = network.mix(taken, batch.states)  # (T, B)
        error = (total - self.targets(batch)) * batch.filled
        return error.square().sum() / batch.filled.sum()

    def update(self, batch: Batch) -> None:
        """Take one step down the loss.

        A gradient that is not finite, which only rewards beyond the range of float32 make, changes nothing.
        """
        self._optimiser.zero_grad()
        self.loss(batch).backward()  # type: ignore[no-untyped-call]
        norm = nn.utils.clip_grad_norm_(self._parameters, self._grad_norm_clip, foreach=True)
        if torch.isfinite(norm):
            self._optimiser.step()
        self.updates += 1

    def update_target(self) -> None:
        """Copy the network's parameters to the target network."""
        self.target.load_state_dict(self.network.state_dict())
