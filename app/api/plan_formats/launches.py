"""Flights as they are to be flown: their altitudes, launches one by one, and what a pilot is warned of.

A plan has neither altitudes nor a crew: its UAVs may all take off at once and fly at any height. Here flights
get altitudes, and those from one place take off one after the other, with what follows for their times.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from app.api.plan_formats.altitudes import TERRAIN_BEYOND_KM, Separation, flight_altitudes, length
from app.api.plan_formats.flights import Flight, FlownReload, Point
from app.api.plan_formats.flown_plan import FlownPlan, FlownRoute
from app.api.plan_formats.mission import AltitudeReference, Delivery, Ending, FlightChoices
from app.domain.problem import TOLERANCE

USUAL_CEILING_M = 120.0
"""Above the ground: higher than that most countries let nobody fly without a permission."""
MAX_INTERVAL_S = 3600.0
_SECONDS_AN_HOUR = 3600.0


@dataclass(frozen=True, slots=True)
class PlannedFlight:
    """A flight as it is to be flown.

    Attributes
    ----------
    flight
        With the times that it has after those that are launched before it.
    choices
        With the altitudes of its legs, and what they are measured from; those of its first leg are also
        ``altitude_m`` and ``altitude_reference``.
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
        Of all flights; the altitude is the lowest one.
    separation
        How they keep apart.

    Raises
    ------
    OutOfRange
        As :func:`~app.api.plan_formats.altitudes.flight_altitudes` does.
    """
    altitudes = flight_altitudes(plan.flying, choices.altitude_m, separation)
    planned = []
    for flight, delay in _launched(plan.flying, separation.launch_interval_s):
        legs = altitudes[flight.uav.id, flight.number]
        first = legs[0]
        own = replace(choices, altitude_m=first.metres, altitude_reference=first.reference, legs=legs)
        planned.append(PlannedFlight(flight, own, delay, tuple(_warnings(flight, own, delay))))
    return tuple(planned)


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


def _ends_with_return(flight: Flight, choices: FlightChoices) -> bool:
    goes_home = isinstance(flight.landing, FlownReload) or choices.end is Ending.RETURN
    return goes_home and flight.returns_to_launch


def _warnings(flight: Flight, choices: FlightChoices, delay: float) -> Iterator[str]:
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
    highest_m = max(each.metres for each in choices.altitudes)
    if highest_m > USUAL_CEILING_M:
        yield f"{highest_m:g} m is above {USUAL_CEILING_M:g} m, which mostly needs a permission"
    measured_from = {each.reference for each in choices.altitudes}
    if AltitudeReference.TERRAIN in measured_from:
        yield "its altitudes are above the ground below: the autopilot needs terrain data of the whole way"
    elif length(flight) > TERRAIN_BEYOND_KM:
        yield (
            f"it flies {length(flight):.0f} km with altitudes above where it starts: look at the ground "
            "along its way"
        )
    if len(choices.altitudes) > 1:
        yield "it changes its altitude over its stops"
        if _ends_with_return(flight, choices):
            home_m = choices.altitude(len(flight.stops)).metres
            yield (
                f"its way home is flown at {home_m:g} m only if the autopilot's return altitude (RTL) is not "
                "above that"
            )
    if choices.delivery is Delivery.PAYLOAD_PLACE and choices.max_descent_m == 0:
        yield "it goes down to find the ground at every stop, as far as that takes (max_descent sets a limit)"
    ways = (*(stop.path for stop in flight.stops), landing.path)
    if flight.zones and any(len(way) > 2 for way in ways):
        yield "its way touches corners of no-fly zones"
