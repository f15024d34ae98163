"""Putting the plans of several episodes together: every UAV may take the route it has in another of them.

An episode's plan is seldom good everywhere: the UAVs that did well in one did not in another. So plans are
gone through UAV by UAV; each takes that of its routes, out of all episodes, with which the whole plan earns
most. No route is changed, but for visits and reloads that others have made useless, which are left out.

What a route adds after all others have flown is quickly told, and is what it adds in the whole plan where
nobody else goes to its targets. So only the routes that promise most by that are flown with all others.
"""

from __future__ import annotations

import numpy as np

from app.learning.universal.episodes.best_plan import BestPlan
from app.learning.universal.episodes.routes import NOBODY, fly_last, fly_routes
from app.simulation.arrays import Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.episodes import Episodes
from app.simulation.evaluation import rewards_of
from app.simulation.simulator import new_episodes
from app.simulation.visit import ALLOWED
from app.solvers.protocol import StopCriterion

_KEPT = 128
"""Plans whose routes are kept, the best ones."""

_FLOWN = 6
"""Routes of a UAV that are flown with all others."""

_PIECE = 2e5
"""Turns that are played between two looks at the stop criterion, about; a few milliseconds."""

_WORK = 2.5e6
"""Turns that are played for all plans together to go once through their UAVs; some hundredths of a second."""


class Recombination:
    """Keeps the routes of the plans it was shown.

    Parameters
    ----------
    arrays
        A stack of one problem.
    best
        The best plan so far; changed where a better one is found.
    """

    def __init__(self, arrays: ProblemArrays, best: BestPlan) -> None:
        m, n, _ = arrays.shape
        self._arrays, self._best = arrays, best
        self._plans: Integers = np.full((0, int(arrays.max_steps[0]), m), n, np.int64)
        self._episodes = new_episodes(arrays, 2 if arrays.n_bases else 1)

    def consider(self, plans: Integers, stop: StopCriterion) -> None:
        """Look at plans, and at what routes of theirs and of those before make of them and of the best one.

        Where the problem is large not all of them are improved, but the best first.

        Parameters
        ----------
        plans
            (B, S, M); those that are not allowed are left out.
        stop
            Asked every few milliseconds.
        """
        self._best.consider(plans)
        plans = self._allowed(np.concatenate([self._best.actions[None], plans]))
        self._plans = self._allowed(np.concatenate([self._plans, plans]))[:_KEPT]
        routes, counts = _distinct_routes(self._plans)
        turns = int(counts.sum() + _FLOWN * plans.shape[2] ** 2) * plans.shape[1]
        for plan in plans[: int(_WORK / max(turns, 1))]:
            if stop():
                break
            uav, unchanged = 0, 0
            while unchanged < len(counts) and not stop():
                uav, unchanged = _improve(
                    self._arrays, self._episodes, plan, routes, counts, uav, unchanged, _PIECE
                )
            self._best.consider(plan[None])

    def _allowed(self, plans: Integers) -> Integers:
        """Those of some plans that are allowed, each once, best first."""
        plans = np.unique(plans, axis=0)
        replayed = rewards_of(self._arrays, plans)
        order = np.argsort(-replayed.reward, kind="stable")
        return plans[order[replayed.rule[order] == ALLOWED]]


def _distinct_routes(plans: Integers) -> tuple[Integers, Integers]:
    """Routes (M, R, S) of every UAV, each once, and how many it has (M,)."""
    found = [np.unique(plans[:, :, i], axis=0) for i in range(plans.shape[2])]
    counts = np.array([len(each) for each in found])
    routes = np.zeros((len(found), int(counts.max(initial=0)), plans.shape[1]), np.int64)
    for i, each in enumerate(found):
        routes[i, : len(each)] = each
    return routes, counts


@njit(cache=True, nogil=True, error_model="numpy")
def _improve(
    arrays: ProblemArrays,
    episodes: Episodes,
    plan: Integers,
    routes: Integers,
    counts: Integers,
    i: int,
    unchanged: int,
    piece: float,
) -> tuple[int, int]:
    """Replace routes of an allowed plan (S, M) by those with which it earns more, from UAV `i` on.

    Returns which UAV is next and for how many in a row no other route was better: for all, and it is done.
    It ends after about so many turns, too.
    """
    m, steps = plan.shape[1], plan.shape[0]
    tried = plan.T.copy()
    played, best = np.empty_like(plan), np.empty_like(plan)
    place, promises = np.empty(m, np.int64), np.empty(routes.shape[1])
    materials = arrays.load.shape[2]
    loads, needs = np.empty(materials), np.empty((steps, materials))
    reward = fly_routes(arrays, episodes, tried, place, plan, NOBODY)
    turns = 0
    while unchanged < m and turns < piece:
        better = False
        turns += _FLOWN * plan.size + counts[i] * steps
        others = fly_routes(arrays, episodes, tried, place, played, i)
        for r in range(counts[i]):
            promises[r] = others + fly_last(arrays, episodes, i, routes[i, r], loads, needs)
            if (routes[i, r] == tried[i]).all():
                promises[r] = -np.inf
        for _ in range(min(_FLOWN, counts[i])):
            r = int(promises[: counts[i]].argmax())
            if promises[r] == -np.inf:
                break
            promises[r] = -np.inf
            tried[i] = routes[i, r]
            earned = fly_routes(arrays, episodes, tried, place, played, NOBODY)
            if earned > reward + 1e-12 * abs(reward):
                reward, better = earned, True
                best[:] = played
        if better:
            plan[:] = best
            tried[:] = plan.T
        else:
            tried[i] = plan[:, i]
        unchanged = 0 if better else unchanged + 1
        i = (i + 1) % m
    return i, unchanged
