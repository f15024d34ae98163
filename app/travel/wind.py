"""Wind: how long a straight leg takes in air that moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Wind:
    """A wind that is the same everywhere.

    Attributes
    ----------
    speed
        In the unit of the UAVs' speed, at least 0.
    towards
        Where it blows to, in degrees clockwise from north (+y).
    """

    speed: float
    towards: float

    def time(self, speed: float, length: Floats, east: Floats, north: Floats) -> Floats:
        """Return how long straight legs take.

        A UAV steers into the wind as much as is needed to stay on its line: with the wind's part along the
        line c and across it x, it goes c + sqrt(speed² - x²) over ground.

        Parameters
        ----------
        speed
            Of the UAV through the air, above 0.
        length
            (...) over ground.
        east, north
            (...) of the legs' headings, as :func:`app.travel.headings.heading` gives them.

        Returns
        -------
        ndarray
            (...); infinite where the wind is too strong for the leg, 0 for a leg of length 0.
        """
        if self.speed == 0.0:
            return length / speed
        towards = math.radians(self.towards)
        to_east, to_north = self.speed * math.sin(towards), self.speed * math.cos(towards)
        along = to_east * east + to_north * north
        across = np.abs(to_east * north - to_north * east)
        with np.errstate(divide="ignore", invalid="ignore"):
            steady = np.sqrt((speed - across) * (speed + across))
            # Against the wind the same sum, without the difference of two near numbers.
            against = (speed - self.speed) * (speed + self.speed) / (steady - along)
            over_ground = np.where(along < 0.0, against, along + steady)
            flies = (across < speed) & (over_ground > 0.0)
            time = np.where(flies, length / over_ground, np.inf)
        return np.asarray(np.where(length == 0.0, 0.0, time))
