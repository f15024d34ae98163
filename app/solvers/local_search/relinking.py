"""Path relinking: the search goes on from plans that lie between two good ones.

Between two plans are those in which some UAVs fly the one's routes and the others the other's. The way from
one to the other replaces a route at a time, always the one after which the plan is worth most (Glover, "Tabu
search and adaptive memory programming", 1997; for team orienteering Souffriau et al., "A path relinking
approach for the team orienteering problem", Computers & Operations Research 2010).
"""

from __future__ import annotations

from copy import deepcopy
from typing import NamedTuple

import numpy as np

from app.simulation.arrays import NONE, Flags, Floats, Integers
from app.simulation.decorators import compiled
from app.solvers.local_search.annealing import ROUNDING, Search, keep_best, set_route, worth
from app.solvers.local_search.change import undo
from app.solvers.local_search.routes import Routes, copy_routes
from app.solvers.protocol import StopCriterion

_ROOM = 8
"""Plans at most that are kept."""

_AT_ONCE = 500
"""Plans that are looked at on the way between two looks at the stop criterion; some milliseconds."""

_APART = 2
"""Routes at least in which a plan between two differs from each."""

LEAST_UAVS = 2 * _APART + 2
"""UAVs from which on plans are relinked: of fewer there is little between two."""


class _Way(NamedTuple):
    """How far the way to another plan is made.

    Attributes
    ----------
    target, length
        (M, S) and (M,) the other plan's routes.
    missing
        (M,) UAVs that have another route than there.
    order
        (M,) UAVs in the order in which they got theirs.
    made, best
        (1,) how many have got theirs, and after how many the plan was worth most, 0 where that is nowhere.
    most
        (1,) how much it was worth.
    """

    target: Integers
    length: Integers
    missing: Flags
    order: Integers
    made: Integers
    best: Integers
    most: Floats


class Elite:
    """The best plans that rounds have ended with, no two of the same reward."""

    def __init__(self) -> None:
        self._plans: list[tuple[float, Routes]] = []

    def add(self, search: Search) -> None:
        """Keep the current plan of a search, which is legal, if it is among the best."""
        reward = worth(search, 0.0)
        if any(abs(reward - known) <= ROUNDING * abs(known) for known, _ in self._plans):
            return
        if len(self._plans) == _ROOM:
            lowest = min(range(_ROOM), key=lambda place: self._plans[place][0])
            if self._plans[lowest][0] > reward:
                return
            del self._plans[lowest]
        self._plans.append((reward, deepcopy(search.routes)))

    def relink(self, search: Search, rng: np.random.Generator, useless: float, stop: StopCriterion) -> bool:
        """Make the best plan between two of them the current one; one of them where they are too alike.

        Parameters
        ----------
        search
            Changed: its current plan, and its incumbent where the way leads over a better one.
        rng
            Chooses the two.
        useless
            What a useless visit costs.
        stop
            Asked every few milliseconds; where it says so, the current plan is one of the two.

        Returns
        -------
        bool
            Whether the plan lies between two.
        """
        if not self._plans:
            return False
        chosen = rng.choice(len(self._plans), min(2, len(self._plans)), replace=False)
        start, goal = self._plans[chosen[0]][1], self._plans[chosen[-1]][1]
        copy_routes(start, search.routes)
        way = _way_to(search.routes, goal)
        while not _walk(search, way, useless):
            if stop():
                way.best[0] = 0
                break
        copy_routes(start, search.routes)
        for i in map(int, way.order[: way.best[0]]):
            set_route(search, i, goal.target[i, : goal.length[i]])
        return bool(way.best[0] > 0)


def _way_to(routes: Routes, goal: Routes) -> _Way:
    """Return the way from one plan to another, of which nothing is made."""
    flown = np.arange(goal.target.shape[1]) < goal.length[:, None]
    other = ((routes.target != goal.target) & flown).any(axis=1)
    return _Way(
        target=goal.target,
        length=goal.length,
        missing=other | (routes.length != goal.length),
        order=np.zeros(len(goal.length), np.int64),
        made=np.zeros(1, np.int64),
        best=np.zeros(1, np.int64),
        most=np.full(1, -np.inf),
    )


@compiled
def _walk(search: Search, way: _Way, useless: float) -> bool:
    """Give some UAVs the routes of the other plan, one by one; True once no further UAV can have one.

    Parameters
    ----------
    search
        Changed: its current plan, and its incumbent where a better one is on the way.
    way
        Changed. Its best plan is not nearer to either plan than ``_APART``.
    useless
        What a useless visit costs.
    """
    looks = 0
    while looks < _AT_ONCE:
        after, chosen, left = -np.inf, NONE, 0
        for i in range(len(way.missing)):
            if not way.missing[i]:
                continue
            left += 1
            if set_route(search, i, way.target[i, : way.length[i]]):
                value = worth(search, useless)
                undo(search.arrays, search.routes, search.change)
                if value > after:
                    after, chosen = value, i
        if chosen == NONE:
            return True
        looks += left
        set_route(search, chosen, way.target[chosen, : way.length[chosen]])
        way.missing[chosen], way.order[way.made[0]] = False, chosen
        way.made[0] += 1
        keep_best(search)
        if after > way.most[0] and way.made[0] >= _APART and left - 1 >= _APART:
            way.most[0], way.best[0] = after, way.made[0]
    return False
