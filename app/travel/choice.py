"""Which kind of legs the places of a problem have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from app.travel.around_zones import LegsAroundZones
from app.travel.legs import Legs
from app.travel.straight import STILL_AIR, StraightLegs
from app.travel.wind import Wind

Floats = npt.NDArray[np.float64]


def legs_between(crs: str, places: Floats, zones: Sequence[Floats] = (), wind: Wind | None = None) -> Legs:
    """Return the legs between places, over open ground or round zones.

    Legs that a client gives as matrices are :class:`app.travel.matrices.MatrixLegs`, one for each profile.

    Parameters
    ----------
    crs
        As in :func:`app.domain.geometry.distance`.
    places
        Positions of UAVs, starting points, targets and bases, (P, 2).
    zones
        Of each no-fly zone its corners, (V, 2); see :class:`app.travel.around_zones.LegsAroundZones`.
    wind
        None where the air is still.

    Raises
    ------
    BeyondProjection
        If there are zones, and a place or a corner on the globe is too far from the middle of the bounding
        box.
    """
    air = STILL_AIR if wind is None else wind
    if len(zones):
        return LegsAroundZones(crs, places, zones, air)
    return StraightLegs(crs, places, air)
