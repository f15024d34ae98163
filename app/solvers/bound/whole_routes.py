"""A bound where every UAV carries enough for all that it can visit: column generation over routes."""

from __future__ import annotations

import numpy as np

from app.domain.problem import TOLERANCE
from app.solvers.bound.instance import Instance, safely
from app.solvers.column_generation.packing import Packing, reachable, worth
from app.solvers.column_generation.pool import CAPACITY, always_whole, new_pool
from app.solvers.column_generation.pricing import Pricing
from app.solvers.protocol import StopCriterion

_ROOM = 400_000
"""Labels of one UAV."""


def route_bound(instance: Instance, lower: float, stop: StopCriterion) -> float:
    """Bound the reward of any plan, in the instance's scale; infinite where there is no such bound in time.

    Parameters
    ----------
    instance
        The problem.
    lower
        Reward of a plan that is known, in the instance's scale.
    stop
        Asked every few milliseconds; HiGHS is told how long it leaves.
    """
    arrays = instance.arrays
    if not always_whole(arrays) or not arrays.terms["metric"][0]:
        return np.inf
    pool = new_pool(arrays, 4 * CAPACITY)
    pricing = Pricing(arrays, pool, room=_ROOM, effort=np.inf, tolerance=2.0 * TOLERANCE)
    pricing.close(Packing(arrays, pool, stop), lower * instance.scale, stop)
    bound = safely(pricing.bound, abs(pricing.bound) + float(worth(arrays).sum()))
    return reachable(arrays, bound) / instance.scale
