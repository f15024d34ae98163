"""Flight files, one a flight: QGroundControl's ``.plan`` (JSON) and the older ``QGC WPL 110`` (tabs)."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

from app.api.plan_formats.flights import Flight, FlownReload
from app.api.plan_formats.mission import (
    FlightChoices,
    Frame,
    MissionItem,
    mission,
    mission_with_home,
    speed_m_s,
)
from app.domain.surroundings import NoFlyZone

_ARDUPILOT = 3
_MULTICOPTER = 2
_MIXED = 0
_ALTITUDE_MODE = {Frame.RELATIVE_ALTITUDE: 1, Frame.TERRAIN_ALTITUDE: 4}
_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")
_NAME = re.compile(r"(?P<place>[0-9]{3,9})-.*?(-flight-(?P<flight>[0-9]{1,9}))?\.[A-Za-z]+")


def plan_file(flight: Flight, choices: FlightChoices, warnings: Sequence[str] = ()) -> str:
    """Write a ``.plan``, version 1, with a mission of version 2 of simple items; no rally points.

    No-fly zones are polygons of its fence that must not be entered. What a mission cannot say is in
    ``notes``, a member that ground stations do not read.

    Parameters
    ----------
    flight, choices
        What is written, and what the plan leaves open.
    warnings
        For the pilot, also in ``notes``.

    Raises
    ------
    OutOfRange
        As :func:`~app.api.plan_formats.mission.mission` does.
    """
    items = mission(flight, choices)
    modes = {_ALTITUDE_MODE[each.frame] for each in choices.altitudes}
    speed = speed_m_s(flight)
    longitude, latitude = flight.launch
    content: dict[str, Any] = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"version": 2, "circles": [], "polygons": [_kept_out(zone) for zone in flight.zones]},
        "rallyPoints": {"version": 2, "points": []},
        "mission": {
            "version": 2,
            "firmwareType": _ARDUPILOT,
            "vehicleType": _MULTICOPTER,
            "globalPlanAltitudeMode": modes.pop() if len(modes) == 1 else _MIXED,
            "cruiseSpeed": speed,
            "hoverSpeed": speed,
            "plannedHomePosition": [latitude, longitude, 0],
            "items": [_simple_item(number, item) for number, item in enumerate(items, 1)],
        },
    }
    notes = [*_notes(flight), *(f"Warning: {warning}" for warning in warnings)]
    if notes:
        content["notes"] = notes
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def _kept_out(zone: NoFlyZone) -> dict[str, Any]:
    return {"version": 1, "inclusion": False, "polygon": [[y, x] for x, y in zone.polygon]}


def _notes(flight: Flight) -> list[str]:
    """Say when the UAV takes off, where that is not at once, and where it lands to reload."""
    uav, wait, takes_off = flight.uav, flight.waiting_on_ground, flight.take_off_time
    notes = []
    if takes_off is not None and takes_off > 0.0:
        why = "" if wait <= 0.0 else f", so that it waits for {flight.stops[0].target.id!r} on the ground"
        notes.append(f"{uav.id!r} takes off {takes_off:g} h from the plan's begin{why}")
    if isinstance(flight.landing, FlownReload):
        notes.append(f"flight {flight.number} of {uav.id!r} ends at base {flight.landing.base.id!r}: reload")
    return notes


def waypoint_file(flight: Flight, choices: FlightChoices) -> str:
    """Write waypoints as ``QGC WPL 110``; line 0 is the home position, as autopilots expect.

    Raises
    ------
    OutOfRange
        As :func:`~app.api.plan_formats.mission.mission` does.
    """
    lines = ["QGC WPL 110"]
    for number, item in enumerate(mission_with_home(flight, choices)):
        longitude, latitude, altitude = item.place or (0.0, 0.0, 0.0)
        # Ground stations and autopilots that read this format read no NaN: 0 is its "leave it as it is".
        params = [0.0 if math.isnan(value) else value for value in item.params]
        fields = [
            str(number),
            str(int(number == 0)),
            str(item.frame.value),
            str(item.command.value),
            *(f"{value:.8f}" for value in (*params, latitude, longitude)),
            f"{altitude:.6f}",
            "1",
        ]
        lines.append("\t".join(fields))
    return "\n".join(lines) + "\n"


def file_name(flight: Flight, ending: str, *, numbered: bool) -> str:
    """Name a file by the UAV's place in the swarm, from 1, and its id as far as file systems take it.

    Parameters
    ----------
    flight, ending
        The flight, and the ending of the name.
    numbered
        Whether the name has the number of the flight, too.
    """
    identifier = _UNSAFE.sub("_", flight.uav.id).strip("._") or "uav"
    number = f"-flight-{flight.number}" if numbered else ""
    return f"{flight.route + 1:03d}-{identifier[:60]}{number}.{ending}"


def place_of(name: str) -> tuple[int, int] | None:
    """Return what a file's name says: the UAV's place in the swarm, from 0, and the number of the flight.

    None for a name that is not as :func:`file_name` makes them; without a number it is the first flight.
    """
    found = _NAME.fullmatch(name)
    return None if found is None else (int(found["place"]) - 1, int(found["flight"] or 1))


def _simple_item(number: int, item: MissionItem) -> dict[str, Any]:
    params = [None if math.isnan(value) else value for value in item.params]
    content: dict[str, Any] = {
        "type": "SimpleItem",
        "command": item.command.value,
        "frame": item.frame.value,
        "doJumpId": number,
        "autoContinue": True,
    }
    if item.place is None:
        return {**content, "params": [*params, 0, 0, 0]}
    longitude, latitude, altitude = item.place
    return {
        **content,
        "params": [*params, latitude, longitude, altitude],
        "Altitude": altitude,
        "AltitudeMode": _ALTITUDE_MODE[item.frame],
        "AMSLAltAboveTerrain": None,
    }
