"""From flight files to a plan: which areas the UAVs visit, and where they reload.

Files have places and commands, a plan has areas and bases: a waypoint near an area is a visit to it. What is
passed over on the way is no part of a plan, whose ways follow from its stops.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest

from app.api.plan_formats.flights import Point
from app.api.plan_formats.qgroundcontrol import place_of
from app.api.plan_formats.waypoints import FlightFile, UnreadableFlight, Waypoint, read_flight_file
from app.domain.errors import InvalidProblem, Violation
from app.domain.geometry import distance
from app.domain.problem import Problem

PASSED_OVER = "waypoint_passed_over"
"""Code of the warning of a waypoint that is at no place of the problem."""

_FLOWN_TO = {16: "NAV_WAYPOINT", 17: "NAV_LOITER_UNLIM", 18: "NAV_LOITER_TURNS", 19: "NAV_LOITER_TIME"}
_FLOWN_TO |= {31: "NAV_LOITER_TO_ALT", 82: "NAV_SPLINE_WAYPOINT"}
_LANDS = {21: "NAV_LAND", 85: "NAV_VTOL_LAND"}
_PLACES = {94: "NAV_PAYLOAD_PLACE"}
_RELEASES = {183: "DO_SET_SERVO", 211: "DO_GRIPPER"}
_REPEATS = {177: "DO_JUMP"}
_RETURNS = 20
_SAME_PLACE_M = 1.0
_M_PER_KM = 1000.0


@dataclass(frozen=True, slots=True)
class ReadFile:
    """A flight file that came with a request.

    Attributes
    ----------
    name
        Of the file.
    uav_id
        Whose it is; None: the name says it, as those that the service writes do.
    content
        Its text.
    """

    name: str
    uav_id: str | None
    content: str


@dataclass(frozen=True, slots=True)
class ReadPlan:
    """What flight files say.

    Attributes
    ----------
    assignment
        One joint action a step.
    warnings
        Of waypoints that are at no place of the problem; pointers are into the list of files.
    """

    assignment: list[list[int]]
    warnings: tuple[Violation, ...]


@dataclass(slots=True)
class _Flight:
    """A flight while it is read: the areas it visits, and the base at which it lands."""

    visits: list[int] = field(default_factory=list)
    landed: int | None = None


def plan_of_files(problem: Problem, files: Sequence[ReadFile], within_m: float) -> ReadPlan:
    """Turn the flights of UAVs into a plan; who has no file stays where it is.

    Parameters
    ----------
    problem
        A ``wgs84`` problem.
    files
        A file a flight. Those of one UAV are in the order of the numbers in their names, then as they come.
    within_m
        How near to an area or base a waypoint has to be, in m, to be at it.

    Raises
    ------
    InvalidProblem
        If the problem is on a plane, or a file is broken, or does not say whose it is; if it delivers or
        lands at no place of the problem, or does not say at which of several; or if a UAV is to fly on from
        where it cannot reload. All of it is listed.
    """
    if problem.crs != "wgs84":
        raise InvalidProblem.of([Violation("/crs", f"{problem.crs!r}; flight files need 'wgs84'")])
    violations: list[Violation] = []
    warnings: list[Violation] = []
    by_uav: dict[int, list[tuple[int, int, list[_Flight]]]] = {}
    for n, file in enumerate(files):
        try:
            uav, number = _whose(problem, file)
            read = _Reading(problem, uav, within_m, read_flight_file(file.content))
            flights = read.flights()
        except (UnreadableFlight, _Refused) as error:
            field_name = "content" if isinstance(error, UnreadableFlight) else error.args[1]
            violations.append(Violation(f"/{n}/{field_name}", f"{file.name}: {error.args[0]}"))
            continue
        warnings += [Violation(f"/{n}/content", f"{file.name}: {each}") for each in read.passed_over]
        by_uav.setdefault(uav, []).append((number, n, flights))
    actions: dict[int, list[int]] = {}
    for uav, listed in by_uav.items():
        ordered = [
            (n, flight) for _, n, flights in sorted(listed, key=lambda each: each[:2]) for flight in flights
        ]
        for n, flight in ordered[:-1]:
            if flight.landed is None:
                detail = f"{files[n].name}: {problem.uavs[uav].id!r} lands at no base, and cannot fly again"
                violations.append(Violation(f"/{n}/content", detail))
        actions[uav] = list(_actions(problem, [flight for _, flight in ordered]))
    if violations:
        inside = [Violation(f"/flight_files{each.pointer}", each.detail) for each in violations]
        raise InvalidProblem.of(inside)
    return ReadPlan(_rows(problem, actions), tuple(warnings))


def _actions(problem: Problem, flights: Sequence[_Flight]) -> Iterator[int]:
    for number, flight in enumerate(flights):
        yield from flight.visits
        if number < len(flights) - 1 and flight.landed is not None:
            yield problem.n_targets + 1 + flight.landed


def _rows(problem: Problem, actions: dict[int, list[int]]) -> list[list[int]]:
    steps = max(1, *(len(each) for each in actions.values()), 0)
    lands = problem.n_targets
    return [
        [each[step] if step < len(each := actions.get(uav, [])) else lands for uav in range(problem.n_uavs)]
        for step in range(steps)
    ]


class _Refused(Exception):
    """What a file says cannot be a part of a plan: the detail, and the field at fault."""


def _whose(problem: Problem, file: ReadFile) -> tuple[int, int]:
    """Return the place of a file's UAV in the swarm, from 0, and the number of the flight."""
    place, number = place_of(file.name) or (None, 1)
    if file.uav_id is not None:
        known = [uav.id for uav in problem.uavs]
        if file.uav_id not in known:
            raise _Refused(f"no UAV has the id {file.uav_id!r}", "uav_id")
        return known.index(file.uav_id), number
    if place is None:
        raise _Refused("its name does not begin with the UAV's number, as 001-: `uav_id` is needed", "name")
    if not 0 <= place < problem.n_uavs:
        raise _Refused(f"its name begins with {place + 1}, and there are {problem.n_uavs} UAVs", "name")
    return place, number


class _Reading:
    """A flight file that is read."""

    def __init__(self, problem: Problem, uav: int, within_m: float, file: FlightFile) -> None:
        self._problem, self._within_m, self._file = problem, within_m, file
        starts = (
            (problem.uavs[uav].x_s, problem.uavs[uav].y_s),
            (problem.uavs[uav].x_c, problem.uavs[uav].y_c),
        )
        self._areas = [(target.x, target.y) for target in problem.targets]
        self._bases = [(base.x, base.y) for base in problem.bases]
        corners = [corner for zone in problem.no_fly_zones for corner in zone.polygon]
        home = () if file.home is None else (file.home,)
        self._known = [*starts, *home, *self._bases, *corners]
        self.passed_over: list[str] = []

    def flights(self) -> list[_Flight]:
        """Return what the file says: one flight, or several with reloads between them.

        Raises
        ------
        _Refused
            If that is not of this problem.
        """
        flights = [_Flight()]
        at: int | None = None
        unknown: Waypoint | None = None
        for item, following in zip_longest(self._file.items, self._file.items[1:]):
            command = item.command
            base = self._landing(item)
            if command in _FLOWN_TO and self._lands_next(item, following):
                # An area may be at the same base, and is not visited by landing there.
                at, unknown = None, None
                continue
            if command in _REPEATS:
                raise _Refused(f"{self._called(item)}: missions that repeat items are not read", "content")
            if command == _RETURNS:
                flights[-1].landed = self._base(self._file.home)
            elif base is not None:
                flights[-1].landed, at, unknown = base, None, None
            elif command in _FLOWN_TO or command in _LANDS or command in _PLACES:
                area = self._area(item)
                if area is not None and area != at:
                    if flights[-1].landed is not None:
                        flights.append(_Flight())
                    flights[-1].visits.append(area)
                at, unknown = area, None
                if area is None:
                    unknown = self._nowhere(item)
            elif command in _RELEASES and unknown is not None:
                raise _Refused(self._where(item, unknown.place), "content")
        return flights

    def _lands_next(self, item: Waypoint, following: Waypoint | None) -> bool:
        """Say whether a UAV flies over a base to land there."""
        if following is None or self._landing(following) is None:
            return False
        return self._apart_m(item.place, following.place) <= _SAME_PLACE_M

    def _nowhere(self, item: Waypoint) -> Waypoint | None:
        """Take note of a place that is no area's; return it where it is none of the problem's at all."""
        known = any(self._apart_m(item.place, each) <= self._within_m for each in self._known)
        if item.command in _PLACES or (item.command in _LANDS and not known):
            raise _Refused(self._where(item, item.place), "content")
        if known:
            return None
        self.passed_over.append(self._where(item, item.place))
        return item

    def _area(self, item: Waypoint) -> int | None:
        near = sorted((self._apart_m(item.place, place), j) for j, place in enumerate(self._areas))
        if not near or near[0][0] > self._within_m:
            return None
        (first, area), *others = near
        if others and others[0][0] <= self._within_m and others[0][0] - first < _SAME_PLACE_M:
            one, other = (self._problem.targets[j].id for j in (area, others[0][1]))
            raise _Refused(
                f"{self._called(item)} is as near to {one!r} as to {other!r}: the file does not say which",
                "content",
            )
        return area

    def _base(self, place: Point | None) -> int | None:
        if place is None:
            return None
        near = sorted((self._apart_m(place, base), d) for d, base in enumerate(self._bases))
        return near[0][1] if near and near[0][0] <= self._within_m else None

    def _landing(self, item: Waypoint) -> int | None:
        """Return the base at which an item lands; None if it lands at none, or at an area that is nearer."""
        base = self._base(item.place) if item.command in _LANDS else None
        if base is None:
            return None
        to_area = min(self._apart_m(item.place, each) for each in self._areas)
        return None if to_area < self._apart_m(item.place, self._bases[base]) else base

    def _where(self, item: Waypoint, place: Point) -> str:
        away = [(self._apart_m(place, (each.x, each.y)), each.id) for each in self._problem.targets]
        away += [(self._apart_m(place, (each.x, each.y)), each.id) for each in self._problem.bases]
        nearest, whose = min(away)
        return (
            f"{self._called(item)} at latitude {place[1]:.6f}, longitude {place[0]:.6f} is at no area or "
            f"base: the nearest, {whose!r}, is {nearest:.0f} m away, more than {self._within_m:g} m"
        )

    def _called(self, item: Waypoint) -> str:
        names = _FLOWN_TO | _LANDS | _PLACES | _RELEASES | _REPEATS
        return f"item {item.number} ({names[item.command]})"

    @staticmethod
    def _apart_m(one: Point, other: Point) -> float:
        return _M_PER_KM * distance("wgs84", *one, *other)
