"""A plan with everything a format needs of it: places, times, amounts, and the range that is left."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.domain.problem import UAV, Problem, Target

_AT_HOME = 1e-9
"""Distances up to this are none: positions of the same place, written differently."""


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
    """

    target: Target
    step: int
    arrival_time: float
    distance: float
    delivered: tuple[float, ...]
    range_left: float


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
        When it is home, in time units from now, or h.
    """

    number: int
    uav: UAV
    stops: tuple[FlownStop, ...]
    distance: float
    return_distance: float
    range_left: float
    return_time: float

    @property
    def flies(self) -> bool:
        """Whether it moves at all."""
        return bool(self.stops) or self.return_distance > _AT_HOME

    @property
    def starts_at_home(self) -> bool:
        """Whether it takes off from its starting point; otherwise it is on its way already."""
        uav = self.uav
        return uav.dis <= _AT_HOME and (uav.x_c, uav.y_c) == (uav.x_s, uav.y_s)


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
    """

    job_id: str
    algorithm: str
    reward: float
    satisfaction: float
    distance: float
    problem: Problem
    routes: tuple[FlownRoute, ...]
    unmet: tuple[UnmetNeed, ...]

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
        algorithm=answer["algorithm"],
        reward=answer["reward"],
        satisfaction=answer["satisfaction"],
        distance=answer["distance"],
        problem=problem,
        routes=tuple(
            _route(number, uav, route, targets)
            for number, (uav, route) in enumerate(zip(problem.uavs, answer["routes"], strict=True))
        ),
        unmet=tuple(
            UnmetNeed(targets[each["target_id"]], tuple(each["remaining"]), each["reason"])
            for each in answer["unmet"]
        ),
    )


def _route(number: int, uav: UAV, route: Mapping[str, Any], targets: Mapping[str, Target]) -> FlownRoute:
    flown = uav.dis
    clock = 0.0
    stops = []
    for stop in route["stops"]:
        flown += stop["distance"]
        target = targets[stop["target_id"]]
        clock = stop["arrival_time"] + target.service_time
        stops.append(
            FlownStop(
                target=target,
                step=stop["step"],
                arrival_time=stop["arrival_time"],
                distance=stop["distance"],
                delivered=tuple(stop["delivered"]),
                range_left=uav.voyage - flown,
            )
        )
    return FlownRoute(
        number=number,
        uav=uav,
        stops=tuple(stops),
        distance=route["distance"],
        return_distance=route["return_distance"],
        range_left=uav.voyage - flown - route["return_distance"],
        return_time=clock + route["return_distance"] / uav.speed,
    )
