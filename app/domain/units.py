"""Units of a problem's numbers, each in the words of a plane and of the globe."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit, which depends on where positions are.

    Attributes
    ----------
    local
        Its name where positions are on a plane.
    wgs84
        Its name where they are degrees of longitude and latitude.
    """

    local: str
    wgs84: str

    def __str__(self) -> str:
        return f"{self.local}, or {self.wgs84}"


@dataclass(frozen=True, slots=True)
class Axis(Unit):
    """One of the two numbers of a position, in the words of a plane and of the globe.

    Attributes
    ----------
    degrees
        The most that it is on the globe, in either direction.
    """

    degrees: float


X = Axis("x", "longitude in degrees", 180.0)
Y = Axis("y", "latitude in degrees", 90.0)
PLACE = Unit("distance units", "degrees")
DISTANCE = Unit("distance units", "km")
SPEED = Unit("distance units per time unit", "km/h")
TIME = Unit("time units", "h")
