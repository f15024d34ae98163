"""A plan with everything a format needs of it: places, times, amounts, and the range that is left."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, NamedTuple

from app.api.plan_formats.flights import AT_PLACE, Flight, FlownLanding, FlownReload, FlownStop, Point, Points
from app.domain.problem import UAV, Problem, Target
from app.domain.surroundings import Base

_OWN_PLAN = "evaluated"
"""In place of an algorithm, of a plan that a client has evaluated."""


@dataclass(frozen=True, slots=True)
class FlownRoute:
    """What one UAV does.

    Attributes
    ----------
    number
        Its place in the swarm, from 0.
    uav
        As the problem has it.
    distance
        Of the legs to all stops.
    flights
        In order, at least one; those that do not move are among them.
    """

    number: int
    uav: UAV
    distance: float
    flights: tuple[Flight, ...]

    @property
    def flown(self) -> tuple[Flight, ...]:
        """The flights that move."""
        return tuple(flight for flight in self.flights if flight.flies)

    @property
    def flies(self) -> bool:
        """Whether the UAV moves at all."""
        return bool(self.flown)

    @property
    def stops(self) -> tuple[FlownStop, ...]:
        """The visits of all flights."""
        return tuple(stop for flight in self.flights for stop in flight.stops)

    @property
    def landing(self) -> FlownLanding:
        """The end of the last flight."""
        return self.flights[-1].landing


@dataclass(frozen=True, slots=True)
class UnmetNeed:
    """What a rescue area still needs after the plan, why, and what simple thing would help, if any."""

    target: Target
    remaining: tuple[float, ...]
    reason: str
    remedy: str | None


@dataclass(frozen=True, slots=True)
class StockLeft:
    """What a base has after the plan; None: as much as is asked for."""

    base: Base
    amounts: tuple[float, ...] | None


@dataclass(frozen=True, slots=True)
class FlownPlan:
    """A whole plan.

    Attributes
    ----------
    job_id, algorithm, reward, satisfaction, distance
        As the answer has them.
    problem
        What was to be solved.
    routes
        One a UAV.
    unmet
        Areas with needs left.
    in_world
        Whether the answer has what it only has where the problem uses fields of the world: times of visits
        and landings, ways.
    stocks
        What every base has left.
    title
        What people call it; None: nobody has said.
    begins
        When it begins, by the clock where it is flown; None: nobody has said.
    """

    job_id: str
    algorithm: str
    reward: float
    satisfaction: float
    distance: float
    problem: Problem
    routes: tuple[FlownRoute, ...]
    unmet: tuple[UnmetNeed, ...]
    in_world: bool
    stocks: tuple[StockLeft, ...]
    title: str | None = None
    begins: datetime | None = None

    @property
    def flying(self) -> tuple[FlownRoute, ...]:
        """The routes of the UAVs that move."""
        return tuple(route for route in self.routes if route.flies)

    @property
    def has_bases(self) -> bool:
        """Whether UAVs may land and fly again."""
        return bool(self.problem.bases)


def flown_plan(problem: Problem, answer: Mapping[str, Any]) -> FlownPlan:
    """Join a problem and the answer to it.

    Parameters
    ----------
    problem
        The problem.
    answer
        As ``POST /allocate`` gives it.
    """
    targets = {target.id: target for target in problem.targets}
    bases = {base.id: base for base in problem.bases}
    return FlownPlan(
        job_id=answer["job_id"],
        algorithm=answer.get("algorithm", _OWN_PLAN),
        reward=answer["reward"],
        satisfaction=answer["satisfaction"],
        distance=answer["distance"],
        problem=problem,
        routes=flown_routes(problem, answer["routes"]),
        unmet=tuple(
            UnmetNeed(
                targets[each["target_id"]], tuple(each["remaining"]), each["reason"], each.get("remedy")
            )
            for each in answer["unmet"]
        ),
        in_world=answer.get("makespan") is not None,
        stocks=tuple(
            StockLeft(bases[each["base_id"]], None if each["stock"] is None else tuple(each["stock"]))
            for each in answer.get("bases") or ()
        ),
    )


def flown_routes(problem: Problem, routes: Sequence[Mapping[str, Any]]) -> tuple[FlownRoute, ...]:
    """Join a problem and the routes of a plan, one a UAV, as answers have them."""
    targets = {target.id: target for target in problem.targets}
    bases = {base.id: base for base in problem.bases}
    places = _Places(problem, targets, bases)
    return tuple(
        FlownRoute(number, uav, route["distance"], tuple(_flights(number, uav, route, places)))
        for number, (uav, route) in enumerate(zip(problem.uavs, routes, strict=True))
    )


class _Places(NamedTuple):
    problem: Problem
    targets: Mapping[str, Target]
    bases: Mapping[str, Base]

    @property
    def in_wind(self) -> bool:
        wind = self.problem.wind
        return wind is not None and wind.speed > 0.0


class _Now(NamedTuple):
    """A UAV between two legs: where, when, what it has flown, and what it has left of range and endurance."""

    place: Point
    clock: float
    flown: float
    range_left: float
    endurance_left: float | None

    def ground_speed(self, uav: UAV, arrival: float, distance: float, *, in_wind: bool) -> float:
        known = in_wind and arrival > self.clock and distance > 0.0
        return distance / (arrival - self.clock) if known else uav.speed

    def air_length(self, uav: UAV, arrival: float, distance: float, *, in_wind: bool) -> float:
        return (arrival - self.clock) * uav.speed if in_wind else distance

    def aloft_until(self, arrival: float | None) -> float | None:
        if self.endurance_left is None or arrival is None:
            return None
        return self.endurance_left - (arrival - self.clock)


def _flights(route_number: int, uav: UAV, route: Mapping[str, Any], places: _Places) -> Iterator[Flight]:
    """Cut the stops of a route where the UAV lands."""
    aloft = None if uav.endurance is None else uav.endurance - uav.airborne
    now = _Now((uav.x_c, uav.y_c), uav.available_from, uav.dis, uav.voyage - uav.dis, aloft)
    number, origin, ready = 1, None, now.clock
    loaded = load = uav.loadlist
    aboard = load
    visits: list[FlownStop] = []

    def ended(landing: FlownLanding) -> Flight:
        zones = places.problem.no_fly_zones
        return Flight(route_number, uav, number, origin, ready, loaded, aboard, tuple(visits), landing, zones)

    for at, stop in enumerate(route["stops"]):
        if stop.get("kind") == "reload":
            landing = _reload(uav, stop, at, now, places)
            flight = ended(landing)
            yield flight
            number += flight.flies
            origin, ready, loaded = landing.base, landing.departure_time, landing.loaded
            load = tuple(had + more for had, more in zip(load, loaded, strict=True))
            aboard, visits = load, []
            now = _Now(landing.place, ready, 0.0, uav.voyage, uav.endurance)
            continue
        visits.append(_visit(uav, stop, at, now, places))
        load = tuple(had - less for had, less in zip(load, stop["delivered"], strict=True))
        last = visits[-1]
        there = (last.target.x, last.target.y)
        flown = now.flown + last.distance
        now = _Now(there, last.departure_time, flown, last.range_left, last.endurance_left)
    yield ended(_landing(uav, route, now, places))


def _visit(uav: UAV, stop: Mapping[str, Any], number: int, now: _Now, places: _Places) -> FlownStop:
    target, arrival, distance = places.targets[stop["target_id"]], stop["arrival_time"], stop["distance"]
    # An answer to a problem without a world has the arrival alone: nobody waits there.
    return FlownStop(
        target=target,
        number=number,
        step=stop["step"],
        arrival_time=arrival,
        distance=distance,
        delivered=tuple(stop["delivered"]),
        range_left=stop.get("range_left", uav.voyage - (now.flown + distance)),
        begin_time=stop.get("begin_time", arrival),
        departure_time=stop.get("departure_time", arrival + target.service_time),
        endurance_left=stop.get("endurance_left"),
        path=_points(stop.get("path")) or (now.place, (target.x, target.y)),
        ground_speed=now.ground_speed(uav, arrival, distance, in_wind=places.in_wind),
    )


def _reload(uav: UAV, stop: Mapping[str, Any], number: int, now: _Now, places: _Places) -> FlownReload:
    base, arrival, distance = places.bases[stop["base_id"]], stop["arrival_time"], stop["distance"]
    in_wind = places.in_wind
    return FlownReload(
        base=base,
        place=(base.x, base.y),
        time=arrival,
        distance=distance,
        range_left=now.range_left - now.air_length(uav, arrival, distance, in_wind=in_wind),
        endurance_left=now.aloft_until(arrival),
        path=_points(stop["path"]) or (now.place, (base.x, base.y)),
        ground_speed=now.ground_speed(uav, arrival, distance, in_wind=in_wind),
        number=number,
        step=stop["step"],
        loaded=tuple(stop["loaded"]),
        departure_time=stop["departure_time"],
    )


def _landing(uav: UAV, route: Mapping[str, Any], now: _Now, places: _Places) -> FlownLanding:
    """Return the end of a route, from when and where the leg to it begins."""
    problem, in_wind = places.problem, places.in_wind
    distance, landing = route["return_distance"], route.get("landing")
    if landing is None or not problem.objective.return_to_base:
        # Zones, wind and matrices make another way of it, or another time, which the plan does not have;
        # nor does it say to which base the leg leads.
        elsewhere = problem.no_fly_zones or in_wind or problem.matrices or problem.bases
        known = not elsewhere or distance <= AT_PLACE
        home = (uav.x_s, uav.y_s)
        time = now.clock + distance / uav.speed if known else None
        return FlownLanding(
            base=None,
            place=home,
            time=time,
            distance=distance,
            range_left=now.range_left - distance,
            endurance_left=now.aloft_until(time),
            path=(now.place, home) if known else (now.place,),
            ground_speed=uav.speed,
        )
    base_id, time = landing.get("base_id"), landing["time"]
    base = None if base_id is None else places.bases[base_id]
    place = (uav.x_s, uav.y_s) if base is None else (base.x, base.y)
    return FlownLanding(
        base=base,
        place=place,
        time=time,
        distance=distance,
        range_left=now.range_left - now.air_length(uav, time, distance, in_wind=in_wind),
        endurance_left=now.aloft_until(time),
        path=_points(landing["path"]) or (now.place, place),
        ground_speed=now.ground_speed(uav, time, distance, in_wind=in_wind),
    )


def _points(path: Sequence[Sequence[float]] | None) -> Points:
    return tuple((x, y) for x, y in path or ())
