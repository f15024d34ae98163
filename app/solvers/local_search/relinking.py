"""Path relinking: the search goes on from plans that lie between two good ones.

Between two plans are those in which some UAVs fly the one's routes and the others the other's. The way from
one to the other replaces a route at a time, always the one after which the plan is worth most (Glover, "Tabu
search and adaptive memory programming", 1997; for team orienteering Souffriau et al., "A path relinking
approach for the team orienteering problem", Computers & Operations Research 2010).
"""

from __future__ import annotations

from copy import deepcopy

import numpy as np

from app.simulation.arrays import NONE, Flags, Integers
from app.simulation.decorators import compiled
from app.solvers.local_search.annealing import ROUNDING, Search, keep_best, set_route, worth
from app.solvers.local_search.change import undo
from app.solvers.local_search.routes import Routes, copy_routes

_ROOM = 8
"""Plans at most that are kept."""

_APART = 2
"""Routes at least in which a plan between two differs from each."""

LEAST_UAVS = 2 * _APART + 2
"""UAVs from which on plans are relinked: of fewer there is little between two."""


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

    def relink(self, search: Search, rng: np.random.Generator, useless: float) -> bool:
        """Make the best plan between two of them the current one; one of them where they are too alike.

        Parameters
        ----------
        search
            Changed: its current plan, and its incumbent where the way leads over a better one.
        rng
            Chooses the two.
        useless
            What a useless visit costs.

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
        order = np.zeros(len(start.length), np.int64)
        best = _walk(search, goal.target, goal.length, useless, order, np.zeros(len(order), np.bool_))
        copy_routes(start, search.routes)
        for i in map(int, order[:best]):
            set_route(search, i, goal.target[i, : goal.length[i]])
        return best > 0


@compiled
def _walk(
    search: Search, target: Integers, length: Integers, useless: float, order: Integers, missing: Flags
) -> int:
    """Give the UAVs the routes of another plan, one by one.

    Parameters
    ----------
    search
        Changed: its current plan becomes the other one, and its incumbent where a better one is on the way.
    target, length
        (M, S) and (M,) the other plan's routes.
    useless
        What a useless visit costs.
    order
        (M,) receives the UAVs in the order in which they got their routes.
    missing
        (M,) scratch space, all False.

    Returns
    -------
    int
        After how many of them the plan was worth most, not nearer to either than ``_APART``; 0 where none is.
    """
    routes, differing = search.routes, 0
    for i in range(len(length)):
        if not _has_route(routes, i, target, length):
            missing[i] = True
            differing += 1
    most, best = -np.inf, 0
    for made in range(1, differing + 1):
        after, chosen = -np.inf, NONE
        for i in range(len(length)):
            if missing[i] and set_route(search, i, target[i, : length[i]]):
                value = worth(search, useless)
                undo(search.arrays, routes, search.change)
                if value > after:
                    after, chosen = value, i
        if chosen == NONE:
            break
        set_route(search, chosen, target[chosen, : length[chosen]])
        missing[chosen], order[made - 1] = False, chosen
        keep_best(search)
        if after > most and _APART <= made <= differing - _APART:
            most, best = after, made
    return best


@compiled
def _has_route(routes: Routes, i: int, target: Integers, length: Integers) -> bool:
    """Whether a UAV has the same route in the current plan as in another one."""
    same, s = routes.length[i] == length[i], 0
    while same and s < length[i]:
        same = routes.target[i, s] == target[i, s]
        s += 1
    return bool(same)
