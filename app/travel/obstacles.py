"""The union of the zones: what no way may pass through, and the corners that ways turn at.

A way may touch the border of the union, and doubles do not say exactly what touches what. So a way is held
against the union *narrowed* by :data:`TOLERANCE`, whose border no way has a reason to touch: what goes less
deep into a zone than that counts as touching it. Before, corners are rounded to a grid that is finer than the
tolerance, so that what touches in the request, up to rounding, touches exactly.

Where zones touch at one point the union does not hold that point inside, and still no way leads between them.
Such a point is a :class:`Contact`.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Point = tuple[float, float]

TOLERANCE = 1e-9
"""Depth to which a way may go into a zone, in sizes of the problem's bounding box (0.1 mm of 100 km)."""

_GRID = 2.0**-33
"""Distance between the points that corners are rounded to, in the same unit: an eighth of the tolerance."""

_MITRE = 4.0
"""Where a corner points into a zone: farthest that the narrowed border is from it, in tolerances."""

_EDGES = 16
"""Most edges of one outline."""

_SHARPEST = 1e-3
"""Half of the angle, in radians, below which a solid sector at a contact counts as one of that angle."""


@dataclass(frozen=True, slots=True)
class Outline:
    """A stretch of the border of the narrowed union.

    Attributes
    ----------
    points
        (V, 2) in order; an edge leads from each to the next.
    centre, radius
        A circle around all of it.
    """

    points: Floats
    centre: Point
    radius: float


@dataclass(frozen=True, slots=True)
class Contact:
    """A point at which parts of the union touch, so that a way has to stay on its side.

    Attributes
    ----------
    point
        Where.
    walls
        Ascending angles, in radians, in the middle of each part that meets here: what lies between two of
        them is one side.
    radius
        A way that passes nearer than that passes here: the narrowed union leaves a gap of that size.
    """

    point: Point
    walls: Floats
    radius: float


@dataclass(frozen=True, slots=True)
class Corners:
    """The C corners of the union at which a shortest way may turn: more than 180 degrees of them are free.

    Attributes
    ----------
    points
        (C, 2).
    neighbours
        (C, 2, 2) the next corners on the border, on either side of the free angle.
    source
        (C,) index of the corner of a zone that each is.
    """

    points: Floats
    neighbours: Floats
    source: Integers


@dataclass(frozen=True, slots=True)
class Obstacles:
    """The union of the zones of a problem, in its plane."""

    narrowed: BaseGeometry
    outlines: tuple[Outline, ...]
    corners: Corners
    contacts: tuple[Contact, ...]

    @classmethod
    def of(cls, zones: Sequence[Floats]) -> Obstacles:
        """Return the union of some zones.

        Parameters
        ----------
        zones
            Of each its corners in the plane, (V, 2) with V at least 3, in either direction.
        """
        on_grid = [np.rint(zone / _GRID) * _GRID for zone in zones]
        solid = shapely.make_valid(
            [Polygon(zone) for zone in on_grid], method="structure", keep_collapsed=False
        )
        union = shapely.orient_polygons(shapely.union_all(solid, grid_size=_GRID))
        narrowed = shapely.buffer(union, -TOLERANCE, join_style="mitre", mitre_limit=_MITRE)
        shapely.prepare(narrowed)
        sectors = _sectors(union)
        return cls(
            narrowed=narrowed,
            outlines=tuple(outline for part in _polygons(narrowed) for outline in _outlines(part)),
            corners=_corners(sectors, on_grid),
            contacts=tuple(_contact(point, around) for point, around in sectors.items() if len(around) > 1),
        )

    def hold(self, points: Floats) -> Flags:
        """Return which points, (P, 2), lie inside; those on the border do not."""
        return np.asarray(shapely.contains_xy(self.narrowed, points[:, 0], points[:, 1]))


def _polygons(area: BaseGeometry) -> list[Polygon]:
    return [part for part in shapely.get_parts(area) if isinstance(part, Polygon) and not part.is_empty]


def _outlines(part: Polygon) -> Iterator[Outline]:
    for ring in (part.exterior, *part.interiors):
        points = shapely.get_coordinates(ring)
        # Of a long border only what is near a way is held against it.
        for begin in range(0, len(points) - 1, _EDGES):
            stretch = points[begin : begin + _EDGES + 1]
            low, high = stretch.min(axis=0), stretch.max(axis=0)
            x, y = ((low + high) / 2).tolist()
            yield Outline(stretch, (x, y), float(np.hypot(*(high - low))) / 2)


@dataclass(frozen=True, slots=True)
class _Sector:
    """A solid angle at a corner, counter-clockwise from the border's next corner to the one before."""

    after: Point
    before: Point
    begin: float
    width: float


def _sectors(union: BaseGeometry) -> dict[Point, list[_Sector]]:
    """Return the solid sectors at every corner of the union, by the angle at which they begin."""
    sectors: defaultdict[Point, list[_Sector]] = defaultdict(list)
    for part in _polygons(union):
        # Along every ring the solid side is to the left.
        for ring in (part.exterior, *part.interiors):
            points = [(x, y) for x, y in shapely.get_coordinates(ring)[:-1].tolist()]
            for k, point in enumerate(points):
                before, after = points[k - 1], points[(k + 1) % len(points)]
                begin, end = _angle(point, after), _angle(point, before)
                sectors[point].append(_Sector(after, before, begin, (end - begin) % math.tau))
    return {point: sorted(around, key=lambda s: s.begin) for point, around in sectors.items()}


def _angle(start: Point, end: Point) -> float:
    return math.atan2(end[1] - start[1], end[0] - start[0])


def _corners(sectors: dict[Point, list[_Sector]], zones: Sequence[Floats]) -> Corners:
    source: dict[Point, int] = {}
    for k, (x, y) in enumerate(np.concatenate(zones).tolist()):
        source.setdefault((x, y), k)
    found: list[tuple[Point, tuple[Point, Point], int]] = []
    for point, around in sectors.items():
        # Where borders of zones cross, the union has no corner that a way could turn at, but for rounding.
        if point not in source:
            continue
        for k, sector in enumerate(around):
            left, right = sector.before, around[(k + 1) % len(around)].after
            if _turn(point, left, right) < 0:
                found.append((point, (left, right), source[point]))
    return Corners(
        points=np.array([point for point, _, _ in found]).reshape(-1, 2),
        neighbours=np.array([sides for _, sides, _ in found]).reshape(-1, 2, 2),
        source=np.array([k for _, _, k in found], dtype=np.int64),
    )


def _turn(point: Point, left: Point, right: Point) -> float:
    return (left[0] - point[0]) * (right[1] - point[1]) - (left[1] - point[1]) * (right[0] - point[0])


def _contact(point: Point, around: list[_Sector]) -> Contact:
    middles = [sector.begin + sector.width / 2 for sector in around]
    sharpest = max(_SHARPEST, min(sector.width for sector in around) / 2)
    return Contact(
        point=point,
        walls=np.sort([(middle + math.pi) % math.tau - math.pi for middle in middles]),
        radius=2 * TOLERANCE / math.sin(min(sharpest, math.pi / 2)),
    )
