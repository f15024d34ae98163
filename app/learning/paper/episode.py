"""Playing episodes: a network's roll-outs, recorded as the replay buffer stores them."""

from __future__ import annotations

import numpy as np
import torch

from app.learning.paper.architecture import NetworkSizes
from app.learning.paper.environment import Environment
from app.learning.paper.exploration import EpsilonSchedule
from app.learning.paper.networks import ValueNetwork
from app.solvers.protocol import StopCriterion
from app.solvers.stop import never


class EpisodeRecord:
    """One episode; rows from `length` on are of earlier episodes and mean nothing.

    Parameters
    ----------
    sizes, max_steps
        Of the environment.

    Attributes
    ----------
    states
        (S, D) at the beginning of each step.
    allowed
        (S, M, A) masks at the beginning of each step.
    actions
        (S, M).
    rewards
        (S,).
    length
        Steps played.
    """

    def __init__(self, sizes: NetworkSizes, max_steps: int) -> None:
        self.states = np.zeros((max_steps, sizes.state_features), np.float32)
        self.allowed = np.zeros((max_steps, sizes.n_agents, sizes.n_actions), np.bool_)
        self.actions = np.zeros((max_steps, sizes.n_agents), np.int64)
        self.rewards = np.zeros(max_steps)
        self.length = 0

    @property
    def reward(self) -> float:
        """What the episode earned."""
        return float(self.rewards[: self.length].sum())


class Actor:
    """Plays episodes of one environment by one network's values.

    Parameters
    ----------
    environment
        Played by nobody else.
    network
        Asked at every step; its weights may change between episodes.
    """

    def __init__(self, environment: Environment, network: ValueNetwork) -> None:
        self.environment = environment
        self._network = network
        self._record = EpisodeRecord(environment.sizes, environment.max_steps)
        # The record's own memory as tensors: what the environment writes is what the network reads.
        self._states = torch.from_numpy(self._record.states)
        self._actions = torch.from_numpy(self._record.actions)
        self._no_draws = np.ones((environment.max_steps, environment.sizes.n_agents, 2))

    def play_greedily(self, stop: StopCriterion = never) -> EpisodeRecord | None:
        """Play an episode without exploration and without drawing a random number.

        Parameters
        ----------
        stop
            Asked before every step but the first.

        Returns
        -------
        EpisodeRecord
            Overwritten by this actor's next episode; None if it was stopped.
        """
        return self._play(self._no_draws, EpsilonSchedule(0.0, 0.0, 1), 0, stop)

    def play(
        self, schedule: EpsilonSchedule, steps: int, rng: np.random.Generator, stop: StopCriterion = never
    ) -> EpisodeRecord | None:
        """Play an episode with exploration.

        Parameters
        ----------
        schedule
            Probability of a random action.
        steps
            Environment steps taken in all episodes before.
        rng
            Drawn from equally often by every episode.
        stop
            Asked before every step but the first.

        Returns
        -------
        EpisodeRecord
            Overwritten by this actor's next episode; None if it was stopped.
        """
        return self._play(rng.random(self._no_draws.shape), schedule, steps, stop)

    @torch.inference_mode()
    def _play(
        self,
        draws: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
        schedule: EpsilonSchedule,
        steps: int,
        stop: StopCriterion,
    ) -> EpisodeRecord | None:
        record, environment = self._record, self.environment
        environment.reset()
        hidden, last_actions, t = None, None, 0
        while not environment.done:
            if t and stop():
                return None
            environment.observe(record.states[t], record.allowed[t])
            values, hidden = self._network.step(self._states[t : t + 1], last_actions, hidden)
            record.rewards[t] = environment.step(
                values[0].numpy(), draws[t], schedule(steps + t), record.actions[t]
            )
            last_actions = self._actions[t : t + 1]
            t += 1
        record.length = t
        return record
