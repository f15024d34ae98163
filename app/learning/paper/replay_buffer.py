"""The data storage unit D of Algorithm 1: whole episodes, the oldest overwritten first."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from app.learning.paper.architecture import NetworkSizes
from app.learning.paper.episode import EpisodeRecord


class Batch(NamedTuple):
    """B episodes side by side, time first; T is the length of the longest.

    Every episode ends in a terminal step, so what Algorithm 1 calls S_next is the next row of `states`.

    Attributes
    ----------
    states
        (T, B, D) float32 at the beginning of each step.
    allowed
        (T, B, M, A) bool, actions allowed at the beginning of each step.
    actions
        (T, B, M) int64.
    rewards
        (T, B) float32.
    terminated
        (T, B) bool, steps after which the episode was over.
    filled
        (T, B) bool, steps that were played; the others are padding.
    """

    states: Tensor
    allowed: Tensor
    actions: Tensor
    rewards: Tensor
    terminated: Tensor
    filled: Tensor


class ReplayBuffer:
    """Episodes in preallocated memory, padded to the longest there can be.

    Parameters
    ----------
    capacity
        Episodes it holds.
    sizes, max_steps
        Of the environment.
    """

    def __init__(self, capacity: int, sizes: NetworkSizes, max_steps: int) -> None:
        m, a, d = sizes.n_agents, sizes.n_actions, sizes.state_features
        self._episodes = Batch(
            states=torch.zeros(max_steps, capacity, d),
            allowed=torch.zeros(max_steps, capacity, m, a, dtype=torch.bool),
            actions=torch.zeros(max_steps, capacity, m, dtype=torch.int64),
            rewards=torch.zeros(max_steps, capacity),
            terminated=torch.zeros(max_steps, capacity, dtype=torch.bool),
            filled=torch.zeros(max_steps, capacity, dtype=torch.bool),
        )
        self._views = tuple(tensor.numpy() for tensor in self._episodes)
        self._lengths = np.zeros(capacity, np.int64)
        self._added = 0

    @staticmethod
    def bytes_needed(capacity: int, sizes: NetworkSizes, max_steps: int) -> int:
        """Return how much memory a buffer takes."""
        m, a, d = sizes.n_agents, sizes.n_actions, sizes.state_features
        return capacity * max_steps * (4 * d + m * a + 8 * m + 4 + 1 + 1)

    def __len__(self) -> int:
        """Return how many episodes it holds."""
        return min(self._added, len(self._lengths))

    def add(self, record: EpisodeRecord) -> None:
        """Store a copy of an episode that is over, of at least one step."""
        n = record.length
        slot = self._added % len(self._lengths)
        states, allowed, actions, rewards, terminated, filled = self._views
        states[:n, slot] = record.states[:n]
        allowed[:n, slot] = record.allowed[:n]
        actions[:n, slot] = record.actions[:n]
        rewards[:n, slot] = record.rewards[:n]
        # Padding must be readable without harm: an action that exists, and an allowed one to take the
        # maximum over.
        states[n:, slot] = 0.0
        allowed[n:, slot] = True
        actions[n:, slot] = 0
        rewards[n:, slot] = 0.0
        terminated[:, slot] = False
        terminated[n - 1, slot] = True
        filled[:n, slot] = True
        filled[n:, slot] = False
        self._lengths[slot] = n
        self._added += 1

    def sample(self, batch_size: int, rng: np.random.Generator) -> Batch:
        """Draw episodes without replacement; all of them where there are fewer.

        Parameters
        ----------
        batch_size
            B.
        rng
            Where the choice comes from.
        """
        chosen = rng.choice(len(self), size=min(batch_size, len(self)), replace=False)
        longest = int(self._lengths[chosen].max())
        index = torch.from_numpy(chosen)
        return Batch(*(tensor[:longest].index_select(1, index) for tensor in self._episodes))
