"""Distances in the two coordinate reference systems: planar, and great circle on a sphere.

A place on the sphere has several spellings: the meridian opposite to Greenwich is 180 and -180, and a pole
has every longitude. Between two spellings of one place the distance is exactly 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

EARTH_RADIUS_KM = 6371.0088
"""Mean radius of the Earth (IUGG), in km."""

Floats = npt.NDArray[np.float64]


def distance(crs: str, x_a: float, y_a: float, x_b: float, y_b: float) -> float:
    """Distance between two points.

    Parameters
    ----------
    crs
        ``"local"``: x, y on a plane. ``"wgs84"``: x longitude, y latitude, in degrees.
    x_a, y_a, x_b, y_b
        The points.

    Returns
    -------
    float
        In the unit of the coordinates, or in km.
    """
    if crs == "local":
        return math.hypot(x_a - x_b, y_a - y_b)
    latitude_a, latitude_b = math.radians(y_a), math.radians(y_b)
    h = (
        math.sin((latitude_b - latitude_a) / 2) ** 2
        + parallel(y_a) * parallel(y_b) * math.sin(math.radians(eastward(x_a, x_b)) / 2) ** 2
    )
    return 2 * EARTH_RADIUS_KM * math.asin(min(1.0, math.sqrt(h)))


def eastward(x_a: float, x_b: float) -> float:
    """Degrees from longitude `x_a` to `x_b`, the shorter way: -180..180; 0 where they are one meridian."""
    east = x_b - x_a
    if abs(east) > 180.0:
        return east - math.copysign(360.0, east)
    return east


def parallel(y: float) -> float:
    """Radius of the circle of latitude `y`, in radii of the sphere: exactly 0 at the poles."""
    return 0.0 if abs(y) == 90.0 else math.cos(math.radians(y))


def longitude_stretch(longitudes: Sequence[float]) -> tuple[float, float]:
    """Find the shortest stretch of longitudes that holds all of some.

    Parameters
    ----------
    longitudes
        In degrees, -180..180, at least one.

    Returns
    -------
    west, east
        Its ends; ``west > east`` where it crosses the antimeridian.
    """
    west, east = min(longitudes), max(longitudes)
    widest = 360.0 - (east - west)
    # No gap inside is wider than the rest of the circle where all lie within half of it.
    if widest < 180.0:
        around = sorted(set(longitudes))
        for before, after in pairwise(around):
            if after - before > widest:
                widest, west, east = after - before, after, before
    return west, east


def unrolled(crs: str, xs: Floats) -> Floats:
    """Return x without the jump of longitudes at the antimeridian: those east of it become more than 180.

    Parameters
    ----------
    crs
        As in :func:`distance`; on a plane x stays as it is.
    xs
        Shape (P,).
    """
    if crs == "local":
        return xs
    west, _ = longitude_stretch(xs.tolist())
    return np.where(xs < west, xs + 360.0, xs)


def distances(crs: str, a: Floats, b: Floats) -> Floats:
    """All distances from points `a` to points `b`, as :func:`distance` measures them.

    Parameters
    ----------
    crs
        As in :func:`distance`.
    a, b
        Points, shapes (A, 2) and (B, 2).

    Returns
    -------
    ndarray
        Shape (A, B).
    """
    x_a, y_a = a[:, 0, None], a[:, 1, None]
    x_b, y_b = b[None, :, 0], b[None, :, 1]
    if crs == "local":
        return np.hypot(x_a - x_b, y_a - y_b)
    latitude_a, latitude_b = np.radians(y_a), np.radians(y_b)
    east = x_b - x_a
    east = np.where(np.abs(east) > 180.0, east - np.copysign(360.0, east), east)
    parallel_a, parallel_b = (np.where(np.abs(y) == 90.0, 0.0, np.cos(np.radians(y))) for y in (y_a, y_b))
    h = (
        np.sin((latitude_b - latitude_a) / 2) ** 2
        + parallel_a * parallel_b * np.sin(np.radians(east) / 2) ** 2
    )
    return np.asarray(2 * EARTH_RADIUS_KM * np.arcsin(np.minimum(1.0, np.sqrt(h))))
