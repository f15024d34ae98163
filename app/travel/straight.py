"""Legs over open ground: straight lines, or arcs of great circles, with wind or without."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from app.domain.geometry import distances
from app.travel.headings import heading
from app.travel.legs import Flown, Way
from app.travel.wind import Wind

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

STILL_AIR = Wind(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class StraightLegs:
    """Straight legs between P places.

    Attributes
    ----------
    crs
        As in :func:`app.domain.geometry.distance`.
    places
        (P, 2).
    wind
        It is still where nothing is given.
    """

    crs: str
    places: Floats
    wind: Wind = STILL_AIR

    def between(self, origins: Integers, destinations: Integers) -> StraightBlock:
        """Return a block of legs; see :meth:`app.travel.legs.Legs.between`."""
        ground = straight_lengths(self.crs, self.places, origins, destinations)
        return StraightBlock(self, origins, destinations, ground)

    def way(self, origin: int, destination: int, speed: float) -> Way | None:
        """Return the way of one leg; see :meth:`app.travel.legs.Legs.way`."""
        return way_along(self.crs, self.places[[origin, destination]], self.wind, speed)


@dataclass(frozen=True, slots=True)
class StraightBlock:
    """A block of straight legs."""

    legs: StraightLegs
    origins: Integers
    destinations: Integers
    ground: Floats = field(repr=False)

    def flown(self, speed: float) -> Flown:
        """Return air lengths and times; see :meth:`app.travel.legs.LegBlock.flown`."""
        legs = self.legs
        return flown_straight(
            legs.crs,
            legs.wind,
            speed,
            self.ground,
            legs.places[self.origins],
            legs.places[self.destinations],
        )


def straight_lengths(crs: str, places: Floats, origins: Integers, destinations: Integers) -> Floats:
    """Return lengths of straight legs, for indices of places that are broadcast against each other."""
    if origins.ndim == 2 and origins.shape[1] == 1 and destinations.ndim == 1:
        return distances(crs, places[origins[:, 0]], places[destinations])
    a, b = np.broadcast_arrays(origins, destinations)
    lengths = np.empty(a.shape)
    flat = lengths.reshape(-1)
    for k, (i, j) in enumerate(zip(a.ravel().tolist(), b.ravel().tolist(), strict=True)):
        flat[k] = _length(crs, places[i], places[j])
    return lengths


def flown_straight(crs: str, wind: Wind, speed: float, length: Floats, a: Floats, b: Floats) -> Flown:
    """Return air lengths and times of straight legs.

    Parameters
    ----------
    crs
        As in :func:`app.domain.geometry.distance`.
    wind, speed
        The wind, and the speed of the UAV through the air.
    length
        (...) over ground; infinite where there is no leg.
    a, b
        (..., 2) from where and to where, broadcast against each other.
    """
    if wind.speed == 0.0:
        return Flown(length, length / speed)
    time = wind.time(speed, length, *heading(crs, a, b))
    return Flown(time * speed, time)


def way_along(crs: str, points: Floats, wind: Wind, speed: float) -> Way | None:
    """Return the way over some points, at least two; None where the wind forbids it.

    A corner that is at one place with the point before or after it is left out.
    """
    kept = [points[0]]
    for k, point in enumerate(points[1:], 1):
        if _length(crs, kept[-1], point) == 0.0:
            if k < len(points) - 1:
                continue
            # The last point is the place that is flown to, as it is written there.
            kept = kept[:-1] if len(kept) > 1 else kept
        kept.append(point)
    ground = np.array([_length(crs, a, b) for a, b in pairwise(kept)])
    flown = np.stack(kept)
    air, time = flown_straight(crs, wind, speed, ground, flown[:-1], flown[1:])
    return Way(flown, ground, air, time) if np.isfinite(time).all() else None


def _length(crs: str, a: Floats, b: Floats) -> float:
    return float(distances(crs, a[None], b[None])[0, 0])
