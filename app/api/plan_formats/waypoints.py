"""Flight files as they are read: QGroundControl's ``.plan`` (JSON) and ``QGC WPL 110`` (columns)."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from app.api.plan_formats.flights import Point

_WPL = "QGC WPL 110"
_COLUMNS = 12
_PARAMETERS = 7
_AT_LATITUDE, _AT_LONGITUDE = 4, 5


class UnreadableFlight(ValueError):
    """A text is no flight file; the message says where and why."""


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A mission item as a file has it.

    Attributes
    ----------
    number
        In the file, from 1, without the home position.
    command
        A ``MAV_CMD``.
    place
        Its longitude and latitude, which mean something only with commands that have a place.
    """

    number: int
    command: int
    place: Point


@dataclass(frozen=True, slots=True)
class FlightFile:
    """What is read of a file.

    Attributes
    ----------
    home
        Where the UAV is launched; None where the file does not say.
    items
        The mission, in its order.
    """

    home: Point | None
    items: tuple[Waypoint, ...]


def read_flight_file(text: str) -> FlightFile:
    """Read a file of either format, which its begin tells apart.

    Raises
    ------
    UnreadableFlight
        If it is neither, or broken.
    """
    stripped = text.lstrip("\ufeff").lstrip()
    if stripped.startswith("{"):
        return _plan(stripped)
    if stripped.startswith(_WPL):
        return _waypoint_file(stripped)
    raise UnreadableFlight(
        f"it begins with {stripped[:20]!r}; a .plan is a JSON object, and waypoints begin with {_WPL!r}"
    )


def _waypoint_file(text: str) -> FlightFile:
    rows = []
    for number, line in enumerate(text.splitlines()[1:], 2):
        if not line.strip() or line.startswith("#"):
            continue
        fields = line.split()
        if len(fields) != _COLUMNS:
            raise UnreadableFlight(f"line {number} has {len(fields)} columns, and needs {_COLUMNS}")
        rows.append(
            (int(_number(fields[3], f"line {number}, command")), _place(fields[8:10], f"line {number}"))
        )
    if not rows:
        raise UnreadableFlight("it has no waypoints")
    (_, home), *items = rows
    return FlightFile(home, tuple(Waypoint(n, command, place) for n, (command, place) in enumerate(items, 1)))


def _plan(text: str) -> FlightFile:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UnreadableFlight(f"it is no JSON: {error}") from None
    mission = content.get("mission")
    if content.get("fileType") != "Plan" or not isinstance(mission, dict):
        raise UnreadableFlight("it is no .plan: `fileType` is not 'Plan', or `mission` is no object")
    listed = mission.get("items")
    if not isinstance(listed, list):
        raise UnreadableFlight("`mission.items` is no list")
    home = mission.get("plannedHomePosition")
    at = None
    if isinstance(home, list) and len(home) > 1:
        at = _place(home[:2], "`mission.plannedHomePosition`")
    return FlightFile(at, tuple(_simple_items(listed)))


def _simple_items(listed: list[Any]) -> Iterator[Waypoint]:
    for number, item in enumerate(listed, 1):
        where = f"item {number}"
        if not isinstance(item, Mapping) or item.get("type") != "SimpleItem":
            kind = item.get("complexItemType") if isinstance(item, Mapping) else None
            what = f"a {kind!r}" if isinstance(kind, str) else "no object"
            raise UnreadableFlight(f"{where} is {what}; only simple items are read")
        params = item.get("params")
        if not isinstance(params, list) or len(params) != _PARAMETERS:
            raise UnreadableFlight(f"`params` of {where} is no list of {_PARAMETERS} numbers")
        command = int(_number(item.get("command"), f"`command` of {where}"))
        yield Waypoint(number, command, _place(params[_AT_LATITUDE : _AT_LONGITUDE + 1], where))


def _place(written: list[Any], where: str) -> Point:
    """Return longitude and latitude; files have them the other way round."""
    latitude, longitude = (_number(value, f"position of {where}") for value in written)
    for name, value, limit in (("latitude", latitude, 90.0), ("longitude", longitude, 180.0)):
        if abs(value) > limit:
            raise UnreadableFlight(f"{where}: {name} {value:g} is not in {-limit:g}..{limit:g}")
    return longitude, latitude


def _number(written: object, what: str) -> float:
    try:
        # QGroundControl writes null for what a command does not use.
        value = 0.0 if written is None else float(written)  # type: ignore[arg-type]  # that is found out here
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not math.isfinite(value) or isinstance(written, bool):
        raise UnreadableFlight(f"{what}: {written!r} is no number")
    return value
