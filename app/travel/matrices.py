"""Legs that a client gives as matrices: of roads, of a planner of its own, of measured flights."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from app.travel.legs import Flown

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class MatrixLegs:
    """Legs of one profile between P places.

    They have no way: where a UAV is between two places is not known.

    Attributes
    ----------
    locations
        (P,) row of each place.
    distance
        (R, R) length from a row's location to a column's, over ground and in the air; infinite where there is
        no leg. It need not be symmetric.
    duration
        (R, R) time, where it does not follow from the speed; infinite where there is no leg.
    """

    locations: Integers
    distance: Floats
    duration: Floats | None = None

    def between(self, origins: Integers, destinations: Integers) -> MatrixBlock:
        """Return a block of legs; see :meth:`app.travel.legs.Legs.between`."""
        rows, columns = self.locations[origins], self.locations[destinations]
        ground = self.distance[rows, columns]
        if self.duration is None:
            return MatrixBlock(ground, None)
        duration = self.duration[rows, columns]
        missing = np.isinf(ground) | np.isinf(duration)
        return MatrixBlock(np.where(missing, np.inf, ground), np.where(missing, np.inf, duration))


@dataclass(frozen=True, slots=True)
class MatrixBlock:
    """A block of legs of one profile; `duration` is None where times follow from the speed."""

    ground: Floats = field(repr=False)
    duration: Floats | None = field(repr=False)

    def flown(self, speed: float) -> Flown:
        """Return air lengths and times; see :meth:`app.travel.legs.LegBlock.flown`."""
        return Flown(self.ground, self.ground / speed if self.duration is None else self.duration)
