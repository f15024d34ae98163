"""A state of a mission while an event changes it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from app.domain.allocation import LandingRoute
from app.domain.errors import InvalidProblem, Violation
from app.domain.problem import Problem
from app.domain.said import Said, noun, said
from app.missions.effects import GONE, Broken
from app.missions.errors import EventRefused
from app.missions.state import Done, MissionState, Stop, without_plan

Into = Callable[[str, int | None, str], str | None]
"""Gets a field of the problem, the place in it, and what follows in a pointer; returns the pointer into the
event, None where no field of it is at fault."""


@dataclass
class Draft:
    """A state that is being changed.

    Attributes
    ----------
    clock
        Of the event.
    problem
        What remains, with no plan.
    routes
        The stops of the plan in force, those of each UAV.
    done, lost, cancelled
        As of :class:`~app.missions.state.MissionState`.
    timed
        The plan in force before the event, with its times.
    gone
        Stops that were dropped because there is no use in them.
    as_planned
        Whether the event says nothing that the plan did not.
    """

    clock: float
    problem: Problem
    routes: list[list[Stop]]
    done: list[Done]
    lost: tuple[str, ...]
    cancelled: tuple[str, ...]
    timed: Sequence[LandingRoute]
    gone: list[Broken] = field(default_factory=list)
    as_planned: bool = False

    @classmethod
    def of(cls, state: MissionState, timed: Sequence[LandingRoute]) -> Draft:
        """Begin with a state, whose clock is that of the event."""
        routes = [list(route) for route in state.routes]
        problem = without_plan(state.problem)
        return cls(state.clock, problem, routes, list(state.done), state.lost, state.cancelled, timed)

    def uav(self, uav_id: str, pointer: str = "/uav_id") -> int:
        """Return the place of a UAV.

        Raises
        ------
        EventRefused
            If there is none, or it is lost.
        """
        i = _place(self.problem.uavs, uav_id, pointer, noun("UAV"))
        if uav_id in self.lost:
            raise EventRefused.at(pointer, said("{id!r} is lost", id=uav_id))
        return i

    def target(self, target_id: str, pointer: str = "/target_id") -> int:
        """Return the place of an area, or refuse one that is not known."""
        return _place(self.problem.targets, target_id, pointer, noun("area"))

    def base(self, base_id: str) -> int:
        """Return the place of a base, or refuse one that is not known."""
        return _place(self.problem.bases, base_id, "/base_id", noun("base"))

    def replace_in(self, name: str, place: int, **changes: Any) -> None:
        """Change fields of an item of the problem."""
        items = list(getattr(self.problem, name))
        items[place] = replace(items[place], **changes)
        self.rebuild({name: tuple(items)}, lambda _name, _place, _rest: None)

    def rebuild(self, changes: dict[str, Any], pointer: Into) -> None:
        """Change fields of the problem.

        Parameters
        ----------
        changes
            By their names.
        pointer
            Gets a field, the place in it, and what follows in a pointer into the problem; returns the pointer
            into the event, None for the event as a whole.

        Raises
        ------
        EventRefused
            If the problem would then break a rule.
        """
        try:
            self.problem = without_plan(self.problem, **changes)
        except InvalidProblem as error:
            raise EventRefused.of([_in_event(violation, pointer) for violation in error.violations]) from None

    def take(self, routes: Sequence[Sequence[Stop]]) -> None:
        """Take other routes; a UAV that is called home from a visit is not committed to it any more."""
        for i, (before, now) in enumerate(zip(self.routes, routes, strict=True)):
            left = set() if now else {stop.id for stop in before if not stop.is_base}
            committed = self.problem.uavs[i].committed
            if left.intersection(committed):
                self.replace_in("uavs", i, committed=tuple(each for each in committed if each not in left))
        self.routes = [list(route) for route in routes]

    def drop(self, i: int, rule: str, only: Stop | None = None) -> None:
        """Drop a UAV's stops, or those at one place."""
        uav_id = self.problem.uavs[i].id
        dropped = [stop for stop in self.routes[i] if only is None or stop == only]
        self.routes[i] = [stop for stop in self.routes[i] if stop not in dropped]
        self.gone += [Broken(uav_id, stop, rule, GONE[rule]) for stop in dropped]


def _place(items: Sequence[Any], identifier: str, pointer: str, what: Said) -> int:
    for place, item in enumerate(items):
        if item.id == identifier:
            return place
    detail = said(
        "{id!r} is no {what} of this mission, which has {count}", id=identifier, what=what, count=len(items)
    )
    raise EventRefused.at(pointer, detail)


def _in_event(violation: Violation, pointer: Into) -> Violation:
    """Turn a violation of the problem into one of the event, or of the event as a whole."""
    name, _, rest = violation.pointer.removeprefix("/").partition("/")
    index, _, below = rest.partition("/")
    if index.isdigit():
        found = pointer(name, int(index), f"/{below}" if below else "")
    else:
        found = pointer(name, None, f"/{rest}" if rest else "")
    if found is None:
        return Violation(
            "",
            said("{pointer} of what remains: {detail}", pointer=violation.pointer, detail=violation.detail),
        )
    return Violation(found, violation.detail)
