"""The independent random streams that one seed gives a learner."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from app.solvers.seeds import seed_sequence


class RandomStreams(NamedTuple):
    """One generator a purpose, so that drawing more for one purpose changes nothing for another."""

    initialisation: torch.Generator
    exploration: np.random.Generator
    replay: np.random.Generator


def random_streams(seed: int) -> RandomStreams:
    """Spawn the streams.

    Parameters
    ----------
    seed
        0 or more.
    """
    initialisation, exploration, replay = seed_sequence(seed).spawn(3)
    generator = torch.Generator().manual_seed(int(initialisation.generate_state(1, np.uint64)[0]))
    return RandomStreams(generator, np.random.default_rng(exploration), np.random.default_rng(replay))
