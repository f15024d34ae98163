"""Seeds of requests, and the streams of random numbers that come of them."""

from __future__ import annotations

import numpy as np

from app.domain.errors import InvalidParameters, Violation
from app.domain.said import said


def seed_sequence(seed: int, *purpose: int) -> np.random.SeedSequence:
    """Return what all randomness of a solver comes from.

    Parameters
    ----------
    seed
        Of the request, 0 or more.
    purpose
        Numbers that keep streams of the same seed apart, the last of them not 0. Algorithms have none; the
        search with planned unloading, which follows one, has 0 and 1.

    Raises
    ------
    InvalidParameters
        If the seed is negative.
    """
    if seed < 0:
        detail = said("a seed is 0 or more, not {seed}", seed=seed)
        raise InvalidParameters(detail, [Violation("/seed", detail)])
    return np.random.SeedSequence([seed, *purpose])
