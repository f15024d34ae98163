"""Flights: what a UAV does from one take-off to the next landing."""

from __future__ import annotations

from dataclasses import dataclass

from app.domain.problem import UAV, Target
from app.domain.surroundings import Base, NoFlyZone

AT_PLACE = 1e-9
"""Distances up to this are none: positions of the same place, written differently."""

Point = tuple[float, float]
Points = tuple[Point, ...]
"""Places flown over in turn, both ends among them."""


@dataclass(frozen=True, slots=True)
class FlownStop:
    """A visit: a stop of the answer, with its place.

    Attributes
    ----------
    target
        The rescue area as the problem has it.
    number
        Its place among the stops of the route, from 0.
    step
        Decision step, from 1.
    arrival_time
        In time units from now, or h.
    distance
        Of the leg to it.
    delivered
        Amounts unloaded, one a material.
    range_left
        On arrival, in distance units; what the UAV has flown before in this flight counts.
    begin_time, departure_time
        When the visit begins, which is after waiting, and when it has ended.
    endurance_left
        Time that the UAV may still be in the air, on departure; None where there is no limit.
    path
        The way to it.
    ground_speed
        Mean speed over ground on the way: in wind it is not the UAV's.
    """

    target: Target
    number: int
    step: int
    arrival_time: float
    distance: float
    delivered: tuple[float, ...]
    range_left: float
    begin_time: float
    departure_time: float
    endurance_left: float | None
    path: Points
    ground_speed: float

    @property
    def waiting(self) -> float:
        """Time from arrival until the visit begins."""
        return self.begin_time - self.arrival_time


@dataclass(frozen=True, slots=True)
class FlownLanding:
    """The end of a flight.

    Attributes
    ----------
    base
        Where it is; None: the UAV's starting point.
    place
        Its position.
    time
        When the UAV is there, in time units from now, or h; None where it need not return, and how long it
        would fly is not known.
    distance
        Of the leg to it.
    range_left, endurance_left
        After that leg, as of a visit; the latter None, too, where the time is not known.
    path
        The way to it; only the place where it begins where the way is not known.
    ground_speed
        As of a visit.
    """

    base: Base | None
    place: Point
    time: float | None
    distance: float
    range_left: float
    endurance_left: float | None
    path: Points
    ground_speed: float


@dataclass(frozen=True, slots=True)
class FlownReload(FlownLanding):
    """A landing after which the UAV flies on.

    Attributes
    ----------
    base
        Where it is.
    number, step
        As of a visit.
    loaded
        Amounts taken up, one a material; a negative one is left at the base.
    departure_time
        When the UAV may take off again.
    """

    base: Base
    number: int
    step: int
    loaded: tuple[float, ...]
    departure_time: float


@dataclass(frozen=True, slots=True)
class Flight:
    """One flight of a UAV.

    Attributes
    ----------
    route
        The UAV's place in the swarm, from 0.
    uav
        As the problem has it.
    number
        From 1, in the UAV's route. A reload before it has moved at all ends no flight.
    origin
        The base where it begins; None: where the UAV is now.
    ready_time
        When it may begin.
    loaded, aboard
        Amounts taken up before it, and aboard when it begins, one a material.
    stops
        Its visits, in order.
    landing
        Its end.
    zones
        What it must not fly through.
    """

    route: int
    uav: UAV
    number: int
    origin: Base | None
    ready_time: float
    loaded: tuple[float, ...]
    aboard: tuple[float, ...]
    stops: tuple[FlownStop, ...]
    landing: FlownLanding
    zones: tuple[NoFlyZone, ...]

    @property
    def flies(self) -> bool:
        """Whether the UAV moves at all."""
        return bool(self.stops) or self.landing.distance > AT_PLACE

    @property
    def place(self) -> Point:
        """Where it begins."""
        return (self.uav.x_c, self.uav.y_c) if self.origin is None else (self.origin.x, self.origin.y)

    @property
    def launch(self) -> Point:
        """Where the UAV has taken off, or does."""
        return (self.uav.x_s, self.uav.y_s) if self.origin is None else (self.origin.x, self.origin.y)

    @property
    def returns_to_launch(self) -> bool:
        """Whether it ends where it has begun."""
        return self.landing.place == self.launch

    @property
    def takes_off(self) -> bool:
        """Whether it begins with a take-off; otherwise the UAV is on its way already."""
        uav = self.uav
        still = uav.dis <= AT_PLACE and uav.airborne == 0.0
        at_start = (uav.x_c, uav.y_c) == (uav.x_s, uav.y_s) and uav.home_location in (None, uav.location)
        return self.origin is not None or (still and at_start)

    @property
    def waiting_on_ground(self) -> float:
        """Time that the UAV waits for its first visit before it takes off."""
        begins_on_ground = self.origin is not None or self.uav.begins_on_ground
        return self.stops[0].waiting if self.stops and begins_on_ground else 0.0

    @property
    def take_off_time(self) -> float | None:
        """When it takes off; None where the UAV is on its way already."""
        return self.ready_time + self.waiting_on_ground if self.takes_off else None

    def arrives(self, number: int) -> float:
        """When it is at a stop, counted from 0, if it takes off no sooner than it has to."""
        return self.stops[number].arrival_time + (self.waiting_on_ground if number == 0 else 0.0)

    def waiting_in_air(self, number: int) -> float:
        """Time that it waits in the air at a stop, counted from 0."""
        on_ground = self.waiting_on_ground if number == 0 else 0.0
        return self.stops[number].waiting - on_ground
