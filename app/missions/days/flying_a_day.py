"""One day with one way of replanning: events, states and plans as in the service, without its server."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.domain.records import problem_to_record, to_record
from app.jobs.worker import WorkContext
from app.missions import judging
from app.missions.days.kinds import LAST_SURPRISE, Day
from app.missions.days.truth import MOMENT, Delays, Ledger, Reports
from app.missions.effects import differences
from app.missions.state import Done, MissionState, Routes

_CONTEXT = WorkContext.in_process(lambda _progress: None)
_LONG_AFTER = 100.0


@dataclass(frozen=True, slots=True)
class Arm:
    """A way of replanning.

    Attributes
    ----------
    decide
        Gets the state, how many decisions there were before, and a generator; returns the routes that are to
        be in force from now on, or None for those that are.
    replans
        Whether it is asked again after the morning.
    ticks
        Whether it is also asked every so often though nothing has happened.
    """

    decide: Callable[[MissionState, int, np.random.Generator], Routes | None]
    replans: bool = True
    ticks: bool = False


@dataclass(frozen=True, slots=True)
class Decision:
    """What one decision took, and changed.

    Attributes
    ----------
    at
        On the mission's clock.
    seconds
        Of processor time.
    changed, left_out
        Pairs of UAV and area that are in only one of the plans before and after, and those that are only in
        the plan before.
    """

    at: float
    seconds: float
    changed: int
    left_out: int


@dataclass(frozen=True, slots=True)
class Flown:
    """A day that is over.

    Attributes
    ----------
    reward, satisfaction, distance
        What it has earned in truth.
    decisions
        In their order.
    done
        The stops that were made.
    """

    reward: float
    satisfaction: float
    distance: float
    decisions: tuple[Decision, ...]
    done: tuple[Done, ...]


TICK = 0.4
"""Time between two looks of an arm that looks though nothing has happened."""


class _Trial:
    def __init__(self, day: Day, arm: Arm, seed: int) -> None:
        self._day, self._arm, self._rng = day, arm, np.random.default_rng(seed)
        self._ledger, self._reports, self._delays = Ledger(day), Reports(day), Delays(day)
        self._decisions: list[Decision] = []
        problem = day.problem
        start = replace(problem, start_plan=((problem.n_targets,) * problem.n_uavs,))
        begun = judging.begin({"problem": problem_to_record(start)}, _CONTEXT).result
        self._state, self._plan = MissionState.from_record(begun["state"]), begun["plan"]
        self._delays.observe(self._state.problem, self._plan, self._state.done)

    def run(self) -> Flown:
        told = self._schedule()
        self._decide()
        while True:
            due = [at for at, _ in self._delays.due(self._plan).values()]
            unexpected = [*due, *self._delays.ends(self._plan), *self._checks()]
            at = min([*unexpected, *(each[0] for each in told[:1])], default=None)
            if at is None:
                break
            at = max(at, self._state.clock)
            wanted = self._go_on(at)
            while told and told[0][0] <= at:
                event = told.pop(0)[1]
                wanted |= self._happen(event) if event else self._arm.ticks
            if wanted and self._arm.replans:
                self._decide()
        self._go_on(self._state.clock + _LONG_AFTER)
        ledger = self._ledger
        return Flown(
            ledger.reward, ledger.satisfaction, ledger.flown, tuple(self._decisions), self._state.done
        )

    def _schedule(self) -> list[tuple[float, dict[str, Any] | None]]:
        """Return what will be told, and when; None is a look at the clock."""
        day = self._day
        told: list[tuple[float, dict[str, Any] | None]] = [
            (at, {"type": "areas_added", "targets": [to_record(day.reports[area])]})
            for area, at in day.appears.items()
        ]
        told += [(at, {"type": "uav_lost", "uav_id": uav}) for uav, at in day.lost.items()]
        told += [(at, {"type": "message", "target_id": area}) for area, at in day.corrected.items()]
        if self._arm.ticks:
            told += [(TICK * k, None) for k in range(1, 1 + int(LAST_SURPRISE / TICK))]
        return sorted(told, key=lambda each: each[0])

    def _checks(self) -> list[float]:
        """Return when UAVs will find that an area is not as it is reported."""
        return [
            stop["begin_time"] + MOMENT
            for route in self._plan["routes"]
            for stop in route["stops"]
            if stop.get("target_id") in self._reports.believed
        ]

    def _go_on(self, at: float) -> bool:
        """Let time pass until a moment, and tell what has turned out until then."""
        held_up = {i: until for i, (due, until) in self._delays.due(self._plan).items() if due <= at}
        begun = self._apply({"type": "clock"}, at)
        wanted = False
        loads = {uav.id: uav.loadlist for uav in self._state.problem.uavs}
        for each in begun:
            load = each.amounts
            if each.stop.id in self._reports.believed:
                # It is the last stop of its UAV: time passes no further than to it.
                load = tuple(map(sum, zip(each.amounts, loads[each.uav_id], strict=True)))
            amounts = self._ledger.unload(each.stop.id, load)
            if amounts != each.amounts:
                report = {"type": "visit_done", "uav_id": each.uav_id, "target_id": each.stop.id}
                wanted |= self._tell({**report, "delivered": list(amounts), "time": each.time})
            wanted |= self._correct(each.stop.id)
        for uav_id, until in held_up.items():
            self._delays.tell(uav_id)
            wanted |= self._tell({"type": "uav_delayed", "uav_id": uav_id, "until": until})
        return wanted

    def _happen(self, event: dict[str, Any]) -> bool:
        return self._correct(event["target_id"]) if event["type"] == "message" else self._tell(event)

    def _correct(self, area_id: str) -> bool:
        event = self._reports.correct(area_id, self._state.problem, self._ledger.left[area_id])
        return event is not None and self._tell(event)

    def _tell(self, event: dict[str, Any]) -> bool:
        self._apply(event, self._state.clock)
        return bool(self._wants_plan)

    def _apply(
        self, event: dict[str, Any], at: float, proposal: Mapping[str, Any] | None = None
    ) -> list[Done]:
        """Let an event take effect; return the visits that have begun meanwhile."""
        before = len(self._state.done)
        payload = {
            "state": self._state.to_record(), "matrices": None, "event": event, "at": at, "positions": {},
            "proposal": proposal,
        }  # fmt: skip
        after = judging.apply(payload, _CONTEXT).result
        self._state, self._plan = MissionState.from_record(after["state"]), after["plan"]
        self._wants_plan = after["wants_plan"]
        begun = self._state.done[before:]
        self._ledger.fly(self._state, begun)
        self._delays.observe(self._state.problem, self._plan, self._state.done)
        return [each for each in begun if not each.stop.is_base]

    def _decide(self) -> None:
        state, number = self._state, len(self._decisions)
        started = time.process_time()
        routes = self._arm.decide(state, number, self._rng)
        seconds = time.process_time() - started
        changed = left_out = 0
        if routes is not None and routes != state.routes:
            ids = [uav.id for uav in state.problem.uavs]
            found = differences(ids, state.routes, routes)
            changed = found["visits_changed"]
            left_out = sum("target_id" in stop for uav in found["uavs"] for stop in uav["removed"])
            stops = [[stop.to_record() for stop in route] for route in routes]
            self._apply(
                {"type": "proposal_accepted", "proposal": 1},
                state.clock,
                {"stops": stops, "done": len(state.done)},
            )
        self._decisions.append(Decision(state.clock, seconds, changed, left_out))


def fly_day(day: Day, arm: Arm, seed: int) -> Flown:
    """Let a day happen with a way of replanning.

    Parameters
    ----------
    day
        The day.
    arm
        Who plans.
    seed
        Of what the arm draws.
    """
    return _Trial(day, arm, seed).run()
