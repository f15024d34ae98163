"""The next flight of each UAV of a mission, by the plan in force, as flight files have it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.api.plan_formats.errors import NotGeographic
from app.api.plan_formats.flights import Flight
from app.api.plan_formats.flown_plan import flown_routes
from app.api.plan_formats.mission import FlightChoices, MissionItem, mission, mission_with_home
from app.domain.records import problem_from_record

ARDUPILOT = 3
"""``MAV_AUTOPILOT_ARDUPILOTMEGA``: keeps its home as item 0 of its mission."""


def require_geographic(problem: Mapping[str, Any]) -> None:
    """Refuse a problem whose positions are no longitudes and latitudes.

    Raises
    ------
    NotGeographic
        If it is one.
    """
    if problem["crs"] != "wgs84":
        raise NotGeographic("MAVLink", problem["crs"])


def next_flights(
    state: Mapping[str, Any], plan: Mapping[str, Any], matrices: Any = None
) -> dict[str, Flight]:
    """Return the flight that each UAV is on, or begins next, by its id; one that stays where it is has none.

    Parameters
    ----------
    state
        As ``GET /missions/{id}`` has it.
    plan
        As ``GET /missions/{id}/plan`` has it.
    matrices
        Of the mission's problem, which states leave out; None without.
    """
    lost = set(state["lost"])
    problem = state["problem"] if matrices is None else {**state["problem"], "matrices": matrices}
    return {
        route.uav.id: route.flown[0]
        for route in flown_routes(problem_from_record(problem), plan["routes"])
        if route.flies and route.uav.id not in lost
    }


def items_for(flight: Flight, choices: FlightChoices, autopilot: int | None) -> tuple[MissionItem, ...]:
    """Return the mission items of a flight, as an autopilot numbers them.

    Raises
    ------
    OutOfRange
        As :func:`~app.api.plan_formats.mission.mission` does.
    """
    return (mission_with_home if autopilot == ARDUPILOT else mission)(flight, choices)


def stops_of(flight: Flight) -> tuple[str, ...]:
    """Return what tells a flight from another one of its UAV: where it goes, to its end."""
    end = "home" if flight.landing.base is None else flight.landing.base.id
    return (*(stop.target.id for stop in flight.stops), f"/{end}")


def goes_on(before: tuple[str, ...], now: tuple[str, ...]) -> bool:
    """Say whether a flight is the rest of one before, so that who flies that one flies this one."""
    return before[-len(now) :] == now
