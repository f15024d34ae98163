"""The ways of single legs of a problem, worked out for the answer alone: searches need only their lengths."""

from __future__ import annotations

from functools import cached_property

from app.domain.allocation import Path
from app.domain.geometry import distance
from app.domain.problem import Problem
from app.simulation.homes import AT_START
from app.simulation.legs import places_of, zones_of
from app.simulation.visit import START
from app.travel.around_zones import LegsAroundZones

_LONGER = 1.0 + 1e-12
"""A way that turns is longer than the straight line by more than the rounding of either."""


class Ways:
    """Ways round the no-fly zones of a problem.

    Zones are looked at when the first way is asked for that is longer than the straight line.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        # In the order in which the lengths were worked out, so that of two ways of one length it is that one.
        self._places = places_of(problem)

    def to(self, i: int, at: int, j: int, length: float) -> Path | None:
        """Return the points that UAV `i` flies over from where it is to stop `j`.

        Parameters
        ----------
        i, at, j
            As in :mod:`app.simulation.visit`.
        length
            Of the leg, over ground.

        Returns
        -------
        tuple
            None where the way is a straight line, or is not known.
        """
        return self._between(i, self._place(i, at), self._stop(j), length)

    def home(self, i: int, at: int, base: int, length: float) -> Path | None:
        """Return the same for its way home, to a base or, with ``AT_START``, its starting point."""
        m, n = self._problem.n_uavs, self._problem.n_targets
        home = m + i if base == AT_START else self._stop(n + 1 + base)
        return self._between(i, self._place(i, at), home, length)

    def _place(self, i: int, at: int) -> int:
        return i if at == START else self._stop(at)

    def _stop(self, j: int) -> int:
        """Number of a stop among the places: no place is there for N, which sends a UAV home."""
        return 2 * self._problem.n_uavs + j - (j > self._problem.n_targets)

    def _between(self, i: int, origin: int, destination: int, length: float) -> Path | None:
        problem = self._problem
        if not problem.no_fly_zones:
            return None
        straight = distance(problem.crs, *self._places[origin].tolist(), *self._places[destination].tolist())
        if length <= straight * _LONGER:
            return None
        way = self._legs.way(origin, destination, problem.uavs[i].speed)
        if way is None or len(way.points) <= 2:
            return None
        return tuple((x, y) for x, y in way.points.tolist())

    @cached_property
    def _legs(self) -> LegsAroundZones:
        """The legs in still air: wind does not change a way, and those that it forbids are in no plan."""
        return LegsAroundZones(self._problem.crs, self._places, zones_of(self._problem))
