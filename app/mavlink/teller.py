"""What goes to the service and comes from it: positions in batches, the clock, the flights of the plan."""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable, Mapping
from typing import Any

from app.api.plan_formats.flights import Flight
from app.mavlink.errors import ServiceAway, ServiceRefused
from app.mavlink.flights import next_flights
from app.mavlink.service import MissionClient

PLAN_EVERY_S = 1.0
"""So often the mission is asked whether its plan has changed."""
RETRY_S = 1.0
_NOT_FOUND = 404


class Teller:
    """Tells a mission what vehicles say, at a limited rate, and has its flights.

    What could not be sent is sent again under its id before anything else, so that it counts once. Meanwhile
    only the newest position of each UAV is kept.

    Parameters
    ----------
    client
        The mission.
    every_s
        Seconds between two batches of positions, at least.
    clock_every_s
        Seconds between two events that move the mission's clock to the newest position; 0: none, as
        somebody else does that.
    say
        Told what is worth a line.
    watches_plan
        Whether flights are wanted.

    Attributes
    ----------
    flights
        The next flight of each UAV by its id, replaced as a whole; None until the plan is known.
    told
        How many positions the service has.
    """

    def __init__(
        self,
        client: MissionClient,
        *,
        every_s: float,
        clock_every_s: float,
        say: Callable[[str], None],
        watches_plan: bool,
    ) -> None:
        self._client, self._say = client, say
        self._every_s, self._clock_every_s, self._watches_plan = every_s, clock_every_s, watches_plan
        self._run = secrets.token_hex(8)
        self._numbers = 0
        self._lock = threading.Lock()
        self._positions: dict[str, dict[str, Any]] = {}
        self._unsent: dict[str, Any] | None = None
        self._due: dict[str, float] = {}
        self._seen_since_clock = False
        self._state_number: int | None = None
        self._was_away = False
        self._matrices: dict[str, Any] | None = None
        self.flights: Mapping[str, Flight] | None = None
        self.told = 0

    def see(self, position: dict[str, Any]) -> None:
        """Take a position that is to be told."""
        with self._lock:
            self._positions[position["uav_id"]] = position

    @property
    def is_behind(self) -> bool:
        """Whether something could not be sent yet."""
        return self._unsent is not None

    def step(self, now_s: float, *, all_of_it: bool = False) -> None:
        """Do what is due; what the service does not take now is done at a later step.

        Parameters
        ----------
        now_s
            By a clock that only goes forward.
        all_of_it
            Whether also what is not due yet, as at the end.

        Raises
        ------
        ServiceRefused
            If there is no such mission, or the key is refused.
        """
        try:
            self._send_again()
            if self._is_due("positions", self._every_s, now_s) or all_of_it:
                self._tell_positions()
            if self._clock_every_s and (self._is_due("clock", self._clock_every_s, now_s) or all_of_it):
                self._tell_clock()
            if self._watches_plan and self._is_due("plan", PLAN_EVERY_S, now_s):
                self._look_at_plan()
        except ServiceAway as error:
            if not self._was_away:
                self._say(f"{error}; it is tried again")
            self._was_away = True
            return
        if self._was_away:
            self._say("the service is there again")
        self._was_away = False

    def _is_due(self, what: str, every_s: float, now_s: float) -> bool:
        # The first clock is told after the first positions, not before.
        if now_s < self._due.setdefault(what, now_s + (every_s if what == "clock" else 0.0)):
            return False
        self._due[what] = now_s + every_s
        return True

    def _tell_positions(self) -> None:
        with self._lock:
            positions, self._positions = list(self._positions.values()), {}
        if positions:
            self._seen_since_clock = True
            self._tell({"type": "telemetry", "positions": positions})

    def _tell_clock(self) -> None:
        if self._seen_since_clock:
            self._seen_since_clock = False
            self._tell({"type": "clock"})

    def _tell(self, event: dict[str, Any]) -> None:
        self._numbers += 1
        self._unsent = {"id": f"fly-{self._run}-{self._numbers}", **event}
        self._send_again()

    def _send_again(self) -> None:
        if self._unsent is None:
            return
        event = self._unsent
        try:
            self._client.tell(event)
        except ServiceRefused as error:
            self._unsent = None
            if error.status in (401, 403, _NOT_FOUND):
                raise
            self._say(str(error))
            return
        self._unsent = None
        self.told += len(event.get("positions", ()))

    def _look_at_plan(self) -> None:
        head = self._client.mission()
        if head["state_number"] == self._state_number:
            return
        plan = self._client.plan()
        # An event that came between the two is seen at the next look.
        if plan["number"] == head["state_number"]:
            problem = head["state"]["problem"]
            if self._matrices is None and any(uav.get("location") is not None for uav in problem["uavs"]):
                self._matrices = self._client.matrices()
            self.flights = next_flights(head["state"], plan, self._matrices)
            self._state_number = head["state_number"]
