"""What truly happens on a day, and what it earns.

UAVs fly and visit as the plan in force says, but where they are held up, unload what is really needed, or
are lost. On a leg that takes longer a UAV is held up at the end, so positions are as planned until then,
and the delay is known when it should have arrived.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from app.domain.geometry import distance
from app.domain.problem import Problem
from app.missions.days.kinds import Day
from app.missions.state import Done, MissionState, Stop

MOMENT = 1e-6
"""How long before it should arrive a UAV says that it is held up, and how long after a visit has begun it
says what it has found."""

_SHORTEST_DELAY = 1e-4


class Ledger:
    """What has been delivered and flown on a day so far.

    Parameters
    ----------
    day
        The day.

    Attributes
    ----------
    left
        What each area still needs in truth, one amount a material, by its id.
    satisfaction, flown
        What the deliveries have earned, and the length of all ways flown, those home among them.
    """

    def __init__(self, day: Day) -> None:
        self.left = {each.id: list(each.loadlist) for each in day.areas.values()}
        self.satisfaction, self.flown = 0.0, 0.0
        self._day = day
        self._places = {uav.id: (uav.x_c, uav.y_c) for uav in day.problem.uavs}

    @property
    def reward(self) -> float:
        """What the day has earned."""
        return self.satisfaction - self._day.problem.distance_weight * self.flown

    def unload(self, area_id: str, load: Sequence[float]) -> tuple[float, ...]:
        """Let a UAV visit an area; return what it unloads: all that is needed, as far as it has it."""
        area, left = self._day.areas[area_id], self.left[area_id]
        amounts = tuple(map(min, load, left))
        self.left[area_id] = [need - amount for need, amount in zip(left, amounts, strict=True)]
        if any(area.loadlist):
            self.satisfaction += area.level * sum(amounts) / sum(area.loadlist)
        return amounts

    def fly(self, after: MissionState, begun: Sequence[Done]) -> None:
        """Count the ways since the last state: by the stops that have begun, to where UAVs are."""
        problem = after.problem
        stops = {Stop(each.id): (each.x, each.y) for each in problem.targets}
        stops |= {Stop(each.id, True): (each.x, each.y) for each in problem.bases}
        for uav in problem.uavs:
            visited = [stops[each.stop] for each in begun if each.uav_id == uav.id]
            way = [self._places[uav.id], *visited, (uav.x_c, uav.y_c)]
            self.flown += sum(distance(problem.crs, *a, *b) for a, b in pairwise(way))
            self._places[uav.id] = way[-1]


class Reports:
    """Which of the first reports are still believed, and what is told once they are found to be wrong."""

    def __init__(self, day: Day) -> None:
        self._day = day
        self.believed = set(day.corrected)

    def correct(self, area_id: str, problem: Problem, left: Sequence[float]) -> dict[str, Any] | None:
        """Return the event that says how an area really is; None if that is known."""
        if area_id not in self.believed:
            return None
        self.believed.remove(area_id)
        known = next((each for each in problem.targets if each.id == area_id), None)
        if known is None:
            return None
        now = self._day.areas[area_id]
        if not any(now.loadlist):
            return {"type": "area_cancelled", "target_id": area_id}
        changed = {
            "id": area_id,
            "x": known.x,
            "y": known.y,
            "level": now.level,
            "loadlist": list(left),
            "requested": list(now.loadlist),
            "deadline": known.deadline,
            "service_time": known.service_time,
            "earliest": known.earliest,
        }
        return {"type": "areas_changed", "targets": [changed]}


class Delays:
    """Which legs are under way, and how long they really take."""

    def __init__(self, day: Day) -> None:
        self._slowness = day.slowness
        self._legs: dict[str, tuple[tuple[str, int], float]] = {}
        self._told: set[str] = set()

    def observe(self, problem: Problem, plan: Mapping[str, Any], done: Sequence[Done]) -> None:
        """Note the legs that UAVs are on, or begin next; they are as long as when they are first planned."""
        for uav, route in zip(problem.uavs, plan["routes"], strict=True):
            if not route["stops"]:
                self._legs.pop(uav.id, None)
                continue
            first = route["stops"][0]
            which = (_id_of(first), sum(each.uav_id == uav.id for each in done))
            if self._legs.get(uav.id, (None, 0.0))[0] != which:
                self._legs[uav.id] = (which, first["distance"] / uav.speed)
                self._told.discard(uav.id)

    def due(self, plan: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
        """Return for each UAV that will say that it is held up when it does, and until when it is."""
        found = {}
        for route in plan["routes"]:
            uav_id = route["uav_id"]
            if uav_id not in self._legs or uav_id in self._told:
                continue
            (stop, _), lasts = self._legs[uav_id]
            longer = (self._slowness.get((uav_id, stop), 1.0) - 1.0) * lasts
            if longer > _SHORTEST_DELAY:
                at = route["stops"][0]["arrival_time"] - MOMENT
                found[uav_id] = (at, at + longer)
        return found

    def ends(self, plan: Mapping[str, Any]) -> list[float]:
        """Return when legs end after which others begin, which are to be noted then."""
        if not self._slowness:
            return []
        firsts = (route["stops"][0] for route in plan["routes"] if len(route["stops"]) > 1)
        return [first.get("begin_time", first["arrival_time"]) + MOMENT for first in firsts]

    def tell(self, uav_id: str) -> None:
        """Note that a UAV has said that it is held up on its leg."""
        self._told.add(uav_id)


def _id_of(stop: Mapping[str, Any]) -> str:
    return Stop.from_record(stop).id
