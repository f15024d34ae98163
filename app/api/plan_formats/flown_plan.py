"""A plan with everything a format needs of it: places, times, amounts, and the range that is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.domain.problem import UAV, Problem, Target
from app.domain.surroundings import NoFlyZone

_OWN_PLAN = "evaluated"
"""In place of an algorithm, of a plan that a client has evaluated."""

_AT_HOME = 1e-9
"""Distances up to this are none: positions of the same place, written differently."""


Points = tuple[tuple[float, float], ...]
"""Places flown over in turn, both ends among them."""


@dataclass(frozen=True, slots=True)
class FlownStop:
    """A visit: a stop of the answer, with its place.

    Attributes
    ----------
    target
        The rescue area as the problem has it.
    step
        Decision step, from 1.
    arrival_time
        In time units from now, or h.
    distance
        Of the leg to it.
    delivered
        Amounts unloaded, one a material.
    range_left
        On arrival, in distance units; what the UAV has flown before counts.
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
class FlownRoute:
    """What one UAV does.

    Attributes
    ----------
    number
        Its place in the swarm, from 0.
    uav
        As the problem has it.
    stops
        In order.
    distance, return_distance
        Of the legs to the stops, and of the leg home.
    range_left
        After the leg home, in distance units.
    return_time
        When it is home, in time units from now, or h; None where it need not return, and how long it would
        fly is not known.
    return_path
        The way home; only the place where it ends its last visit where the way is not known.
    zones
        What it must not fly through.
    """

    number: int
    uav: UAV
    stops: tuple[FlownStop, ...]
    distance: float
    return_distance: float
    range_left: float
    return_time: float | None
    return_path: Points
    zones: tuple[NoFlyZone, ...]

    @property
    def flies(self) -> bool:
        """Whether it moves at all."""
        return bool(self.stops) or self.return_distance > _AT_HOME

    @property
    def starts_at_home(self) -> bool:
        """Whether it takes off from its starting point; otherwise it is on its way already."""
        uav = self.uav
        still = uav.dis <= _AT_HOME and uav.airborne == 0.0
        return (
            still and (uav.x_c, uav.y_c) == (uav.x_s, uav.y_s) and uav.home_location in (None, uav.location)
        )

    @property
    def waiting_on_ground(self) -> float:
        """Time that it waits for its first visit before it takes off."""
        return self.stops[0].waiting if self.stops and self.uav.begins_on_ground else 0.0

    def arrives(self, number: int) -> float:
        """When it is at a stop, counted from 0, if it takes off no sooner than it has to."""
        return self.stops[number].arrival_time + (self.waiting_on_ground if number == 0 else 0.0)

    def waiting_in_air(self, number: int) -> float:
        """Time that it waits in the air at a stop, counted from 0."""
        on_ground = self.waiting_on_ground if number == 0 else 0.0
        return self.stops[number].waiting - on_ground


@dataclass(frozen=True, slots=True)
class UnmetNeed:
    """What a rescue area still needs after the plan, and why."""

    target: Target
    remaining: tuple[float, ...]
    reason: str


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

    @property
    def flying(self) -> tuple[FlownRoute, ...]:
        """The routes of the UAVs that move."""
        return tuple(route for route in self.routes if route.flies)


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
    return FlownPlan(
        job_id=answer["job_id"],
        algorithm=answer.get("algorithm", _OWN_PLAN),
        reward=answer["reward"],
        satisfaction=answer["satisfaction"],
        distance=answer["distance"],
        problem=problem,
        routes=tuple(
            _route(number, problem, uav, route, targets)
            for number, (uav, route) in enumerate(zip(problem.uavs, answer["routes"], strict=True))
        ),
        unmet=tuple(
            UnmetNeed(targets[each["target_id"]], tuple(each["remaining"]), each["reason"])
            for each in answer["unmet"]
        ),
        in_world=answer.get("makespan") is not None,
    )


def _route(
    number: int, problem: Problem, uav: UAV, route: Mapping[str, Any], targets: Mapping[str, Target]
) -> FlownRoute:
    flown, clock, here = uav.dis, uav.available_from, (uav.x_c, uav.y_c)
    in_wind = problem.wind is not None and problem.wind.speed > 0.0
    stops = []
    for stop in route["stops"]:
        flown += stop["distance"]
        target = targets[stop["target_id"]]
        there, arrival = (target.x, target.y), stop["arrival_time"]
        # An answer to a problem without a world has the arrival alone: nobody waits there.
        departure = stop.get("departure_time", arrival + target.service_time)
        stops.append(
            FlownStop(
                target=target,
                step=stop["step"],
                arrival_time=arrival,
                distance=stop["distance"],
                delivered=tuple(stop["delivered"]),
                range_left=stop.get("range_left", uav.voyage - flown),
                begin_time=stop.get("begin_time", arrival),
                departure_time=departure,
                endurance_left=stop.get("endurance_left"),
                path=_points(stop.get("path")) or (here, there),
                ground_speed=stop["distance"] / (arrival - clock)
                if in_wind and arrival > clock and stop["distance"] > 0.0
                else uav.speed,
            )
        )
        clock, here = departure, there
    left = stops[-1].range_left if stops else uav.voyage - uav.dis
    return FlownRoute(
        number=number,
        uav=uav,
        stops=tuple(stops),
        distance=route["distance"],
        return_distance=route["return_distance"],
        **_way_home(problem, uav, route, clock, here, left, in_wind=in_wind),
        zones=problem.no_fly_zones,
    )


def _way_home(
    problem: Problem,
    uav: UAV,
    route: Mapping[str, Any],
    clock: float,
    here: tuple[float, float],
    left: float,
    *,
    in_wind: bool,
) -> dict[str, Any]:
    """Return the fields that are about the leg home, from when and where it begins with so much range."""
    distance, home = route["return_distance"], (uav.x_s, uav.y_s)
    landing = route.get("landing")
    if landing is None or not problem.objective.return_to_base:
        # Zones, wind and matrices make another way of it, or another time, which the plan does not have.
        known = not (problem.no_fly_zones or in_wind or problem.matrices) or distance <= _AT_HOME
        return {
            "range_left": left - distance,
            "return_time": clock + distance / uav.speed if known else None,
            "return_path": (here, home) if known else (here,),
        }
    return {
        "range_left": left - ((landing["time"] - clock) * uav.speed if in_wind else distance),
        "return_time": landing["time"],
        "return_path": _points(landing["path"]) or (here, home),
    }


def _points(path: Sequence[Sequence[float]] | None) -> Points:
    return tuple((x, y) for x, y in path or ())
