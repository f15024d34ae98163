"""A plane of size 1 in which the ways of a problem are straight lines.

On the globe it is the gnomonic projection: every great circle is a straight line there, and so is every side
of a zone. It is good for half of the globe and grows without limit towards its rim, so places have to lie
within :data:`WIDEST` degrees of its centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.domain.geometry import eastward, longitude_stretch
from app.domain.said import said

Floats = npt.NDArray[np.float64]

WIDEST = 60.0
"""Degrees from the centre to the farthest place."""

_ROUNDING = 1e-9
"""Degrees that a place at the limit may seem to be beyond it."""


class BeyondProjection(ValueError):
    """A place is too far from the middle of the bounding box for ways round zones.

    Parameters
    ----------
    detail
        How far it is, and how far it may be.
    index
        Which of the points it is.
    """

    def __init__(self, detail: str, index: int) -> None:
        super().__init__(detail)
        self.detail = detail
        self.index = index


@dataclass(frozen=True, slots=True)
class Plane:
    """The plane of one problem.

    Attributes
    ----------
    crs
        As in :func:`app.domain.geometry.distance`.
    centre
        Middle of the bounding box of all places and corners; on the globe longitude and latitude.
    scale
        Of the plane's unit, a power of two, so that scaling rounds nothing: the longer side of the bounding
        box becomes 1/2 to 1.
    """

    crs: str
    centre: tuple[float, float]
    scale: float

    @classmethod
    def around(cls, crs: str, points: Floats) -> Plane:
        """Return the plane of some points.

        Parameters
        ----------
        crs
            As in :func:`app.domain.geometry.distance`.
        points
            All places and corners of zones, (P, 2), at least one.

        Raises
        ------
        BeyondProjection
            If a point on the globe is more than :data:`WIDEST` degrees from their middle.
        """
        xs, ys = points[:, 0], points[:, 1]
        west, east = float(xs.min()), float(xs.max())
        if crs != "local":
            west, east = longitude_stretch(xs.tolist())
            east += 360.0 if east < west else 0.0
        south, north = float(ys.min()), float(ys.max())
        unscaled = cls(crs, (west + (east - west) / 2, south + (north - south) / 2), 1.0)
        flat = unscaled.flat(points)
        extent = float(np.ptp(flat, axis=0).max())
        # A scene smaller than that is one place.
        exponent = math.frexp(extent)[1] if extent > 1e-290 else 0
        return cls(crs, unscaled.centre, math.ldexp(1.0, -exponent))

    def flat(self, points: Floats) -> Floats:
        """Return where points lie in the plane, (P, 2).

        Parameters
        ----------
        points
            As in the request, (P, 2).

        Raises
        ------
        BeyondProjection
            If a point on the globe is more than :data:`WIDEST` degrees from the centre.
        """
        x_0, y_0 = self.centre
        if self.crs == "local":
            return np.asarray((points - np.array([x_0, y_0])) * self.scale)
        east = np.radians([eastward(x_0, x) for x in points[:, 0].tolist()])
        latitude, latitude_0 = np.radians(points[:, 1]), math.radians(y_0)
        cosine = np.cos(latitude)
        # Written so that nothing cancels where everything is within a few metres.
        bulge = 2 * np.sin(east / 2) ** 2
        up = np.cos(np.radians(points[:, 1] - y_0)) - math.cos(latitude_0) * cosine * bulge
        farthest = float(np.degrees(np.arccos(np.clip(up.min(), -1.0, 1.0))))
        if farthest > WIDEST + _ROUNDING:
            raise BeyondProjection(
                said(
                    "a place is {far:.3f} degrees from the middle of the bounding box ({x:.6g}, {y:.6g}); "
                    "with zones all lie within {most:g} degrees",
                    far=round(farthest, 3),
                    x=x_0,
                    y=y_0,
                    most=WIDEST,
                ),
                int(up.argmin()),
            )
        right = cosine * np.sin(east)
        ahead = np.sin(np.radians(points[:, 1] - y_0)) + math.sin(latitude_0) * cosine * bulge
        return np.stack([right / up, ahead / up], axis=1) * self.scale
