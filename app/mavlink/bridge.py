"""Between vehicles and a mission: their telemetry to the service, the flights of its plan to them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Thread
from typing import Any

from app.api.plan_formats.errors import OutOfRange
from app.api.plan_formats.flights import Flight
from app.api.plan_formats.mission import FlightChoices
from app.mavlink.flights import goes_on, items_for, require_geographic, stops_of
from app.mavlink.service import MissionClient
from app.mavlink.streams import SYSTEM, UdpStream, read_telemetry_log
from app.mavlink.teller import RETRY_S, Teller
from app.mavlink.transfer import Send, Transfer
from app.mavlink.vehicles import MissionClock, Vehicle, assigned

_ALIVE_EVERY_S = 1.0
_LISTEN_S = 0.05
_RETRY_UPLOAD_S = 10.0
"""So much later an upload that has failed is tried again."""

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Choices:
    """What a bridge is to do.

    Attributes
    ----------
    systems
        UAVs by system ids; empty: system n is the n-th UAV.
    began_s
        When the mission's clock was 0, in seconds of the epoch; None: the clock is now what the mission says.
    every_s, clock_every_s
        See :class:`~app.mavlink.teller.Teller`.
    upload
        Whether vehicles get their flights without asking, at first and whenever the plan gives them another.
    flight
        What a plan leaves open and a flight has to say.
    """

    systems: Mapping[int, str]
    began_s: float | None = None
    every_s: float = 1.0
    clock_every_s: float = 10.0
    upload: bool = False
    flight: FlightChoices = field(default_factory=FlightChoices)


class _Fleet:
    """The vehicles of a mission."""

    def __init__(self, head: Mapping[str, Any], choices: Choices, say: Say) -> None:
        problem = head["state"]["problem"]
        require_geographic(problem)
        self._say = say
        self._uavs = assigned([uav["id"] for uav in problem["uavs"]], choices.systems)
        wind = problem.get("wind")
        self._measures = wind is None or not wind["speed"]
        self.known: dict[int, Vehicle] = {}
        self._strangers: set[int] = set()

    def of(self, system: int) -> Vehicle | None:
        """Return the vehicle of a system id; None where it is of none."""
        if system in self.known:
            return self.known[system]
        uav_id = self._uavs.get(system)
        if uav_id is not None:
            self._say(f"system {system} is {uav_id!r}")
            self.known[system] = Vehicle(uav_id, measures=self._measures)
            return self.known[system]
        if system not in self._strangers:
            self._strangers.add(system)
            self._say(f"system {system} is no UAV of the mission, and is passed over")
        return None


def _clock_of(head: Mapping[str, Any], choices: Choices, now_s: float) -> MissionClock:
    return (
        MissionClock(head["clock"], now_s) if choices.began_s is None else MissionClock(0.0, choices.began_s)
    )


def read_log(file: Path, client: MissionClient, choices: Choices, say: Say) -> int:
    """Tell a mission all that a telemetry log has, as fast as the service takes it.

    Parameters
    ----------
    file
        A ``.tlog``: MAVLink messages, each with its time.
    client, choices, say
        As of :func:`fly`. Times and rates are those of the log.

    Returns
    -------
    int
        How many positions the service has got.

    Raises
    ------
    LinkFailed
        If it cannot be read.
    """
    head = client.mission()
    fleet = _Fleet(head, choices, say)
    teller = Teller(
        client, every_s=choices.every_s, clock_every_s=choices.clock_every_s, say=say, watches_plan=False
    )
    clock: MissionClock | None = None
    now_s = 0.0
    for time_s, message in read_telemetry_log(file):
        now_s = max(now_s, time_s)
        clock = clock or _clock_of(head, choices, now_s)
        vehicle = fleet.of(message.get_srcSystem())
        position = vehicle.take(message, time_s, clock) if vehicle else None
        if position is not None:
            teller.see(position)
            _step_until_sent(teller, now_s)
    _step_until_sent(teller, now_s, all_of_it=True)
    return teller.told


def _step_until_sent(teller: Teller, now_s: float, *, all_of_it: bool = False) -> None:
    teller.step(now_s, all_of_it=all_of_it)
    while teller.is_behind:
        time.sleep(RETRY_S)
        teller.step(now_s, all_of_it=all_of_it)


def fly(stream: UdpStream, client: MissionClient, choices: Choices, say: Say, stop: Event) -> int:
    """Bring together vehicles and a mission until it is stopped.

    Parameters
    ----------
    stream
        Where the vehicles are.
    client
        The mission.
    choices
        See there.
    say
        Told what is worth a line.
    stop
        Ends it.

    Returns
    -------
    int
        How many positions the service has got.

    Raises
    ------
    ServiceAway
        If it cannot be reached at the beginning; later that is waited for.
    ServiceRefused, NotGeographic, UnknownVehicle
        If the mission is none for this, or is no more.
    """
    head = client.mission()
    bridge = _Bridge(stream, client, choices, say, head)
    bridge.run(stop)
    return bridge.teller.told


class _Bridge:
    """Messages in a loop; the service in a thread, so that a slow one keeps no vehicle waiting."""

    def __init__(
        self, stream: UdpStream, client: MissionClient, choices: Choices, say: Say, head: Mapping[str, Any]
    ) -> None:
        self._stream, self._choices, self._say = stream, choices, say
        self._fleet = _Fleet(head, choices, say)
        self._clock = _clock_of(head, choices, time.time())
        self.teller = Teller(
            client, every_s=choices.every_s, clock_every_s=choices.clock_every_s, say=say, watches_plan=True
        )
        self._transfers: dict[int, Transfer] = {}
        self._flying: dict[int, tuple[str, ...]] = {}
        self._not_before: dict[int, float] = {}
        self._failed: Exception | None = None

    def run(self, stop: Event) -> None:
        """Go on until it is stopped, or the service refuses for good."""
        ended = Event()
        telling = Thread(target=self._tell, args=(ended,), name="teller")
        telling.start()
        alive_s = 0.0
        try:
            while not stop.is_set() and telling.is_alive():
                now_s = time.monotonic()
                if now_s >= alive_s:
                    alive_s = now_s + _ALIVE_EVERY_S
                    self._stream.say_alive()
                for message in self._stream.receive(_LISTEN_S):
                    self._take(message)
                self._offer(now_s)
                self._look_at_transfers(now_s)
        finally:
            ended.set()
            telling.join()
        if self._failed is not None:
            raise self._failed

    def _tell(self, ended: Event) -> None:
        try:
            while not ended.wait(RETRY_S if self.teller.is_behind else _LISTEN_S):
                self.teller.step(time.monotonic())
            self.teller.step(time.monotonic(), all_of_it=True)
        except Exception as error:  # told to who runs the bridge
            self._failed = error

    def _take(self, message: Any) -> None:
        system = message.get_srcSystem()
        vehicle = self._fleet.of(system) if system != SYSTEM else None
        if vehicle is None:
            return
        position = vehicle.take(message, time.time(), self._clock)
        if position is not None:
            self.teller.see(position)
        if getattr(message, "target_system", None) == SYSTEM:
            now_s = time.monotonic()
            if system in self._transfers:
                self._transfers[system].take(message, now_s)
            elif message.get_type() == "MISSION_REQUEST_LIST" and self.teller.flights is not None:
                # Until the plan is known there is no answer: a mission of no items would be a wrong one.
                flight = self.teller.flights.get(vehicle.uav_id)
                self._begin(system, vehicle, message.get_srcComponent(), flight, now_s)

    def _offer(self, now_s: float) -> None:
        """Offer a flight to every vehicle that the plan gives another one than it has."""
        flights = self.teller.flights
        if not self._choices.upload or flights is None:
            return
        for system, vehicle in self._fleet.known.items():
            flight = flights.get(vehicle.uav_id)
            if flight is None or vehicle.component is None or system in self._transfers:
                continue
            if goes_on(self._flying.get(system, ()), stops_of(flight)):
                continue
            if now_s >= self._not_before.get(system, 0.0):
                self._begin(system, vehicle, vehicle.component, flight, now_s)

    def _begin(
        self, system: int, vehicle: Vehicle, component: int, flight: Flight | None, now_s: float
    ) -> None:
        self._not_before[system] = now_s + _RETRY_UPLOAD_S
        try:
            items = () if flight is None else items_for(flight, self._choices.flight, vehicle.autopilot)
        except OutOfRange as error:
            self._say(f"{vehicle.uav_id!r} cannot be given its flight: {error.detail}")
            return
        self._transfers[system] = Transfer(items, self._sender(system, component), now_s)
        self._flying[system] = () if flight is None else stops_of(flight)

    def _sender(self, system: int, component: int) -> Send:
        def send(kind: str, fields: dict[str, Any]) -> None:
            whole = {"target_system": system, "target_component": component, **fields}
            self._stream.send(system, kind, whole)

        return send

    def _look_at_transfers(self, now_s: float) -> None:
        for system, transfer in list(self._transfers.items()):
            transfer.look(now_s)
            if transfer.outcome is None:
                continue
            del self._transfers[system]
            uav_id = self._fleet.known[system].uav_id
            if transfer.outcome:
                self._say(f"{uav_id!r} has not got its flight: {transfer.outcome}")
                with suppress(KeyError):
                    del self._flying[system]
            else:
                where = " → ".join(self._flying[system]) or "nothing"
                self._say(f"{uav_id!r} has its flight: {where}")
