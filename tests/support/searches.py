"""Searches whose current plan is looked at, and time that passes by being looked at."""

from __future__ import annotations

import numpy as np

from app.simulation.evaluation import rewards_of
from app.simulation.visit import UNLOADS_NOTHING
from app.solvers.local_search.routes import USELESS


def current_actions(search):
    """The current plan, not the incumbent, as joint actions (S, M)."""
    routes, home = search.routes, search.arrays.areas["level"].shape[1]
    used = np.arange(routes.target.shape[1])[None, :] < routes.length[:, None]
    return np.where(used, routes.target, home).T.copy()


def assert_evaluated(search):
    """The totals are those of the current plan; where a visit is useless, the simulator says so too."""
    routes, arrays = search.routes, search.arrays
    judged = rewards_of(arrays, current_actions(search)[None])
    if routes.total[USELESS] > 0.5:
        assert judged.rule[0] == UNLOADS_NOTHING
        return
    assert judged.rule[0] == 0
    scale = 1 + abs(judged.distance[0])
    np.testing.assert_allclose(
        routes.total[:2], [judged.satisfaction[0], judged.distance[0]], rtol=0, atol=1e-9 * scale
    )


class Clock:
    """Time passes by being looked at."""

    def __init__(self, step):
        self.now, self.step = 0.0, step

    def __call__(self):
        self.now += self.step
        return self.now
