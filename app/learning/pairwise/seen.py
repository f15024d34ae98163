"""What the policy sees of states, as arrays, and how numbers are bounded there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.learning.compute.kernels import Float32s
from app.learning.pairwise.features import (
    AreaFeature,
    BaseFeature,
    ReloadFeature,
    UavFeature,
    VisitFeature,
)
from app.simulation.arrays import ProblemArrays
from app.simulation.decorators import compiled

LONG = 4.0
"""Crossings of the span that a time is long at most; so much is left where there is no limit."""


class Seen(NamedTuple):
    """What the policy sees of T states of M UAVs, N areas and D bases.

    Attributes
    ----------
    uavs, areas, bases
        (T, M, U), (T, N, A) and (T, D, B), columns as :mod:`~app.learning.pairwise.features` names them.
    visits, reloads
        (T, M, N, V) and (T, M, D, R).
    """

    uavs: Float32s
    areas: Float32s
    bases: Float32s
    visits: Float32s
    reloads: Float32s


def new_seen(states: int, arrays: ProblemArrays) -> Seen:
    """Make memory for what is seen of some states."""
    m, n, _ = arrays.shape
    d = arrays.n_bases
    return Seen(
        np.zeros((states, m, len(UavFeature)), np.float32),
        np.zeros((states, n, len(AreaFeature)), np.float32),
        np.zeros((states, d, len(BaseFeature)), np.float32),
        np.zeros((states, m, n, len(VisitFeature)), np.float32),
        np.zeros((states, m, d, len(ReloadFeature)), np.float32),
    )


@compiled
def share(part: float, whole: float) -> float:
    """Return a part of a whole, at most 1; 0 of nothing."""
    return min(part / whole, 1.0) if whole > 0.0 else 0.0
