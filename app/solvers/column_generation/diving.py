"""Diving: the relaxation's favourite routes are fixed one by one, and new ones asked for in between."""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import Floats, Integers
from app.solvers.column_generation.packing import Packing, Relaxation
from app.solvers.column_generation.pricing import Pricing
from app.solvers.protocol import StopCriterion

_CERTAIN = 0.9
"""Share from which on a route is fixed, if there are such; otherwise the one of the largest."""

_USED = 1e-6
"""Share that is none."""


def dive(
    packing: Packing,
    pricing: Pricing,
    relaxed: Relaxation,
    best: float,
    ended: StopCriterion,
    rng: np.random.Generator | None = None,
) -> Integers | None:
    """Round a relaxation to a choice of routes.

    Parameters
    ----------
    packing, pricing
        Of one pool, which gets more routes.
    relaxed
        The relaxation where no route is fixed.
    best
        What the choice has to exceed.
    ended
        Asked every few milliseconds; when true, there is no choice.
    rng
        Draws the routes to fix by their shares; None: it is always the largest.

    Returns
    -------
    Integers or None
        (S, M) joint actions, legal but for visits that unload nothing.
    """
    try:
        while relaxed.reward >= packing.better_than(best):
            unfixed = relaxed.share.copy()
            unfixed[packing.fixed] = 0.0
            used = np.flatnonzero(unfixed > _USED)
            if (unfixed[used] > 1.0 - _USED).all():
                return packing.actions(np.array([*packing.fixed, *used.tolist()], np.int64))
            favourites = np.flatnonzero(unfixed >= _CERTAIN)
            if not len(favourites) or not packing.room_for(favourites):
                favourites = _favourite(unfixed, rng)
            packing.fix(favourites.tolist())
            following = pricing.close(packing, best, ended, thorough=False)
            if following is None or ended():
                return None
            relaxed = following
        return None
    finally:
        packing.loosen()


def _favourite(share: Floats, rng: np.random.Generator | None) -> Integers:
    """(1,) the route of the largest share, or one drawn, the larger its share the likelier."""
    if rng is None:
        return np.array([share.argmax()])
    weight = share * share
    return rng.choice(len(share), 1, p=weight / weight.sum())
