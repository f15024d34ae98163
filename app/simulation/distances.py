"""Distances between many points, compiled: the largest requests have eight million of them.

They are those of :mod:`app.domain.geometry` to the last digits, at a tenth of its time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from app.domain.geometry import EARTH_RADIUS_KM, eastward, parallel
from app.simulation.compilation import njit

Floats = npt.NDArray[np.float64]
Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy"}
_compiled: Callable[[Function], Function] = njit(**_OPTIONS)
_eastward, _parallel = _compiled(eastward), _compiled(parallel)

_TINY = 1e-140
"""Below it the square of a distance loses digits, or is 0."""

_SHORT_CHORD, _LONG_CHORD = 1e-5, 1.9999
"""Of the unit sphere; between them the chord gives the angle to ten digits and more."""


def between_points(crs: str, a: Floats, b: Floats) -> Floats:
    """All distances from points `a` to points `b`.

    Parameters
    ----------
    crs
        As in :func:`app.domain.geometry.distance`.
    a, b
        Points, shapes (A, 2) and (B, 2).

    Returns
    -------
    ndarray
        Shape (A, B).
    """
    out = np.empty((len(a), len(b)))
    if crs == "local":
        _planar(a, np.ascontiguousarray(b.T), out)
    else:
        _great_circles(a, b, _on_sphere(a), _on_sphere(b), a is b, out)
    return out


def _on_sphere(points: Floats) -> Floats:
    """Unit vectors of points given in degrees, (P, 3)."""
    longitude, latitude = np.radians(points[:, 0]), np.radians(points[:, 1])
    cosine = np.cos(latitude)
    return np.stack([cosine * np.cos(longitude), cosine * np.sin(longitude), np.sin(latitude)], axis=1)


@_compiled
def _planar(a: Floats, b: Floats, out: Floats) -> None:
    """Fill `out`, (A, B), with Euclidean distances; `b` is (2, B), so that the inner loop runs in lanes."""
    for i in range(out.shape[0]):
        x, y = a[i, 0], a[i, 1]
        row = out[i]
        for j in range(out.shape[1]):
            dx, dy = x - b[0, j], y - b[1, j]
            row[j] = math.sqrt(dx * dx + dy * dy)
        for j in range(out.shape[1]):
            if row[j] < _TINY:
                row[j] = math.hypot(x - b[0, j], y - b[1, j])


@_compiled
def _great_circles(
    a: Floats, b: Floats, unit_a: Floats, unit_b: Floats, symmetric: bool, out: Floats
) -> None:
    """Fill `out`, (A, B), by chords; by haversines where a chord is too short or too long for it."""
    for i in range(out.shape[0]):
        for j in range(i if symmetric else 0, out.shape[1]):
            dx, dy, dz = unit_a[i, 0] - unit_b[j, 0], unit_a[i, 1] - unit_b[j, 1], unit_a[i, 2] - unit_b[j, 2]
            chord = math.sqrt(dx * dx + dy * dy + dz * dz)
            if _SHORT_CHORD < chord < _LONG_CHORD:
                angle = 2 * math.asin(chord / 2)
            else:
                latitude_a, latitude_b = math.radians(a[i, 1]), math.radians(b[j, 1])
                across = math.sin(math.radians(_eastward(a[i, 0], b[j, 0])) / 2)
                h = (
                    math.sin((latitude_b - latitude_a) / 2) ** 2
                    + _parallel(a[i, 1]) * _parallel(b[j, 1]) * across**2
                )
                angle = 2 * math.asin(min(1.0, math.sqrt(h)))
            out[i, j] = EARTH_RADIUS_KM * angle
            if symmetric:
                out[j, i] = out[i, j]
