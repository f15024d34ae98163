"""How large the problem of a mission may become."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.domain.said import noun, said
from app.missions import events
from app.missions.errors import EventRefused

_CALLED = {
    "uavs": noun("UAVs"),
    "targets": noun("targets"),
    "no_fly_zones": noun("no-fly zones"),
    "zone_corners": noun("corners of no-fly zones"),
}
"""What is counted."""


def require_sizes(problem: Mapping[str, Any], event: events.Event, largest: Mapping[str, int]) -> None:
    """Refuse an event that would make a problem larger than is taken.

    Parameters
    ----------
    problem
        Record of what remains before the event.
    event
        What has happened.
    largest
        How many ``uavs``, ``targets``, ``no_fly_zones`` and ``zone_corners`` a problem may have.

    Raises
    ------
    EventRefused
        With the size that there would be, and the limit.
    """
    added: dict[str, int] = {}
    if isinstance(event, events.UavsAdded):
        added["uavs"] = len(problem["uavs"]) + len(event.uavs)
    elif isinstance(event, events.AreasAdded):
        added["targets"] = len(problem["targets"]) + len(event.targets)
    elif isinstance(event, events.ZonesChanged):
        added["no_fly_zones"] = len(event.no_fly_zones)
        added["zone_corners"] = sum(len(zone.polygon) for zone in event.no_fly_zones)
    for name, size in added.items():
        if size > largest[name]:
            pointer = "/no_fly_zones" if name == "zone_corners" else f"/{name}"
            detail = said(
                "{count} {items} with those there are, at most {most} are taken",
                count=size,
                items=_CALLED[name],
                most=largest[name],
            )
            raise EventRefused.at(pointer, detail)
