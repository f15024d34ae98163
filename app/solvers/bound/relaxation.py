"""The bound of one node of the search tree: prices of the needs, found by column generation.

The value of the relaxation at any prices is an upper bound, so it can be cut short at any moment.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import Floats, Integers
from app.solvers.bound.instance import Instance, safely
from app.solvers.bound.master import Master, MasterSolution
from app.solvers.bound.pricing import deliveries, price_sets
from app.solvers.bound.target_sets import TargetSets
from app.solvers.protocol import StopCriterion

_NEW_COLUMNS = 4
"""Most columns a UAV adds a round: more make the master slow, fewer make more rounds."""

_SMOOTHING = 0.6
"""Weight of the best prices so far against the master's, which jump about."""

_MOST_COLUMNS = 4000

_PIECE = 200_000
"""Members of sets times materials that are priced between two looks at the stop criterion; milliseconds."""

_TOLERANCE = 1e-7
"""Distance between master and bound, in the instance's scale, at which prices count as optimal."""


class Pools(NamedTuple):
    """What each UAV may still do in a part of the search tree.

    Attributes
    ----------
    sets
        One entry a UAV, indices of its target sets.
    idle
        One entry a UAV, whether it may visit nothing.
    """

    sets: tuple[Integers, ...]
    idle: tuple[bool, ...]


class Priced(NamedTuple):
    """The relaxation at some prices.

    Attributes
    ----------
    bound
        Upper bound on every plan within the pools.
    pools
        What was evaluated.
    prices
        (N, K).
    values
        One entry a UAV: what each set of its pool is worth at the prices.
    best
        (M,) the most that a UAV can earn at the prices; minus infinity where it can do nothing.
    """

    bound: float
    pools: Pools
    prices: Floats
    values: tuple[Floats, ...]
    best: Floats

    def slack(self, i: int) -> Floats:
        """How much each set of UAV `i` falls short of its best."""
        return self.best[i] - self.values[i]


class Relaxation:
    """The relaxation of one problem, over the sets of targets that each UAV can visit."""

    def __init__(self, instance: Instance, sets: tuple[TargetSets, ...]) -> None:
        self.instance = instance
        self.sets = sets
        self.master = Master(instance)

    def all_pools(self) -> Pools:
        """Return the pools at the root of the tree."""
        return Pools(tuple(np.arange(len(s.size)) for s in self.sets), (True,) * len(self.sets))

    def price(self, pools: Pools, prices: Floats, stop: StopCriterion) -> Priced | None:
        """Evaluate the relaxation at prices ≥ 0; None if it was stopped."""
        instance = self.instance
        gain = instance.worth - prices
        values, best = [], np.where(pools.idle, instance.idle, -np.inf)
        for i, (own, pool) in enumerate(zip(self.sets, pools.sets, strict=True)):
            value = np.empty(len(pool))
            piece = max(1, _PIECE // (own.members.shape[1] * instance.need.shape[1]))
            for first in range(0, len(pool), piece):
                if stop():
                    return None
                part = slice(first, first + piece)
                value[part] = price_sets(
                    own.members, own.size, own.cost, pool[part], gain, instance.need, instance.load[i]
                )
            values.append(value)
            best[i] = max(best[i], value.max(initial=-np.inf))
        total = float(prices.sum()) + float(best.sum())
        magnitude = float(prices.sum()) + float(np.abs(best).sum()) + float(instance.worth.sum())
        bound = safely(total, magnitude) if np.isfinite(total) else -np.inf
        return Priced(bound, pools, prices, tuple(values), best)

    def restrict(self, pools: Pools) -> None:
        """Let the master use the columns of these pools only; those there are too many of are forgotten."""
        if len(self.master.uav) > _MOST_COLUMNS:
            self.master = Master(self.instance)
        kept = [np.zeros(len(own.size) + 1, np.bool_) for own in self.sets]
        for i, pool in enumerate(pools.sets):
            kept[i][pool] = True
            kept[i][-1] = pools.idle[i]
        self.master.allow(
            np.array([kept[i][r] for i, r in zip(self.master.uav, self.master.route, strict=True)])
        )
        for i, (own, pool) in enumerate(zip(self.sets, pools.sets, strict=True)):
            # A route without deliveries for UAVs that must fly, so that the master always has a solution.
            if not pools.idle[i] and len(pool):
                r = int(pool[np.argmin(own.cost[pool])])
                self.master.add(i, r, -float(own.cost[r]), np.zeros(self.instance.need.shape))

    def tighten(
        self, pools: Pools, prices: Floats, enough: float, stop: StopCriterion, near: float = 0.0
    ) -> tuple[Priced | None, MasterSolution | None]:
        """Find prices with a low bound, from given ones.

        Parameters
        ----------
        pools
            What each UAV may do; the master's columns must have been restricted to it.
        prices
            (N, K) to begin with.
        enough
            A bound that is as good as any lower one.
        stop
            Asked every few milliseconds.
        near
            Share of the distance to `enough` by which the bound may stay above the lowest.

        Returns
        -------
        priced, solution
            The lowest bound found, None if it was stopped before there was any; and the master's optimum if
            it has shown that no prices do much better.
        """
        best = self.price(pools, prices, stop)
        if best is None or best.bound <= enough:
            return best, None
        self._add_columns(pools, best, best.prices, None)
        smoothing = _SMOOTHING
        while best.bound > enough and not stop():
            solution = self.master.solve(stop)
            if solution is None:
                return best, None
            if best.bound - solution.value <= max(_TOLERANCE, near * (best.bound - enough)):
                return best, solution
            trial = smoothing * best.prices + (1.0 - smoothing) * solution.prices
            priced = self.price(pools, trial, stop)
            if priced is None:
                return best, None
            added = self._add_columns(pools, priced, trial, solution)
            if priced.bound < best.bound:
                best = priced
            if added:
                smoothing = _SMOOTHING
            elif smoothing == 0.0:
                return best, solution
            else:
                smoothing = smoothing / 2 if smoothing > 0.1 else 0.0
        return best, None

    def _add_columns(
        self, pools: Pools, priced: Priced, prices: Floats, solution: MasterSolution | None
    ) -> int:
        """Add each UAV's best sets; return the number of columns that improve the master."""
        instance = self.instance
        gain = instance.worth - prices
        added = 0
        for i, (own, pool) in enumerate(zip(self.sets, pools.sets, strict=True)):
            values = priced.values[i]
            if not len(values):
                continue
            few = min(_NEW_COLUMNS, len(values))
            for at in np.argpartition(-values, few - 1)[:few]:
                r = int(pool[at])
                share = deliveries(own.members[r], int(own.size[r]), gain, instance.need, instance.load[i])
                earning = float((instance.worth * share).sum() - own.cost[r])
                if solution is not None:
                    reduced = earning - float((solution.prices * share).sum()) - solution.shadow[i]
                    if reduced <= 1e-9:
                        continue
                added += self.master.add(i, r, earning, share)
        return added
