"""Column generation: routes that the relaxation's prices ask for, until no route is missing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.problem import TOLERANCE
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.solvers.column_generation.labelling import (
    Labels,
    NgNeighbourhoods,
    begin,
    collect_labels,
    extend,
    neighbourhoods_of,
    new_labels,
    remember,
    values,
)
from app.solvers.column_generation.packing import Packing, Relaxation, idle_cost, worth
from app.solvers.column_generation.pool import Pool, largest_needs
from app.solvers.column_generation.resources import VehicleResources, resources_of
from app.solvers.protocol import StopCriterion

_ROOM = 40_000
"""Labels of one UAV in a search."""

_PIECE = 1_000
"""Labels extended between two looks at the clock: some milliseconds."""

_EFFORT = 100_000
"""Labels after which no more routes are asked for at a time, whatever the time."""

_BATCH = 60
"""Routes of a kind of UAV that are taken at a time."""

_CYCLES = 20
"""Labels of a kind of UAV, at most, of whose forgotten visits more are remembered at a time."""

_GAIN = 1e-7
"""What a route must be worth over what it has to, in largest levels, to change the relaxation."""


class _Turn(NamedTuple):
    """What came of asking for routes once: labels made, whether routes or memories were added."""

    labels: int
    grew: bool
    remembered: bool


class Pricing:
    """The routes of each kind of UAV that flies, at prices that change until no route is missing."""

    def __init__(
        self,
        arrays: ProblemArrays,
        pool: Pool,
        *,
        room: int = _ROOM,
        effort: float = _EFFORT,
        tolerance: float = TOLERANCE,
    ) -> None:
        """Prepare to add routes to a pool.

        Parameters
        ----------
        arrays
            A stack of one problem.
        pool
            Its pool.
        room
            Labels that there is room for, for one UAV.
        effort
            Labels after which no more routes are asked for at a time.
        tolerance
            By what share of a limit it may be exceeded. More than the simulator's leaves room for rounding in
            the bound; routes that need it are not added.
        """
        self._arrays, self._pool, self._room, self._tolerance = arrays, pool, room, tolerance
        self._neighbourhoods: NgNeighbourhoods | None = None
        self._kinds: list[tuple[int, int, VehicleResources]] = []
        self._labels: dict[int, Labels] = {}
        steps = int(arrays.max_steps[0])
        self._scratch = tuple(np.empty(steps + 1) for _ in range(3))
        self._targets = np.empty(steps, np.int64)
        self._worth = worth(arrays)
        self._gain = _GAIN * float(self._worth.max(initial=0.0))
        self._idle, self._effort = idle_cost(arrays), effort
        self.left = np.inf
        """How many labels may be made from now on, about."""
        self.bound = np.inf
        """What no choice of whole routes exceeds, whether they are in the pool or not."""

    def _prepare(self, ended: StopCriterion) -> NgNeighbourhoods | None:
        """Measure what the labels need, once; None if there was no time."""
        if self._neighbourhoods is not None:
            return self._neighbourhoods
        arrays = self._arrays
        ng = neighbourhoods_of(arrays, ended)
        if ng is None:
            return None
        needed, prepared = largest_needs(arrays), []
        kinds, number = np.unique(self._pool.kind[~arrays.ret[0]], return_counts=True)
        for i, many in zip(kinds.tolist(), number.tolist(), strict=True):
            if ended():
                return None
            prepared.append((i, many, resources_of(arrays, i, needed, self._tolerance)))
        counts = {len(resources.rate) for _, _, resources in prepared}
        self._labels = {size: new_labels(arrays.shape[1], size, self._room) for size in counts}
        self._kinds, self._neighbourhoods = prepared, ng
        return ng

    def close(
        self, packing: Packing, best: float, ended: StopCriterion, thorough: bool = True
    ) -> Relaxation | None:
        """Add routes to the pool until its relaxation is that of all routes.

        Parameters
        ----------
        packing
            Of the pool.
        best
            What the best plan earns that is known; routes that no better one can use are not added.
        ended
            Asked every few milliseconds; when true, the relaxation is that of the routes so far.
        thorough
            Whether to find every route that is missing, or those that are found at once.

        Returns
        -------
        Relaxation or None
            None where HiGHS finds no optimum in time, or there is no time to begin.
        """
        ng = self._prepare(ended)
        if ng is None:
            return None
        exact, effort = False, 0
        relaxed = packing.relax()
        while relaxed is not None and effort < self._effort and self.left > 0 and not ended():
            promised = max(0.0, relaxed.reward - packing.better_than(best))
            turn = self._ask(ng, packing, relaxed, promised, exact, ended)
            effort += turn.labels
            self.left -= turn.labels
            if turn.grew:
                relaxed, exact = packing.relax(), False
            elif not thorough or self.bound <= relaxed.reward + self._gain:
                break
            elif not exact:
                exact = True
            elif not turn.remembered:
                break
        return relaxed

    def _ask(
        self,
        ng: NgNeighbourhoods,
        packing: Packing,
        relaxed: Relaxation,
        promised: float,
        exact: bool,
        ended: StopCriterion,
    ) -> _Turn:
        """Ask for routes at the prices of a relaxation, and bound what any choice of routes earns."""
        made, grew, remembered, complete = 0, False, False, exact and not packing.fixed
        spare = packing.spare()
        bound = float(np.maximum(0.0, self._worth - relaxed.price).sum())
        for asked, (i, many, resources) in enumerate(self._kinds, start=1):
            if not spare[i]:
                continue
            labels = self._labels[len(resources.rate)]
            complete &= self._label(ng, resources, relaxed.price, labels, exact, ended)
            made += int(labels.size[0])
            value, least = values(resources, labels), relaxed.least[i]
            bound += many * max(value.max(initial=-np.inf), -self._idle[i])
            before = self._known()
            good = _most(value, least - promised, _BATCH)
            collect_labels(self._arrays, self._pool, i, labels, good, self._targets, *self._scratch)
            if self._known() != before:
                grew = True
            elif exact:
                cycles = _most(value, least + self._gain, _CYCLES)
                remembered |= remember(ng, labels, cycles) > 0
            if ended() or made >= self.left:
                # The others come first next time.
                self._kinds = self._kinds[asked:] + self._kinds[:asked]
                return _Turn(made, grew, remembered)
        if complete:
            self.bound = min(self.bound, bound)
        return _Turn(made, grew, remembered)

    def _label(
        self,
        ng: NgNeighbourhoods,
        resources: VehicleResources,
        price: Floats,
        labels: Labels,
        exact: bool,
        ended: StopCriterion,
    ) -> bool:
        """Make the labels of a UAV; whether they are all there are."""
        begin(ng, resources, price, labels, exact)
        while labels.extended[0] < labels.size[0]:
            if ended() or not extend(ng, resources, price, labels, exact, _PIECE):
                break
        return bool(labels.extended[0] == labels.size[0])

    def _known(self) -> tuple[int, float]:
        """Number and length of all routes, one of which changes when a route is added or replaced."""
        size = int(self._pool.size[0])
        return size, float(self._pool.distance[:size].sum())


def _most(value: Floats, least: float, count: int) -> Integers:
    """Return the labels worth more than the least, at most so many, in the order in which they were found."""
    good = np.flatnonzero(value > least)
    if len(good) > count:
        good = good[np.argpartition(-value[good], count)[:count]]
    return np.sort(good)
