"""A vehicle made with pymavlink, which flies a circle, speaks the mission protocol and loses messages.

It is written from the description of the protocol and shares no code with the program. It is no autopilot: it
knows nothing of what its mission means.
"""

from __future__ import annotations

import math
import random
import socket
import threading
import time
from typing import Any

from pymavlink.dialects.v20 import common

GROUND_STATION = 255
_EVERY_S = 0.05
_ANSWER_WITHIN_S = 0.1
_PATIENCE_S = 60.0


class SimulatedVehicle:
    """One vehicle that sends to a port of the loopback interface.

    Parameters
    ----------
    system
        Its system id.
    port
        Where the ground station listens.
    home
        Longitude and latitude.
    lost
        Share of the messages that are lost, each way.
    autopilot
        ``MAV_AUTOPILOT``.
    refuses
        Whether it refuses every mission.

    Attributes
    ----------
    missions
        The missions that it has taken, each as its items, the newest last.
    """

    def __init__(
        self,
        system: int,
        port: int,
        home: tuple[float, float],
        *,
        lost: float = 0.0,
        autopilot: int = common.MAV_AUTOPILOT_ARDUPILOTMEGA,
        refuses: bool = False,
    ) -> None:
        self.system, self.home, self._autopilot, self._refuses = system, home, autopilot, refuses
        self._to = ("127.0.0.1", port)
        self._lost, self._random = lost, random.Random(system)
        self._mav = common.MAVLink(self, srcSystem=system, srcComponent=common.MAV_COMP_ID_AUTOPILOT1)
        self._mav.robust_parsing = True
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.01)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)
        self.missions: list[list[Any]] = []
        self.aloft = False
        self.asks = False
        self._items: list[Any] = []
        self._count: int | None = None
        self._asked_s = 0.0

    def __enter__(self) -> SimulatedVehicle:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def await_missions(self, count: int) -> list[Any]:
        """Wait until it has taken so many missions; return the newest."""
        end = time.monotonic() + _PATIENCE_S
        while len(self.missions) < count:
            assert time.monotonic() < end, f"{len(self.missions)} missions of {count} have come"
            self._ended.wait(0.02)
        return self.missions[-1]

    def write(self, data: bytes) -> None:
        """Send, unless it is lost; called by pymavlink."""
        if self._random.random() >= self._lost:
            self._socket.sendto(data, self._to)

    def _live(self) -> None:
        told_s = 0.0
        while not self._ended.is_set():
            now_s = time.monotonic()
            if now_s >= told_s + _EVERY_S:
                told_s = now_s
                self._tell(now_s)
            self._hear()
            self._ask(now_s)

    def _tell(self, now_s: float) -> None:
        mode = common.MAV_MODE_FLAG_SAFETY_ARMED if self.aloft else 0
        self._mav.heartbeat_send(common.MAV_TYPE_QUADROTOR, self._autopilot, mode, 0, common.MAV_STATE_ACTIVE)
        landed = common.MAV_LANDED_STATE_IN_AIR if self.aloft else common.MAV_LANDED_STATE_ON_GROUND
        self._mav.extended_sys_state_send(common.MAV_VTOL_STATE_UNDEFINED, landed)
        aside = 0.001 * math.sin(now_s) if self.aloft else 0.0
        place = (round((self.home[1] + aside) * 1e7), round(self.home[0] * 1e7))
        height = 50_000 if self.aloft else 0
        self._mav.global_position_int_send(int(now_s * 1e3) % 2**32, *place, height, height, 0, 0, 0, 0)

    def _hear(self) -> None:
        try:
            data = self._socket.recv(65_535)
        except (TimeoutError, ConnectionError):
            return
        for message in self._mav.parse_buffer(data) or ():
            if message.get_type() == "BAD_DATA" or self._random.random() < self._lost:
                continue
            if getattr(message, "target_system", self.system) == self.system:
                self._take(message)

    def _take(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "MISSION_COUNT" and self._refuses:
            self._acknowledge(common.MAV_MISSION_NO_SPACE)
        elif kind == "MISSION_COUNT" and self._count is None:
            self.asks, self._count, self._items, self._asked_s = False, message.count, [], 0.0
            self._end_if_complete()
        elif kind == "MISSION_ITEM_INT":
            if self._count is None:
                # Sent again, as the acknowledgement was lost.
                self._acknowledge(common.MAV_MISSION_ACCEPTED)
            elif message.seq == len(self._items):
                self._items.append(message)
                self._asked_s = 0.0
                self._end_if_complete()

    def _end_if_complete(self) -> None:
        if len(self._items) == self._count:
            self._count = None
            self.missions.append(self._items)
            self._acknowledge(common.MAV_MISSION_ACCEPTED)

    def _acknowledge(self, result: int) -> None:
        self._mav.mission_ack_send(GROUND_STATION, 0, result, common.MAV_MISSION_TYPE_MISSION)

    def _ask(self, now_s: float) -> None:
        if now_s < self._asked_s + _ANSWER_WITHIN_S:
            return
        self._asked_s = now_s
        if self._count is not None:
            self._mav.mission_request_int_send(
                GROUND_STATION, 0, len(self._items), common.MAV_MISSION_TYPE_MISSION
            )
        elif self.asks:
            self._mav.mission_request_list_send(GROUND_STATION, 0, common.MAV_MISSION_TYPE_MISSION)
