"""A policy for every size: the agent network and the mixing network that was trained with it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import nn

from app.learning.universal.episodes.played import Played
from app.learning.universal.episodes.rollout import play
from app.learning.universal.network.agent import UniversalAgent
from app.learning.universal.network.architecture import UniversalConfig
from app.learning.universal.network.mixer import UniversalMixer
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.solvers.protocol import StopCriterion, no_spare_threads
from app.solvers.stop import never


class UniversalPolicy(nn.Module):
    """Both networks of ``qmix-universal-1``; an
    :class:`~app.learning.universal.episodes.played.AnySizePolicy`.

    Parameters
    ----------
    config
        Their sizes.
    """

    takes_turns = True
    knows_reloads = False

    def __init__(self, config: UniversalConfig) -> None:
        super().__init__()
        self.config = config
        self.agent = UniversalAgent(config.width, config.layers)
        self.mixer = UniversalMixer(config.width, config.qmix_hidden_dim)

    @classmethod
    def of_seed(cls, config: UniversalConfig, seed: int) -> UniversalPolicy:
        """Make a policy with random weights that depend on the seed alone."""
        # Building it draws numbers too, from where everybody else does.
        with torch.random.fork_rng(devices=[]):
            policy = cls(config)
        policy.agent, policy.mixer = initial(config, seed)
        return policy

    def play(
        self,
        arrays: ProblemArrays,
        problem: Integers,
        rng: np.random.Generator | None = None,
        temperature: float = 1.0,
        stop: StopCriterion = never,
        spare: Callable[[], int] = no_spare_threads,
        epsilon: Floats | None = None,
    ) -> Played:
        """Play episodes; see :func:`~app.learning.universal.episodes.rollout.play`."""
        return play(self.agent, arrays, problem, rng, temperature, stop, spare, epsilon)


def initial(config: UniversalConfig, seed: int) -> tuple[UniversalAgent, UniversalMixer]:
    """Make networks with random weights that depend on the seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return UniversalAgent(config.width, config.layers), UniversalMixer(
            config.width, config.qmix_hidden_dim
        )
