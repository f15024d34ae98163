"""Combining the routes that a search came across with those that prices ask for, and choosing the best."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np

from app.simulation.arrays import Integers
from app.solvers.column_generation.diving import dive
from app.solvers.column_generation.packing import Packing, Relaxation, next_reward
from app.solvers.column_generation.pool import CAPACITY, always_whole, new_pool, pour, thin
from app.solvers.column_generation.pricing import Pricing
from app.solvers.local_search.annealing import Search, drop_useless, set_routes
from app.solvers.local_search.effort import combined_round, is_combined
from app.solvers.protocol import StopCriterion
from app.solvers.stop import Deadline, EarlierOf

_PARTS, _PARTS_UNLIMITED = 3, 1
"""Parts of a search at whose ends its routes are combined, beside the end of its first round; the second
where no time limit keeps that short."""

_FIRST_SHARE, _SHARE = 0.4, 0.15
"""Share of a time limit that the first combination may take, and that another one may."""

_LAST_SHARE, _LEAST_S, _MOST_S = 0.12, 0.06, 1.0
"""Share that is kept for the last one, and how many seconds it is at least and at most."""

_PRICED, _DIVED, _DIVED_ON = 0.5, 0.75, 0.9
"""Shares of a combination's time after which asking for routes, the first dive and the others end."""

_DIVES, _DIVES_UNLIMITED = 8, 3
"""Further dives, at most, once routes are chosen; likewise."""

_LABELS_UNLIMITED = 50_000
"""Labels that a combination asks for routes with where no time limit keeps it short; tenths of a second."""

_OFTEN = 0.3
"""Share of the time so far up to which routes are combined whenever the pool is half full."""

_SEED = 20220816
"""Of the random numbers of dives."""

_WORTH_S = 0.1
"""Seconds from which on there is time for a combination."""


class Combination:
    """The pools of searches that run side by side, where combining their routes is worth its time."""

    def __init__(self, searches: Sequence[Search], rounds: int, left: float) -> None:
        """Prepare to combine the routes of several rounds, in a part of the seconds left."""
        arrays = searches[0].arrays
        time_enough = left >= _WORTH_S
        self.on = rounds > 1 and time_enough and is_combined(arrays, searches[0].routes.length)
        self._left, self._unlimited = left, math.isinf(left)
        self._begin, self._spent = time.monotonic(), 0.0
        self.seconds = 0.0
        """How long before the end of the time the last round has to end."""
        self.proven = False
        """Whether the incumbent is known to be a best plan."""
        self.searches = list(searches)
        """The searches, with pools."""
        if self.on:
            self.searches = [search._replace(pool=new_pool(arrays)) for search in searches]
            self._visits = int(searches[0].routes.length.sum())
            self._pricing = Pricing(arrays, self.searches[0].pool)
            self._rng = np.random.default_rng(_SEED)
            self._complete = always_whole(arrays) and arrays.terms["metric"][0]
            if left < math.inf:
                self.seconds = min(max(_LAST_SHARE * left, _LEAST_S), _MOST_S)

    def after_round(self, ended: int, rounds: int, stop: StopCriterion) -> int:
        """Gather the routes after a round; now and then, and after the last one, combine them.

        Parameters
        ----------
        ended, rounds
            How many rounds have ended, and how many there are to be.
        stop
            Asked every few milliseconds, but not while HiGHS chooses.

        Returns
        -------
        int
            How many rounds there are to be in all: under a time limit fewer, once it is known that plans have
            many visits.
        """
        if not self.on:
            return rounds
        first, *others = self.searches
        for search in others:
            pour(search.pool, first.pool)
        parts = _PARTS_UNLIMITED if self._unlimited else _PARTS
        due = ended in {1, rounds} or ended % max(1, rounds // parts) == 0
        if due or (first.pool.size[0] > CAPACITY // 2 and self._affordable()):
            begin = time.monotonic()
            self._combine(self._seconds(begin, _FIRST_SHARE if ended == 1 else _SHARE), stop)
            self._spent += time.monotonic() - begin
        if ended == 1 and not self._unlimited:
            longer = combined_round(int(first.best_length.sum())) / combined_round(self._visits)
            rounds = 1 + max(1, round((rounds - 1) / max(longer, 1.0)))
        return rounds

    def _affordable(self) -> bool:
        """Whether combinations have taken little of the time so far."""
        return self._unlimited or self._spent <= _OFTEN * (time.monotonic() - self._begin)

    def _seconds(self, begin: float, share: float) -> float:
        """Return how long a combination may take that begins now and may take a share of the time limit."""
        return min(max(share * self._left, self.seconds), self._begin + self._left - begin)

    def _combine(self, seconds: float, stop: StopCriterion) -> None:
        """Ask for the routes that are missing, and make the best choice of routes the incumbent."""
        if self._unlimited:
            self._pricing.left = _LABELS_UNLIMITED
        priced, dived, dived_on, ended = (
            EarlierOf(stop, Deadline(share * seconds)) for share in (_PRICED, _DIVED, _DIVED_ON, 1.0)
        )
        packing = Packing(self.searches[0].arrays, self.searches[0].pool, ended)
        relaxed = self._pricing.close(packing, self._best(), priced)
        if relaxed is not None:
            self._take(dive(packing, self._pricing, relaxed, self._best(), dived))
            relaxed = packing.relax()
        if relaxed is not None:
            if relaxed.price.any() and not stop():
                # Where everything can be had, no route is better than another.
                self._take(packing.choose(relaxed, self._best()))
            latest = self._dive_on(packing, relaxed, dived_on)
            if latest is not None:
                self._thin(latest)
        self.proven = self._complete and self._pricing.bound < self._next()

    def _dive_on(self, packing: Packing, relaxed: Relaxation, ended: StopCriterion) -> Relaxation | None:
        """Dive some times more, each time elsewhere; return the relaxation after that."""
        found: Relaxation | None = relaxed
        for _ in range(_DIVES_UNLIMITED if self._unlimited else _DIVES):
            if found is None or ended() or found.reward < self._next():
                break
            self._take(dive(packing, self._pricing, found, self._best(), ended, self._rng))
            found = packing.relax()
        return found

    def _thin(self, relaxed: Relaxation) -> None:
        """Drop the routes that lose most."""
        pool = self.searches[0].pool
        size = int(pool.size[0])
        room = CAPACITY // 4 if size > CAPACITY // 2 else size
        kept = np.zeros(size, np.bool_)
        kept[np.argsort(relaxed.loss, kind="stable")[:room]] = True
        thin(pool, kept)

    def _best(self) -> float:
        """Return what the best plan of all searches earns."""
        return max(float(search.best[0]) for search in self.searches)

    def _next(self) -> float:
        """Return what a better one would earn at least."""
        return next_reward(self.searches[0].arrays, self._best())

    def _take(self, actions: Integers | None) -> None:
        """Make a choice of routes the current plan, if there is one."""
        if actions is not None:
            set_routes(self.searches[0], actions)
            drop_useless(self.searches[0])
