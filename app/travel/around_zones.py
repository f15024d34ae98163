"""Legs round no-fly zones: the shortest ways over ground, with wind or without.

A shortest way is straight but at corners of the union. From every place to every corner the shortest way is
worked out once; a leg that is not straight then ends with a piece from one of the corners that its
destination sees. Kept for a leg is which corner that is, and from it follow the way and what it takes at any
speed.

A leg and its reverse are one way: it is worked out from the place of the lower index.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from app.domain.geometry import distances
from app.domain.plane import Plane
from app.travel.corner_ways import CornerWays, padded
from app.travel.legs import Flown, Way
from app.travel.obstacles import Corners, Obstacles
from app.travel.sight import PAIRS_AT_ONCE, Sight, bends_around
from app.travel.straight import STILL_AIR, flown_straight, straight_lengths, way_along
from app.travel.wind import Wind

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
LastCorners = npt.NDArray[np.int32]

STRAIGHT, NONE = -1, -2
"""Instead of a leg's last corner: it has none, or there is no leg."""

_DETOURS_AT_ONCE = 1 << 13
"""Fewer than of straight legs: each has as many candidates as its destination sees corners."""


class LegsAroundZones:
    """Legs between P places, round zones.

    Parameters
    ----------
    crs
        As in :func:`app.domain.geometry.distance`.
    places
        (P, 2).
    zones
        At least one; of each its corners, (V, 2) with V at least 3, in either direction, no two sides
        crossing. Zones may overlap, touch and hold each other.
    wind
        It is still where nothing is given.

    Raises
    ------
    BeyondProjection
        If a place or a corner on the globe is too far from the middle of the bounding box.
    """

    def __init__(self, crs: str, places: Floats, zones: Sequence[Floats], wind: Wind = STILL_AIR) -> None:
        self.crs, self.places, self.wind = crs, places, wind
        zone_corners = np.concatenate(zones)
        plane = Plane.around(crs, np.concatenate([places, zone_corners]))
        obstacles = Obstacles.of([plane.flat(zone) for zone in zones])
        flat = plane.flat(places)
        self.corners = zone_corners[obstacles.corners.source]
        """(C, 2) where ways may turn, in the coordinates of the request."""
        self.inside = obstacles.hold(flat)
        """(P,) places that no leg leads to or from."""
        self._sight = Sight(obstacles, np.concatenate([flat, obstacles.corners.points]))
        between, self._access = self._pieces(flat, obstacles.corners)
        self._ways = CornerWays.among(between)
        self._near, self._near_length = padded(np.isfinite(self._access), self._access)
        self._reach, self._first = self._to_corners()

    def _pieces(self, flat: Floats, corners: Corners) -> tuple[Floats, Floats]:
        """Return lengths of pieces between corners, (C, C), and from places to corners, (P, C).

        They are infinite where there is no sight, or where no shortest way would turn.
        """
        turns = _turns(corners.points, corners)
        turns &= turns.T
        row, corner = np.nonzero(np.triu(turns, 1))
        free = self._sight.free(row + len(flat), corner + len(flat))
        between = np.full(turns.shape, np.inf)
        for one, other in ((row[free], corner[free]), (corner[free], row[free])):
            between[one, other] = distances(self.crs, self.corners, self.corners)[one, other]

        row, corner = np.nonzero(_turns(flat, corners) & ~self.inside[:, None])
        free = self._sight.free(row, corner + len(flat))
        access = np.full((len(flat), len(corners.points)), np.inf)
        row, corner = row[free], corner[free]
        access[row, corner] = distances(self.crs, self.places, self.corners)[row, corner]
        return between, access

    def _to_corners(self) -> tuple[Floats, Integers]:
        """Return the length of the shortest way from every place to every corner, and its first corner."""
        reach = np.full((len(self.places), len(self.corners)), np.inf)
        first = np.zeros(reach.shape, dtype=np.int64)
        if len(self.corners):
            for place, (near, length) in enumerate(zip(self._near, self._near_length, strict=True)):
                ways = length[:, None] + self._ways.length[near]
                best = ways.argmin(axis=0)
                first[place] = near[best]
                reach[place] = np.take_along_axis(ways, best[None], axis=0)[0]
        return reach, first

    def between(self, origins: Integers, destinations: Integers) -> BlockAroundZones:
        """Return a block of legs; see :meth:`app.travel.legs.Legs.between`."""
        ground = straight_lengths(self.crs, self.places, origins, destinations)
        shape = ground.shape
        a, b = (np.ravel(ends) for ends in np.broadcast_arrays(origins, destinations))
        last = np.full(a.shape, STRAIGHT, dtype=np.int32)
        flat_ground = ground.reshape(-1)
        square = _is_square(origins, destinations)
        # Of a square the half below the diagonal is the other one, mirrored.
        asked = np.flatnonzero(np.triu(np.ones(shape, dtype=np.bool_))) if square else np.arange(len(a))
        for begin in range(0, len(asked), PAIRS_AT_ONCE):
            some = asked[begin : begin + PAIRS_AT_ONCE]
            low, high = np.minimum(a[some], b[some]), np.maximum(a[some], b[some])
            none = self.inside[low] | self.inside[high]
            hidden = np.flatnonzero(none | ~self._sight.free(low, high))
            some = some[hidden]
            flat_ground[some], last[some] = self._detours(low[hidden], high[hidden])
            if square:
                row, column = np.divmod(some, shape[1])
                mirrored = column * shape[1] + row
                flat_ground[mirrored], last[mirrored] = flat_ground[some], last[some]
        return BlockAroundZones(self, origins, destinations, ground, last.reshape(shape))

    def _detours(self, low: Integers, high: Integers) -> tuple[Floats, LastCorners]:
        """Return lengths of ways that are not straight, for Q pairs, and the last corner of each."""
        length = np.full(len(low), np.inf)
        last = np.full(len(low), NONE, dtype=np.int32)
        if not len(self.corners):
            return length, last
        reach, count = self._reach.reshape(-1), len(self.corners)
        for begin in range(0, len(low), _DETOURS_AT_ONCE):
            some = slice(begin, begin + _DETOURS_AT_ONCE)
            near = self._near[high[some]]
            ways = reach[low[some, None] * count + near] + self._near_length[high[some]]
            best = ways.argmin(axis=1)[:, None]
            length[some] = np.take_along_axis(ways, best, axis=1)[:, 0]
            last[some] = np.take_along_axis(near, best, axis=1)[:, 0]
        last[np.isinf(length)] = NONE
        return length, last

    def way(self, origin: int, destination: int, speed: float) -> Way | None:
        """Return the way of one leg; see :meth:`app.travel.legs.Legs.way`."""
        low, high = min(origin, destination), max(origin, destination)
        last = int(self.between(np.array([low]), np.array([high])).last[0])
        if last == NONE:
            return None
        points = [self.places[low], self.places[high]]
        if last != STRAIGHT:
            turns = self._ways.between(int(self._first[low, last]), last)
            points[1:1] = [self.corners[k] for k in turns]
        if origin > destination:
            points.reverse()
        return way_along(self.crs, np.stack(points), self.wind, speed)

    def corner_times(self, speed: float) -> CornerTimes:
        """Return what the ways to and from corners take at a speed."""
        places, corners = self.places[:, None], self.corners
        access, rows = self._access, np.arange(len(self.places))[:, None]
        between = np.where(np.isfinite(self._ways.length), distances(self.crs, corners, corners), np.inf)
        there = flown_straight(self.crs, self.wind, speed, access, places, corners).time
        back = flown_straight(self.crs, self.wind, speed, access, corners, places).time
        pieces = flown_straight(self.crs, self.wind, speed, between, corners[:, None], corners).time
        every = np.arange(len(corners))
        return CornerTimes(
            out=there[rows, self._first] + self._ways.sums(pieces)[self._first, every],
            home=back[rows, self._first] + self._ways.sums(pieces.T)[self._first, every],
            there=there,
            back=back,
        )


@dataclass(frozen=True, slots=True)
class CornerTimes:
    """Times between P places and C corners at one speed, each (P, C); infinite where the wind forbids it.

    Attributes
    ----------
    out, home
        Along the shortest way from a place to a corner, and along the same way back.
    there, back
        Of the straight pieces alone, where there is one.
    """

    out: Floats
    home: Floats
    there: Floats
    back: Floats


@dataclass(frozen=True, slots=True)
class BlockAroundZones:
    """A block of legs round zones.

    Attributes
    ----------
    last
        In the shape of the block: the last corner on the way, seen from the place of the lower index;
        :data:`STRAIGHT` or :data:`NONE` where there is none.
    """

    legs: LegsAroundZones
    origins: Integers
    destinations: Integers
    ground: Floats = field(repr=False)
    last: LastCorners = field(repr=False)

    def flown(self, speed: float) -> Flown:
        """Return air lengths and times; see :meth:`app.travel.legs.LegBlock.flown`."""
        legs = self.legs
        a, b = legs.places[self.origins], legs.places[self.destinations]
        straight = flown_straight(legs.crs, legs.wind, speed, self.ground, a, b)
        if legs.wind.speed == 0.0:
            return straight
        time = np.where(self.last == NONE, np.inf, straight.time)
        turned = np.nonzero(self.last >= 0)
        if len(turned[0]):
            at = legs.corner_times(speed)
            corner = self.last[turned]
            start, end = (ends[turned] for ends in np.broadcast_arrays(self.origins, self.destinations))
            time[turned] = np.where(
                start < end,
                at.out[start, corner] + at.back[end, corner],
                at.home[end, corner] + at.there[start, corner],
            )
        return Flown(time * speed, time)


def _turns(points: Floats, corners: Corners) -> Flags:
    """Return at which corners a shortest way from each of Q points may turn, (Q, C)."""
    along = corners.neighbours - corners.points[:, None]
    turns = np.empty((len(points), len(corners.points)), dtype=np.bool_)
    for begin in range(0, len(points), 256):
        some = slice(begin, begin + 256)
        turns[some] = bends_around(corners.points - points[some, None], along)
    return turns


def _is_square(origins: Integers, destinations: Integers) -> bool:
    """Return whether a block is that of some places among themselves."""
    return (
        origins.ndim == 2
        and origins.shape[1] == 1
        and destinations.ndim == 1
        and np.array_equal(origins[:, 0], destinations)
    )
