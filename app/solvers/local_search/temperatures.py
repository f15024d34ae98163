"""By what temperatures of a search are measured: what visits of its plan earn, and what distances cost."""

from __future__ import annotations

import numpy as np

from app.simulation.arrays import ProblemArrays
from app.simulation.legs import UNREACHABLE
from app.solvers.local_search.neighbourhood import Neighbourhood
from app.solvers.local_search.routes import Routes
from app.solvers.scale import common_level, common_of, largest_level

_COLD_LEGS = 0.02
"""Temperature at which all that distances cost is decided on, in costs of legs between neighbours."""


def gains(arrays: ProblemArrays, routes: Routes) -> tuple[float, float]:
    """Return what a visit of the current plan earns at most, and what it commonly earns.

    Where loads are small beside needs, that is much less than a level. Without visits levels stand for it.
    """
    m = len(routes.length)
    flown = np.arange(len(routes.earned)) // m < np.tile(routes.length, len(routes.earned) // m)
    earned = routes.earned[flown & (routes.earned > 0.0)]
    if not len(earned):
        return largest_level(arrays), common_level(arrays)
    return float(earned.max()), common_of(earned)


def coldest_by_distance(arrays: ProblemArrays, leg: float, coldest: float) -> float:
    """Return a coldest temperature at which distances are decided on, too, unless that is far below.

    Where everything can be served, distances are all that there is to gain, however little beside a visit.
    """
    cost = _COLD_LEGS * float(arrays.terms["weight"][0]) * leg
    return min(coldest, cost) if cost > 0.0 else coldest


def neighbour_leg(arrays: ProblemArrays, near: Neighbourhood) -> float:
    """Return the mean distance between targets that are neighbours; 0 where there are none apart."""
    legs = arrays.between[0, 0][near.wanted[:, None], near.near_target[near.wanted, :3]]
    legs = legs[(legs < UNREACHABLE) & (legs > 0)]
    return float(legs.mean()) if legs.size else 0.0
