"""From the messages of vehicles to positions of a mission's UAVs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.domain.geometry import distance
from app.mavlink.errors import UnknownVehicle

_CRS = "wgs84"
_DEGREES = 1e-7
_ARMED = 128
"""``MAV_MODE_FLAG_SAFETY_ARMED``."""
_ON_GROUND, _ALOFT = 1, frozenset({2, 3, 4})
"""``MAV_LANDED_STATE``: on the ground; in the air, taking off, landing."""
_GROUND_STATION = 6
"""``MAV_TYPE_GCS``."""
_CLIMBED_MM = 1_000
"""An armed vehicle that says nothing of landing is in the air from this height above its home on."""
_MOVED_KM = 0.005
"""Shorter moves are the noise of a position that stays."""


@dataclass(frozen=True, slots=True)
class MissionClock:
    """The clock of a mission by the clock on the wall.

    Attributes
    ----------
    clock
        Of the mission, in h.
    at_s
        When it is that, in seconds of the epoch.
    """

    clock: float
    at_s: float

    def at(self, time_s: float) -> float:
        """Return the mission's clock at a time, in h; no earlier than 0."""
        return max(0.0, self.clock + (time_s - self.at_s) / 3600.0)


def assigned(uav_ids: Sequence[str], given: Mapping[int, str]) -> dict[int, str]:
    """Return the UAV of each system id: as given, otherwise system n is the n-th UAV of the mission.

    Raises
    ------
    UnknownVehicle
        If one is given that the mission has not, or one is given twice.
    """
    if not given:
        return dict(enumerate(uav_ids, 1))
    seen: set[str] = set()
    for system, uav_id in given.items():
        if uav_id not in uav_ids:
            raise UnknownVehicle(system, uav_id, "is no UAV of the mission", uav_ids)
        if uav_id in seen:
            raise UnknownVehicle(system, uav_id, "is another system's already", uav_ids)
        seen.add(uav_id)
    return dict(given)


class Vehicle:
    """What is known of one vehicle by its messages.

    Parameters
    ----------
    uav_id
        Of the mission.
    measures
        Whether the distance over ground is the distance flown: in wind it is not.

    Attributes
    ----------
    component, autopilot
        Of its newest heartbeat: where missions are sent to, and ``MAV_AUTOPILOT``; None before it.
    """

    def __init__(self, uav_id: str, *, measures: bool = True) -> None:
        self.uav_id, self._measures = uav_id, measures
        self.component: int | None = None
        self.autopilot: int | None = None
        self._armed = False
        self._landed_state: int | None = None
        self._aloft: bool | None = None
        self._since_s: float | None = None
        self._flown_km = 0.0
        self._counted: tuple[float, float] | None = None

    def take(self, message: Any, time_s: float, clock: MissionClock) -> dict[str, Any] | None:
        """Take a message of the vehicle; return the position that it tells, if it tells one.

        The distance flown and the time in the air of a flight are told where its take-off was seen; otherwise
        they are as planned.
        """
        kind = message.get_type()
        if kind == "HEARTBEAT" and message.type != _GROUND_STATION:
            self.component, self.autopilot = message.get_srcComponent(), message.autopilot
            self._armed = bool(message.base_mode & _ARMED)
        elif kind == "EXTENDED_SYS_STATE" and message.landed_state:
            self._landed_state = message.landed_state
        elif kind == "GLOBAL_POSITION_INT" and (message.lat or message.lon):
            return self._position(message, time_s, clock)
        return None

    def _position(self, message: Any, time_s: float, clock: MissionClock) -> dict[str, Any]:
        x, y = message.lon * _DEGREES, message.lat * _DEGREES
        self._follow_flight(self._is_aloft(message), (x, y), time_s)
        told: dict[str, Any] = {"uav_id": self.uav_id, "time": clock.at(time_s), "x": x, "y": y}
        if self._since_s is not None:
            told["airborne"] = (time_s - self._since_s) / 3600.0
            if self._measures:
                told["dis"] = self._flown_km
        return told

    def _is_aloft(self, message: Any) -> bool | None:
        if self._landed_state in _ALOFT:
            return True
        if self._landed_state == _ON_GROUND:
            return False
        return None if self.autopilot is None else self._armed and message.relative_alt >= _CLIMBED_MM

    def _follow_flight(self, aloft: bool | None, place: tuple[float, float], time_s: float) -> None:
        if aloft and self._aloft is False:
            self._since_s, self._flown_km, self._counted = time_s, 0.0, place
        elif aloft is False:
            self._since_s = None
        self._aloft = aloft
        if self._since_s is not None and self._counted is not None:
            moved = distance(_CRS, *self._counted, *place)
            if moved >= _MOVED_KM:
                self._flown_km += moved
                self._counted = place
