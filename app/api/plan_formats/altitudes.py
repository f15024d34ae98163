"""How high flights are: an altitude a UAV, or one a leg, so that legs of several UAVs that meet are apart.

A plan has no altitudes. One a UAV keeps those apart that start or land at one place. One a leg keeps every
two legs of different UAVs apart that cross or come near each other anywhere, whenever they are flown; a UAV
then changes its altitude over its stops.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import count

import numpy as np

from app.api.plan_formats.errors import OutOfRange
from app.api.plan_formats.flights import Flight, Point, Points
from app.api.plan_formats.flown_plan import FlownRoute
from app.api.plan_formats.mission import MAX_ALTITUDE_M, MIN_ALTITUDE_M, Altitude, AltitudeReference
from app.api.problem_details import FieldError
from app.domain.geometry import EARTH_RADIUS_KM
from app.domain.plane import BeyondProjection, Plane
from app.domain.said import said

TERRAIN_BEYOND_KM = 5.0
"""Length of a flight above which its altitudes are above the ground below, unless something else is asked."""
MAX_STEP_M, MAX_CLEARANCE_M = 500.0, 10_000.0
_MEASURED_FROM = {AltitudeReference.HOME: "its start", AltitudeReference.TERRAIN: "the ground below"}
_SAME_M = 1e-6


class AltitudeBy(StrEnum):
    """What has an altitude of its own."""

    UAV = "uav"
    LEG = "leg"


@dataclass(frozen=True, slots=True)
class LegOf:
    """A leg of a UAV.

    Attributes
    ----------
    uav_id
        The UAV.
    number
        From 1, through all its flights: leg n leads to its n-th stop, reloads counted, the last one home.
    """

    uav_id: str
    number: int


OwnAltitude = tuple[float, AltitudeReference | None]
"""Metres, and what they are measured from; None: the same as the others."""


@dataclass(frozen=True, slots=True)
class Separation:
    """How flights keep apart.

    Attributes
    ----------
    altitude_step_m
        Between UAVs that start or land at one place, in their order in the problem, or between legs.
    launch_interval_s
        Between two launches at one place.
    altitude_of
        Altitudes by the id of the UAV, where they are not to be what the step makes them.
    reference
        What altitudes are measured from. None: above the ground below for a flight that is long, and where
        legs have their own for all of them if one is long or they start at several places; above home
        otherwise.
    altitude_by
        What has an altitude of its own.
    clearance_m
        Legs that come nearer than that are at different altitudes, where legs have their own.
    altitude_of_leg
        The same of legs.
    """

    altitude_step_m: float = 10.0
    launch_interval_s: float = 60.0
    altitude_of: Mapping[str, OwnAltitude] = field(default_factory=dict)
    reference: AltitudeReference | None = None
    altitude_by: AltitudeBy = AltitudeBy.UAV
    clearance_m: float = 100.0
    altitude_of_leg: Mapping[LegOf, OwnAltitude] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Leg:
    name: LegOf
    way: Points


Flights = tuple[Altitude, ...]
"""Altitudes of the legs of a flight in turn."""


def flight_altitudes(
    routes: Sequence[FlownRoute], lowest_m: float, separation: Separation
) -> dict[tuple[str, int], Flights]:
    """Return the altitudes of all flights of a ``wgs84`` plan, by UAV and number of the flight.

    Parameters
    ----------
    routes
        Of the UAVs that fly.
    lowest_m
        The lowest altitude.
    separation
        How they keep apart.

    Raises
    ------
    OutOfRange
        If a leg would be at an altitude that flight files cannot hold, if a leg has an altitude of its own
        that the plan has not, or if legs are to be apart on more than a part of the globe.
    """
    legs = {route.uav.id: _legs(route) for route in routes}
    if errors := [*_unknown(legs, separation)]:
        raise OutOfRange(errors)
    own = _own(legs, separation)
    fixed = {name: metres for name, (metres, _) in own.items()}
    by_leg = separation.altitude_by is AltitudeBy.LEG
    if by_leg:
        given = _by_leg(legs, lowest_m, separation, fixed)
    else:
        given = _by_uav(routes, legs, lowest_m, separation) | fixed
    if errors := [*_beyond(routes, legs, given)]:
        raise OutOfRange(errors)
    common = _common_reference(routes) if by_leg else None
    found = {}
    for route in routes:
        for flight, flown in _by_flight(route, legs[route.uav.id]):
            usual = separation.reference or common or _usual_reference(flight)
            found[route.uav.id, flight.number] = tuple(
                Altitude(given[leg.name], own.get(leg.name, (0.0, None))[1] or usual) for leg in flown
            )
    return found


def altitude_text(altitudes: Sequence[Altitude]) -> str:
    """Write altitudes for people: from the lowest to the highest of those measured from the same."""
    written = []
    for reference, above in _MEASURED_FROM.items():
        metres = sorted({each.metres for each in altitudes if each.reference is reference})
        if metres:
            span = f"{metres[0]:g}" if len(metres) == 1 else f"{metres[0]:g} to {metres[-1]:g}"
            written.append(f"{span} m above {above}")
    return ", ".join(written)


def length(flight: Flight) -> float:
    """Return how long the way of a flight is, in km."""
    return sum(stop.distance for stop in flight.stops) + flight.landing.distance


def _own(legs: Mapping[str, Sequence[_Leg]], separation: Separation) -> dict[LegOf, OwnAltitude]:
    """Return what is asked for of each leg; of a leg counts before of its UAV."""
    of_uavs = {
        leg.name: own for uav_id, own in separation.altitude_of.items() for leg in legs.get(uav_id, ())
    }
    return of_uavs | dict(separation.altitude_of_leg)


def _usual_reference(flight: Flight) -> AltitudeReference:
    return AltitudeReference.TERRAIN if length(flight) > TERRAIN_BEYOND_KM else AltitudeReference.HOME


def _common_reference(routes: Sequence[FlownRoute]) -> AltitudeReference:
    """Return what all altitudes are measured from, so that they can be compared."""
    flights = [flight for route in routes for flight in route.flown]
    long = any(length(flight) > TERRAIN_BEYOND_KM for flight in flights)
    apart = len({flight.launch for flight in flights}) > 1
    return AltitudeReference.TERRAIN if long or apart else AltitudeReference.HOME


def _legs(route: FlownRoute) -> list[_Leg]:
    ways = [way for flight in route.flights for way in _ways(flight)]
    return [_Leg(LegOf(route.uav.id, number), way) for number, way in enumerate(ways, 1)]


def _ways(flight: Flight) -> list[Points]:
    return [*(stop.path for stop in flight.stops), flight.landing.path]


def _by_flight(route: FlownRoute, legs: Sequence[_Leg]) -> Iterator[tuple[Flight, Sequence[_Leg]]]:
    """Yield the flights of a route that move, each with its legs."""
    begin = 0
    for flight in route.flights:
        end = begin + len(flight.stops) + 1
        if flight.flies:
            yield flight, legs[begin:end]
        begin = end


def _by_uav(
    routes: Sequence[FlownRoute], legs: Mapping[str, Sequence[_Leg]], lowest_m: float, separation: Separation
) -> dict[LegOf, float]:
    """Give each UAV that flies the lowest altitude that nobody has who starts or lands there."""
    there: dict[Point, set[int]] = {}
    given: dict[LegOf, float] = {}
    for route in routes:
        places = {place for flight in route.flown for place in (flight.launch, flight.landing.place)}
        taken = set().union(*(there.setdefault(place, set()) for place in places))
        rank = next(each for each in count() if each not in taken)
        for place in places:
            there[place].add(rank)
        given |= {leg.name: lowest_m + rank * separation.altitude_step_m for leg in legs[route.uav.id]}
    return given


def _by_leg(
    legs: Mapping[str, Sequence[_Leg]],
    lowest_m: float,
    separation: Separation,
    fixed: Mapping[LegOf, float],
) -> dict[LegOf, float]:
    """Give each leg the lowest altitude that is a step away from all that legs near it have already."""
    every = [leg for of_uav in legs.values() for leg in of_uav]
    near = _near(every, separation.clearance_m)
    given, step_m = dict(fixed), separation.altitude_step_m
    for number, leg in enumerate(every):
        if leg.name in given:
            continue
        taken = [given[other] for each in near[number] if (other := every[each].name) in given]
        given[leg.name] = next(
            high
            for high in (lowest_m + rank * step_m for rank in count())
            if step_m == 0.0 or all(abs(high - other) >= step_m - _SAME_M for other in taken)
        )
    return given


def _near(legs: Sequence[_Leg], clearance_m: float) -> list[list[int]]:
    """Return for each leg those of other UAVs that come nearer to it than a distance.

    It is measured on a plane on which distances are never shorter than on the ground. The wider the plan, the
    longer they are towards its rim, so that a larger distance is asked for there: legs may be kept apart that
    are farther than that from each other, by half of it at 35 degrees from the middle.
    """
    if not legs:
        return []
    # A library of geometry that the web process loads for nothing else.
    import shapely  # noqa: PLC0415 - as above

    points = np.array([place for leg in legs for place in leg.way])
    try:
        plane = Plane.around("wgs84", points)
        flat = plane.flat(points)
    except BeyondProjection as error:
        detail = said("legs are kept apart within a part of the globe only: {why}", why=error.detail)
        raise OutOfRange([FieldError(pointer="/routes", detail=detail, parameter="altitude_by")]) from None
    ends = np.cumsum([len(leg.way) for leg in legs])[:-1]
    lines = [
        shapely.LineString(way) if len(way) > 1 else shapely.Point(way[0]) for way in np.split(flat, ends)
    ]
    radius = np.hypot(*(flat / plane.scale).T).max()
    unit = plane.scale / (1000.0 * EARTH_RADIUS_KM)
    one, other = shapely.STRtree(lines).query(
        lines, predicate="dwithin", distance=clearance_m * unit * (1.0 + radius**2)
    )
    found: list[list[int]] = [[] for _ in legs]
    for a, b in zip(one.tolist(), other.tolist(), strict=True):
        if legs[a].name.uav_id != legs[b].name.uav_id:
            found[a].append(b)
    return found


def _unknown(legs: Mapping[str, Sequence[_Leg]], separation: Separation) -> Iterator[FieldError]:
    for name in separation.altitude_of_leg:
        there = len(legs.get(name.uav_id, ()))
        if name.number > there:
            detail = said(
                "{uav!r} has {count} legs in this plan, none of number {number}",
                uav=name.uav_id,
                count=there,
                number=name.number,
            )
            yield FieldError(pointer="", detail=detail, parameter="altitude_of")


def _beyond(
    routes: Sequence[FlownRoute], legs: Mapping[str, Sequence[_Leg]], given: Mapping[LegOf, float]
) -> Iterator[FieldError]:
    for route in routes:
        for altitude in dict.fromkeys(given[leg.name] for leg in legs[route.uav.id]):
            if not MIN_ALTITUDE_M <= altitude <= MAX_ALTITUDE_M:
                detail = said(
                    "{uav!r} would fly at {altitude:g} m, which is not in {low:g}..{high:g}",
                    uav=route.uav.id,
                    altitude=altitude,
                    low=MIN_ALTITUDE_M,
                    high=MAX_ALTITUDE_M,
                )
                yield FieldError(pointer=f"/routes/{route.number}", detail=detail)
