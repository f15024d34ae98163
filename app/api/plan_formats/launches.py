"""How flights keep apart: an altitude a UAV, launches one after the other, and what a pilot is warned of.

A plan has neither altitudes nor a crew: its UAVs may all take off at once and fly at any height. Here each
gets an altitude, and flights from one place take off one after the other, with what follows for their times.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count

from app.api.plan_formats.errors import OutOfRange
from app.api.plan_formats.flights import Flight, FlownReload, Point
from app.api.plan_formats.flown_plan import FlownPlan, FlownRoute
from app.api.plan_formats.mission import (
    MAX_ALTITUDE_M,
    MIN_ALTITUDE_M,
    AltitudeReference,
    Delivery,
    FlightChoices,
)
from app.api.problem_details import FieldError
from app.domain.problem import TOLERANCE

TERRAIN_BEYOND_KM = 5.0
"""Length of a flight above which its altitudes are above the ground below, unless something else is asked."""
USUAL_CEILING_M = 120.0
"""Above the ground: higher than that most countries let nobody fly without a permission."""
MAX_STEP_M, MAX_INTERVAL_S = 500.0, 3600.0
_SECONDS_AN_HOUR = 3600.0


@dataclass(frozen=True, slots=True)
class Separation:
    """How flights keep apart.

    Attributes
    ----------
    altitude_step_m
        Between UAVs that start or land at one place, in their order in the problem.
    launch_interval_s
        Between two launches at one place.
    altitude_of
        Altitudes in m by the id of the UAV, where it is not to be what the step makes it.
    reference
        What altitudes are measured from; None: home, or the ground below where a flight is long.
    """

    altitude_step_m: float = 10.0
    launch_interval_s: float = 60.0
    altitude_of: Mapping[str, float] = field(default_factory=dict)
    reference: AltitudeReference | None = None


@dataclass(frozen=True, slots=True)
class PlannedFlight:
    """A flight as it is to be flown.

    Attributes
    ----------
    flight
        With the times that it has after those that are launched before it.
    choices
        With its altitude, and what that is measured from.
    delay
        How much later than in the plan it takes off, in h.
    warnings
        What its pilot has to know.
    """

    flight: Flight
    choices: FlightChoices
    delay: float
    warnings: tuple[str, ...]


def planned_flights(
    plan: FlownPlan, choices: FlightChoices, separation: Separation
) -> tuple[PlannedFlight, ...]:
    """Return all flights of a ``wgs84`` plan, UAV for UAV, each with its altitude, times and warnings.

    Parameters
    ----------
    plan
        The plan.
    choices
        Of all flights; the altitude is that of the first UAV of each place.
    separation
        How they keep apart.

    Raises
    ------
    OutOfRange
        If a UAV would fly at an altitude that flight files cannot hold.
    """
    altitudes = _altitudes(plan.flying, choices.altitude_m, separation)
    if errors := [*_beyond(plan.flying, altitudes)]:
        raise OutOfRange(errors)
    planned = []
    for flight, delay in _launched(plan.flying, separation.launch_interval_s):
        far = _length(flight) > TERRAIN_BEYOND_KM
        by_length = AltitudeReference.TERRAIN if far else AltitudeReference.HOME
        own = replace(
            choices,
            altitude_m=altitudes[flight.uav.id],
            altitude_reference=separation.reference or by_length,
        )
        planned.append(PlannedFlight(flight, own, delay, tuple(_warnings(flight, own, delay, far=far))))
    return tuple(planned)


def _altitudes(routes: Sequence[FlownRoute], lowest_m: float, separation: Separation) -> dict[str, float]:
    """Give each UAV that flies the lowest altitude that nobody has who starts or lands there."""
    there: dict[Point, set[int]] = {}
    altitudes = {}
    for route in routes:
        places = {place for flight in route.flown for place in (flight.launch, flight.landing.place)}
        taken = set().union(*(there.setdefault(place, set()) for place in places))
        rank = next(each for each in count() if each not in taken)
        for place in places:
            there[place].add(rank)
        stepped = lowest_m + rank * separation.altitude_step_m
        altitudes[route.uav.id] = separation.altitude_of.get(route.uav.id, stepped)
    return altitudes


def _beyond(routes: Sequence[FlownRoute], altitudes: Mapping[str, float]) -> Iterator[FieldError]:
    for route in routes:
        altitude = altitudes[route.uav.id]
        if not MIN_ALTITUDE_M <= altitude <= MAX_ALTITUDE_M:
            limits = f"{MIN_ALTITUDE_M:g}..{MAX_ALTITUDE_M:g}"
            detail = f"{route.uav.id!r} would fly at {altitude:g} m, which is not in {limits}"
            yield FieldError(pointer=f"/routes/{route.number}", detail=detail)


def _launched(routes: Sequence[FlownRoute], interval_s: float) -> list[tuple[Flight, float]]:
    """Launch flights in the order of their times, at each place one by one; return them UAV for UAV."""
    interval = interval_s / _SECONDS_AN_HOUR
    waiting = [(_ready(route.flown[0], 0.0), number, 0) for number, route in enumerate(routes)]
    heapq.heapify(waiting)
    free: dict[Point, float] = {}
    launched: list[list[tuple[Flight, float]]] = [[] for _ in routes]
    while waiting:
        ready, number, place = heapq.heappop(waiting)
        planned = routes[number].flown[place]
        delay = 0.0
        if planned.take_off_time is not None:
            takes_off = max(ready, free.get(planned.launch, ready))
            free[planned.launch] = takes_off + interval
            delay = takes_off - planned.take_off_time
        flight = _later(planned, delay) if delay > 0 else planned
        launched[number].append((flight, delay))
        if place + 1 < len(routes[number].flown):
            ready = _ready(routes[number].flown[place + 1], _shift(planned, flight))
            heapq.heappush(waiting, (ready, number, place + 1))
    return [each for flights in launched for each in flights]


def _ready(flight: Flight, carried: float) -> float:
    """Return when a flight can take off, if the one before it ends later than planned."""
    planned = flight.take_off_time
    return flight.ready_time if planned is None else max(planned, flight.ready_time + carried)


def _later(flight: Flight, delay: float) -> Flight:
    """Let a flight take off later; what it would have waited for on its way makes up for it."""
    waited = flight.waiting_on_ground
    shift, stops = waited + delay, []
    for stop in flight.stops:
        arrival = stop.arrival_time + shift
        begin = max(stop.begin_time, arrival)
        departure = begin + (stop.departure_time - stop.begin_time)
        shift = departure - stop.departure_time
        stops.append(replace(stop, arrival_time=arrival, begin_time=begin, departure_time=departure))
    landing = flight.landing
    if landing.time is not None:
        landing = replace(landing, time=landing.time + shift)
    if isinstance(landing, FlownReload):
        landing = replace(landing, departure_time=landing.departure_time + shift)
    return replace(flight, ready_time=flight.ready_time + waited + delay, stops=tuple(stops), landing=landing)


def _shift(planned: Flight, flight: Flight) -> float:
    """Return how much later a flight ends than planned."""
    before, after = planned.landing.time, flight.landing.time
    return 0.0 if before is None or after is None else after - before


def _length(flight: Flight) -> float:
    return sum(stop.distance for stop in flight.stops) + flight.landing.distance


def _warnings(flight: Flight, choices: FlightChoices, delay: float, *, far: bool) -> Iterator[str]:
    uav, landing = flight.uav, flight.landing
    if not flight.takes_off:
        yield "it is on its way already: the mission has no take-off, and begins where the UAV is"
    if delay > 0:
        yield f"it takes off {delay * _SECONDS_AN_HOUR:.0f} s later than planned, after others at its place"
    for stop in flight.stops:
        deadline = stop.target.deadline
        if deadline is not None and stop.arrival_time > deadline + TOLERANCE * max(1.0, deadline):
            late = (stop.arrival_time - deadline) * _SECONDS_AN_HOUR
            yield f"it is {late:.0f} s too late at {stop.target.id!r}, whose deadline is {deadline:g} h"
    end = uav.available_until
    if end is not None and landing.time is not None and landing.time > end + TOLERANCE * max(1.0, end):
        yield f"it lands at {landing.time:g} h, and is available until {end:g} h"
    terrain = choices.altitude_reference is AltitudeReference.TERRAIN
    if choices.altitude_m > USUAL_CEILING_M:
        yield f"{choices.altitude_m:g} m is above {USUAL_CEILING_M:g} m, which mostly needs a permission"
    if terrain:
        yield "its altitudes are above the ground below: the autopilot needs terrain data of the whole way"
    elif far:
        yield (
            f"it flies {_length(flight):.0f} km with altitudes above where it starts: look at the ground "
            "along its way"
        )
    if choices.delivery is Delivery.PAYLOAD_PLACE and choices.max_descent_m == 0:
        yield "it goes down to find the ground at every stop, as far as that takes (max_descent sets a limit)"
    ways = (*(stop.path for stop in flight.stops), landing.path)
    if flight.zones and any(len(way) > 2 for way in ways):
        yield "its way touches corners of no-fly zones"
