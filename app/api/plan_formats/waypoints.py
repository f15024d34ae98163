"""Flight files as they are read: QGroundControl's ``.plan`` (JSON) and ``QGC WPL 110`` (columns)."""

from __future__ import annotations

import json
import math
import reprlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from app.api.plan_formats.flights import Point
from app.domain.said import Said, noun, said

_WPL = "QGC WPL 110"
_COLUMNS = 12
_PARAMETERS = 7
_AT_LATITUDE, _AT_LONGITUDE = 4, 5


class UnreadableFlight(ValueError):
    """A text is no flight file; the message says where and why."""

    def __init__(self, detail: Said) -> None:
        super().__init__(detail)
        self.detail = detail


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
        said(
            "it begins with {begin!r}; a .plan is a JSON object, and waypoints begin with {wpl!r}",
            begin=stripped[:20],
            wpl=_WPL,
        )
    )


def _waypoint_file(text: str) -> FlightFile:
    rows = []
    for number, line in enumerate(text.splitlines()[1:], 2):
        if not line.strip() or line.startswith("#"):
            continue
        fields = line.split()
        if len(fields) != _COLUMNS:
            raise UnreadableFlight(
                said(
                    "line {number} has {count} columns, and needs {columns}",
                    number=number,
                    count=len(fields),
                    columns=_COLUMNS,
                )
            )
        command = _number(fields[3], said("line {number}, command", number=number))
        rows.append((int(command), _place(fields[8:10], said("line {number}", number=number))))
    if not rows:
        raise UnreadableFlight(said("it has no waypoints"))
    (_, home), *items = rows
    return FlightFile(home, tuple(Waypoint(n, command, place) for n, (command, place) in enumerate(items, 1)))


def _plan(text: str) -> FlightFile:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UnreadableFlight(said("it is no JSON: {why}", why=str(error))) from None
    mission = content.get("mission")
    if content.get("fileType") != "Plan" or not isinstance(mission, dict):
        raise UnreadableFlight(said("it is no .plan: `fileType` is not 'Plan', or `mission` is no object"))
    listed = mission.get("items")
    if not isinstance(listed, list):
        raise UnreadableFlight(said("`mission.items` is no list"))
    home = mission.get("plannedHomePosition")
    at = None
    if isinstance(home, list) and len(home) > 1:
        at = _place(home[:2], "`mission.plannedHomePosition`")
    return FlightFile(at, tuple(_simple_items(listed)))


def _simple_items(listed: list[Any]) -> Iterator[Waypoint]:
    for number, item in enumerate(listed, 1):
        if not isinstance(item, Mapping) or item.get("type") != "SimpleItem":
            raise UnreadableFlight(_no_simple_item(number, item))
        params = item.get("params")
        if not isinstance(params, list) or len(params) != _PARAMETERS:
            raise UnreadableFlight(
                said(
                    "`params` of item {number} is no list of {count} numbers",
                    number=number,
                    count=_PARAMETERS,
                )
            )
        command = int(_number(item.get("command"), said("`command` of item {number}", number=number)))
        place = _place(params[_AT_LATITUDE : _AT_LONGITUDE + 1], said("item {number}", number=number))
        yield Waypoint(number, command, place)


def _no_simple_item(number: int, item: object) -> Said:
    kind = item.get("complexItemType") if isinstance(item, Mapping) else None
    if isinstance(kind, str):
        return said("item {number} is a {kind!r}; only simple items are read", number=number, kind=kind)
    return said("item {number} is no object; only simple items are read", number=number)


def _place(written: list[Any], where: str) -> Point:
    """Return longitude and latitude; files have them the other way round."""
    latitude, longitude = (_number(value, said("position of {where}", where=where)) for value in written)
    for name, value, limit in (
        (noun("latitude"), latitude, 90.0),
        (noun("longitude"), longitude, 180.0),
    ):
        if abs(value) > limit:
            raise UnreadableFlight(
                said(
                    "{where}: {name} {value:g} is not in {low:g}..{high:g}",
                    where=where,
                    name=name,
                    value=value,
                    low=-limit,
                    high=limit,
                )
            )
    return longitude, latitude


def _number(written: object, what: str) -> float:
    try:
        # QGroundControl writes null for what a command does not use.
        value = 0.0 if written is None else float(written)  # type: ignore[arg-type]  # that is found out here
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not math.isfinite(value) or isinstance(written, bool):
        raise UnreadableFlight(said("{what}: {entry} is no number", what=what, entry=reprlib.repr(written)))
    return value
