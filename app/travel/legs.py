"""What the room answers: legs between places, and the way of one of them.

Which legs are asked for is up to the caller: a thousand UAVs and two thousand targets are nine million pairs
of places, and half of them are never flown. A problem's places are prepared once
(:func:`app.travel.choice.legs_between`), and ``between`` then works out a block of legs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class Flown(NamedTuple):
    """Air length and time of a block of legs for one speed; both infinite where a leg does not exist."""

    air: Floats
    time: Floats


class LegBlock(Protocol):
    """A block of legs.

    Attributes
    ----------
    ground
        Lengths over ground, in the shape that the block was asked for; infinite where there is no way.
    """

    @property
    def ground(self) -> Floats:
        """Lengths over ground; infinite where there is no way."""
        ...

    def flown(self, speed: float) -> Flown:
        """Return air lengths and times for UAVs of a speed above 0, in the shape of :attr:`ground`.

        A leg that the wind forbids has a length over ground, but no air length and no time.
        """
        ...


@dataclass(frozen=True, slots=True)
class Way:
    """The way of one leg, in W straight pieces; on the globe they are arcs of great circles.

    Attributes
    ----------
    points
        (W + 1, 2) where pieces begin and end, in the coordinates of the request.
    ground, air, time
        (W,) of each piece.
    """

    points: Floats
    ground: Floats
    air: Floats
    time: Floats


class Legs(Protocol):
    """Legs between the P places of a problem."""

    def between(self, origins: Integers, destinations: Integers) -> LegBlock:
        """Return the legs from places to others.

        Parameters
        ----------
        origins, destinations
            Indices of places, broadcast against each other: ``between(a[:, None], b)`` are the legs from all
            of `a` to all of `b`, ``between(a, b)`` those from each to its partner.
        """
        ...

    def way(self, origin: int, destination: int, speed: float) -> Way | None:
        """Return the way from a place to another for a UAV of a speed above 0.

        None is returned where there is no way, or the wind is too strong for a piece of it.
        """
        ...
