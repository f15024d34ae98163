"""Combining what a search came across: prices for the routes to be collected, and the best choice of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.solvers.local_search.annealing import Search, drop_useless, set_routes
from app.solvers.local_search.effort import combined_round
from app.solvers.local_search.packing import best_choice, next_reward, relax
from app.solvers.local_search.pool import CAPACITY, new_pool, often_whole, pour, thin

_PARTS = 3
"""Parts of a search at whose ends its routes are combined."""

_SHARE, _LEAST_S, _MOST_S = 0.12, 0.06, 1.0
"""Share of a time limit that one choice may take, and how many seconds it is at least and at most."""

_WORTH_S = 0.2
"""Seconds from which on there is time for a choice."""

_AHEAD = 0.6
"""Share of its seconds after which HiGHS is told to stop, because it takes longer."""

_SLACK = 0.5
"""Share of what the relaxation promises over the incumbent by which a route may fall short of its price."""


class Combination:
    """The pools of searches that run side by side, where combining their routes is worth its time."""

    def __init__(self, searches: Sequence[Search], rounds: int, left: float | None) -> None:
        """Prepare to combine the routes of several rounds, in a part of the seconds left, if it is known."""
        time_enough = left is None or left >= _WORTH_S
        self._on = rounds > 1 and time_enough and often_whole(searches[0].arrays)
        self.seconds = 0.0
        """How long before the end of the time the last round has to end."""
        if self._on and left is not None:
            self.seconds = min(max(_SHARE * left, _LEAST_S), _MOST_S)
        self._visits = int(searches[0].routes.length.sum())
        self._limit = None if left is None else _AHEAD * self.seconds
        self._parts = _PARTS if left is None or left * _SHARE > _LEAST_S else 1
        self.searches = [
            search._replace(pool=new_pool(search.arrays)) if self._on else search for search in searches
        ]
        """The searches, with pools."""

    def after_round(self, ended: int, rounds: int) -> int:
        """Gather the routes after a round; now and then, and after the last one, combine them.

        Returns
        -------
        int
            How many rounds there are to be in all: under a time limit fewer, once it is known that plans have
            many visits.
        """
        if not self._on:
            return rounds
        first, *others = self.searches
        for search in others:
            pour(search.pool, first.pool)
        if ended == 1 and self._limit is not None:
            longer = combined_round(int(first.best_length.sum())) / combined_round(self._visits)
            rounds = 1 + max(1, round((rounds - 1) / max(longer, 1.0)))
        part = max(1, rounds // self._parts)
        if ended == rounds or ended % part == 0 or first.pool.size[0] > CAPACITY // 2:
            self._combine()
        return rounds

    def _combine(self) -> None:
        """Make the best choice of routes the incumbent, and tell the pools what routes are worth."""
        first = self.searches[0]
        relaxed = relax(first.arrays, first.pool)
        if relaxed is None:
            return
        best = max(float(search.best[0]) for search in self.searches)
        actions = best_choice(first.arrays, first.pool, relaxed, best, self._limit)
        if actions is not None:
            set_routes(first, actions)
            drop_useless(first)
            best = max(best, float(first.best[0]))
        promised = max(0.0, relaxed.reward - next_reward(first.arrays, best))
        for search in self.searches:
            search.pool.price[:] = relaxed.price
            search.pool.least[:] = relaxed.least - _SLACK * promised
        size = int(first.pool.size[0])
        room = CAPACITY // 4 if size > CAPACITY // 2 else size
        kept = np.zeros(size, np.bool_)
        kept[np.argsort(relaxed.loss, kind="stable")[:room]] = True
        thin(first.pool, kept)
