"""Which way a straight leg sets out: on the globe the initial bearing of the great circle."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def heading(crs: str, a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Return the share of east and the share of north of the directions from points to others.

    Parameters
    ----------
    crs
        As in :func:`app.domain.geometry.distance`.
    a, b
        Points, (..., 2), broadcast against each other.

    Returns
    -------
    east, north
        Sine and cosine of the bearing, which is clockwise from north; due north where both are one place.
    """
    if crs == "local":
        east, north = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    else:
        across = b[..., 0] - a[..., 0]
        across = np.radians(np.where(np.abs(across) > 180.0, across - np.copysign(360.0, across), across))
        parallel_b = np.where(np.abs(b[..., 1]) == 90.0, 0.0, np.cos(np.radians(b[..., 1])))
        east = np.sin(across) * parallel_b
        # cos a sin b - sin a cos b cos(across), written so that nothing cancels where the points are near.
        north = np.sin(np.radians(b[..., 1] - a[..., 1])) + 2 * np.sin(np.radians(a[..., 1])) * parallel_b * (
            np.sin(across / 2) ** 2
        )
    size = np.hypot(east, north)
    nowhere = size == 0.0
    size = np.where(nowhere, 1.0, size)
    return np.asarray(east / size), np.asarray(np.where(nowhere, 1.0, north / size))
