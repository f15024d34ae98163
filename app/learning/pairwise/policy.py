"""A policy of architecture ``qmix-universal-2``: the agent network and the mixing network trained with it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import nn

from app.learning.pairwise.agent import PairwiseAgent
from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.pairwise.rollout import play
from app.learning.universal.episodes.played import Played
from app.learning.universal.network.mixer import UniversalMixer
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.solvers.protocol import StopCriterion, no_spare_threads
from app.solvers.stop import never


class PairwisePolicy(nn.Module):
    """Both networks; an :class:`~app.learning.universal.episodes.played.AnySizePolicy`.

    Parameters
    ----------
    config
        Their sizes.
    """

    takes_turns = False
    knows_reloads = True

    def __init__(self, config: PairwiseConfig) -> None:
        super().__init__()
        self.config = config
        self.agent = PairwiseAgent(config)
        self.mixer = UniversalMixer(config.width, config.qmix_hidden_dim)

    @classmethod
    def of_seed(cls, config: PairwiseConfig, seed: int) -> PairwisePolicy:
        """Make a policy with random weights that depend on the seed alone."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return cls(config)

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
        """Play episodes; see :func:`~app.learning.pairwise.rollout.play`."""
        return play(self.agent, arrays, problem, rng, temperature, stop, spare, epsilon)
