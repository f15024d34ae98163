"""Rules of no-fly zones: polygons with an area, whose sides do not cross; on a globe all near enough."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from app.domain.plane import BeyondProjection, Plane
from app.domain.said import Said, said
from app.domain.world_fields import FEWEST_CORNERS

if TYPE_CHECKING:
    from app.domain.problem import Problem

Floats = npt.NDArray[np.float64]
Rules = Iterator[tuple[str, str]]

_TOUCHING = 1e-9
"""Sizes of a zone that a side may go beyond another one and still only touches it."""

_FLAT = 1e-12
"""Area below which a zone has none, in squares of its size."""

_SIDES_AT_ONCE = 256
"""That are held against all others; bounds the memory of a zone of very many."""


def broken_rules_of_zones(problem: Problem) -> Rules:
    """Yield every rule of zones that a problem breaks.

    On the globe sides are arcs of great circles, which are straight on the plane of the problem.
    """
    if not problem.no_fly_zones:
        return
    zones = [zone.polygon for zone in problem.no_fly_zones]
    if not all(len(zone) >= FEWEST_CORNERS and all(len(corner) == 2 for corner in zone) for zone in zones):
        return
    places = [
        *((f"/uavs/{i}/x_s", uav.x_s, uav.y_s) for i, uav in enumerate(problem.uavs)),
        *((f"/uavs/{i}/x_c", uav.x_c, uav.y_c) for i, uav in enumerate(problem.uavs)),
        *((f"/targets/{j}/x", target.x, target.y) for j, target in enumerate(problem.targets)),
        *((f"/bases/{d}/x", base.x, base.y) for d, base in enumerate(problem.bases)),
        *(
            (f"/no_fly_zones/{z}/polygon/{c}", *corner)
            for z, zone in enumerate(zones)
            for c, corner in enumerate(zone)
        ),
    ]
    points = np.array([(x, y) for _, x, y in places], dtype=np.float64)
    if not np.isfinite(points).all():
        return
    try:
        plane = Plane.around(problem.crs, points)
    except BeyondProjection as error:
        yield places[error.index][0], error.detail
        return
    for z, zone in enumerate(zones):
        flat = plane.flat(np.array(zone, dtype=np.float64))
        for at, detail in _faults(flat, zone):
            yield f"/no_fly_zones/{z}/polygon{at}", detail


def _faults(flat: Floats, corners: tuple[tuple[float, float], ...]) -> Rules:
    """Yield that a polygon has no area, or the first two of its sides that cross.

    Parameters
    ----------
    flat
        Its corners on the plane, (V, 2).
    corners
        The same in the coordinates of the request.
    """
    size = float(np.hypot(*np.ptp(flat, axis=0)))
    around = flat - flat[0]
    after = np.roll(around, -1, axis=0)
    crossing = _first_crossing(around, after, _TOUCHING * size)
    if crossing is not None:
        a, b, c, d = (_written(corners[(side + end) % len(corners)]) for side in crossing for end in (0, 1))
        detail = said("the side from {a} to {b} crosses that from {c} to {d}", a=a, b=b, c=c, d=d)
        yield f"/{crossing[0]}", detail
    elif abs(float(_cross(around, after).sum())) / 2 <= _FLAT * size**2:
        yield "", said("has no area")


def _first_crossing(begin: Floats, end: Floats, touching: float) -> tuple[int, int] | None:
    """Return the first two sides that cross, and do not only touch; (V, 2) where each begins and ends."""
    along = end - begin
    length = np.hypot(along[:, 0], along[:, 1])
    count = len(begin)
    for first in range(0, count, _SIDES_AT_ONCE):
        some = slice(first, first + _SIDES_AT_ONCE)
        # How far to the left of each of some sides the ends of all others are, and the other way round.
        crosses = _parted(begin[some, None], along[some, None], length[some, None], begin, end, touching)
        crosses &= _parted(begin, along, length, begin[some, None], end[some, None], touching)
        found = np.argwhere(crosses)
        if len(found):
            return first + int(found[0, 0]), int(found[0, 1])
    return None


def _parted(
    origin: Floats, along: Floats, length: Floats, one: Floats, other: Floats, by: float
) -> npt.NDArray[np.bool_]:
    """Return whether two points lie on different sides of a line, each farther from it than `by`."""
    a, b = _cross(along, one - origin), _cross(along, other - origin)
    return np.asarray((np.minimum(a, b) < -by * length) & (np.maximum(a, b) > by * length))


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _written(corner: tuple[float, float]) -> Said:
    return said("({x}, {y})", x=corner[0], y=corner[1])
