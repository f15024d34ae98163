"""The mission protocol of MAVLink, on the side that has the mission: it is asked for item by item.

https://mavlink.io/en/services/mission.html
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from app.api.plan_formats.mission import MissionItem

ANSWER_WITHIN_S = 1.5
"""So long a vehicle is waited for before what was sent last is sent again."""
TRIES = 5
"""So often the same is sent before a transfer is given up."""
_ACCEPTED = 0
"""``MAV_MISSION_ACCEPTED``."""
_MISSION = 0
"""``MAV_MISSION_TYPE_MISSION``."""
_SCALE = 1e7
"""Degrees are sent as whole numbers."""

Send = Callable[[str, dict[str, Any]], None]
"""Sends a message, by the name of its type and its fields."""


class Transfer:
    """One mission on its way to one vehicle.

    Parameters
    ----------
    items
        All of the mission; may be none.
    send
        Sends messages to the vehicle.
    now_s
        By a clock that only goes forward.

    Attributes
    ----------
    outcome
        None while it is under way; empty when the vehicle has taken the mission; otherwise why it has not.
    """

    def __init__(self, items: Sequence[MissionItem], send: Send, now_s: float) -> None:
        self._items, self._send = items, send
        self._tries = 0
        self.outcome: str | None = None
        self._say("MISSION_COUNT", {"count": len(items), "mission_type": _MISSION}, now_s)

    def take(self, message: Any, now_s: float) -> None:
        """Take a message of the vehicle; those that are not about its mission are passed over."""
        if self.outcome is not None or getattr(message, "mission_type", _MISSION) != _MISSION:
            return
        kind = message.get_type()
        if kind in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            if message.seq < len(self._items):
                self._tries = 0
                self._say("MISSION_ITEM_INT", item_fields(message.seq, self._items[message.seq]), now_s)
        elif kind == "MISSION_REQUEST_LIST":
            self._tries = 0
            self._say("MISSION_COUNT", {"count": len(self._items), "mission_type": _MISSION}, now_s)
        elif kind == "MISSION_ACK":
            self.outcome = (
                "" if message.type == _ACCEPTED else f"the vehicle refuses it (result {message.type})"
            )

    def look(self, now_s: float) -> None:
        """Send again what the vehicle has not answered in time, or give up."""
        if self.outcome is not None or now_s < self._due_s:
            return
        if self._tries >= TRIES:
            self.outcome = f"the vehicle does not answer: {self._last[0]} was sent {TRIES} times"
        else:
            self._say(*self._last, now_s)

    def _say(self, kind: str, fields: dict[str, Any], now_s: float) -> None:
        self._last = (kind, fields)
        self._due_s = now_s + ANSWER_WITHIN_S
        self._tries += 1
        self._send(kind, fields)


def item_fields(seq: int, item: MissionItem) -> dict[str, Any]:
    """Return the fields of ``MISSION_ITEM_INT``; NaN leaves a heading to the autopilot.

    Parameters
    ----------
    seq
        Its place in the mission, from 0.
    item
        As flight files have it.
    """
    longitude, latitude, altitude = item.place or (0.0, 0.0, 0.0)
    names = ("param1", "param2", "param3", "param4")
    return {
        "seq": seq,
        "frame": item.frame.value,
        "command": item.command.value,
        "current": int(seq == 0),
        "autocontinue": 1,
        **dict(zip(names, item.params, strict=True)),
        "x": math.floor(latitude * _SCALE + 0.5),
        "y": math.floor(longitude * _SCALE + 0.5),
        "z": altitude,
        "mission_type": _MISSION,
    }
