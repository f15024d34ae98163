"""Distances in the two coordinate reference systems: planar, and great circle on a sphere."""

from __future__ import annotations

import math

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
        + math.cos(latitude_a) * math.cos(latitude_b) * math.sin(math.radians(x_b - x_a) / 2) ** 2
    )
    return 2 * EARTH_RADIUS_KM * math.asin(min(1.0, math.sqrt(h)))


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
    h = (
        np.sin((latitude_b - latitude_a) / 2) ** 2
        + np.cos(latitude_a) * np.cos(latitude_b) * np.sin(np.radians(x_b - x_a) / 2) ** 2
    )
    return np.asarray(2 * EARTH_RADIUS_KM * np.arcsin(np.minimum(1.0, np.sqrt(h))))
