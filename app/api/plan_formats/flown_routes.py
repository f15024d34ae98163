"""From flight files to a plan: which areas the UAVs visit, and where they reload.

Files have places and commands, a plan has areas and bases: a waypoint near an area is a visit to it. What is
passed over on the way is no part of a plan, whose ways follow from its stops.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest

from app.api.plan_formats.flights import Point
from app.api.plan_formats.qgroundcontrol import place_of
from app.api.plan_formats.waypoints import FlightFile, UnreadableFlight, Waypoint, read_flight_file
from app.domain.errors import InvalidProblem, Violation
from app.domain.geometry import EARTH_RADIUS_KM, distance
from app.domain.problem import Problem
from app.domain.said import Said, said
from app.domain.warnings import MOST, ProblemWarning, warnings_of

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
        Of waypoints that are at no place of the problem.
    """

    assignment: list[list[int]]
    warnings: tuple[ProblemWarning, ...]


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
        raise InvalidProblem.of(
            [Violation("/crs", said("{crs!r}; flight files need 'wgs84'", crs=problem.crs))]
        )
    known = _Known(problem, within_m)
    violations: list[Violation] = []
    passed_over: list[tuple[int, Waypoint]] = []
    by_uav: dict[int, list[tuple[int, int, list[_Flight]]]] = {}
    for n, file in enumerate(files):
        try:
            uav, number = _whose(problem, file)
            read = _Reading(known, read_flight_file(file.content))
            flights = read.flights()
        except (UnreadableFlight, _Refused) as error:
            field_name = error.field if isinstance(error, _Refused) else "content"
            violations.append(Violation(f"/{n}/{field_name}", _of(file, error.detail)))
            continue
        passed_over += [(n, item) for item in read.passed_over]
        by_uav.setdefault(uav, []).append((number, n, flights))
    actions: dict[int, list[int]] = {}
    for uav, listed in by_uav.items():
        ordered = [
            (n, flight) for _, n, flights in sorted(listed, key=lambda each: each[:2]) for flight in flights
        ]
        for n, flight in ordered[:-1]:
            if flight.landed is None:
                why = said("{uav!r} lands at no base, and cannot fly again", uav=problem.uavs[uav].id)
                violations.append(Violation(f"/{n}/content", _of(files[n], why)))
        actions[uav] = list(_actions(problem, [flight for _, flight in ordered]))
    if violations:
        inside = [Violation(f"/flight_files{each.pointer}", each.detail) for each in violations]
        raise InvalidProblem.of(inside)
    told = [
        (f"/flight_files/{n}/content", _of(files[n], known.where(item, item.place)))
        for n, item in passed_over[:MOST]
    ]
    # Of those that are only counted nobody reads where they are.
    warnings = warnings_of(PASSED_OVER, [*told, *([("", "")] * (len(passed_over) - len(told)))])
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

    def __init__(self, detail: Said, field: str) -> None:
        super().__init__(detail)
        self.detail, self.field = detail, field


def _of(file: ReadFile, why: Said) -> Said:
    return said("{file}: {why}", file=file.name, why=why)


def _whose(problem: Problem, file: ReadFile) -> tuple[int, int]:
    """Return the place of a file's UAV in the swarm, from 0, and the number of the flight."""
    place, number = place_of(file.name) or (None, 1)
    if file.uav_id is not None:
        known = [uav.id for uav in problem.uavs]
        if file.uav_id not in known:
            raise _Refused(said("no UAV has the id {id!r}", id=file.uav_id), "uav_id")
        return known.index(file.uav_id), number
    if place is None:
        detail = said("its name does not begin with the UAV's number, as 001-: `uav_id` is needed")
        raise _Refused(detail, "name")
    if not 0 <= place < problem.n_uavs:
        detail = said(
            "its name begins with {number}, and there are {count} UAVs",
            number=place + 1,
            count=problem.n_uavs,
        )
        raise _Refused(detail, "name")
    return place, number


class _Places:
    """Places that are looked for by what is near them, so that a long file is read soon.

    Parameters
    ----------
    places
        Longitudes and latitudes.
    within_m
        How near is near.
    """

    def __init__(self, places: Sequence[Point], within_m: float) -> None:
        self._places, self._within_m = places, within_m
        self._order = sorted(range(len(places)), key=lambda each: places[each][1])
        self._latitudes = [places[each][1] for each in self._order]
        # A degree of latitude is as long everywhere.
        self._degrees = math.degrees(within_m / (_M_PER_KM * EARTH_RADIUS_KM)) * (1.0 + 1e-9)

    def near(self, place: Point) -> list[tuple[float, int]]:
        """Return what is near a place, the nearest first: how far it is, in m, and its index."""
        begin = bisect_left(self._latitudes, place[1] - self._degrees)
        end = bisect_right(self._latitudes, place[1] + self._degrees)
        away = ((_apart_m(place, self._places[each]), each) for each in self._order[begin:end])
        return sorted(each for each in away if each[0] <= self._within_m)


class _Known:
    """The places of a problem.

    Attributes
    ----------
    problem, within_m
        As of :func:`plan_of_files`.
    areas, bases
        Where something can be done.
    others
        What may be flown over besides: where UAVs start and are, and corners of zones.
    """

    def __init__(self, problem: Problem, within_m: float) -> None:
        self.problem, self.within_m = problem, within_m
        self.areas = _Places([(target.x, target.y) for target in problem.targets], within_m)
        self.bases = _Places([(base.x, base.y) for base in problem.bases], within_m)
        starts = [place for uav in problem.uavs for place in ((uav.x_s, uav.y_s), (uav.x_c, uav.y_c))]
        corners = [corner for zone in problem.no_fly_zones for corner in zone.polygon]
        self.others = _Places([*starts, *corners], within_m)

    def where(self, item: Waypoint, place: Point) -> Said:
        """Say where an item of a file is, and how far that is from what is nearest."""
        away = [(_apart_m(place, (each.x, each.y)), each.id) for each in self.problem.targets]
        away += [(_apart_m(place, (each.x, each.y)), each.id) for each in self.problem.bases]
        nearest, whose = min(away)
        return said(
            "{item} at latitude {latitude:.6f}, longitude {longitude:.6f} is at no area or base: the "
            "nearest, {nearest!r}, is {away} m away, more than {within:g} m",
            item=_called(item),
            latitude=round(place[1], 6),
            longitude=round(place[0], 6),
            nearest=whose,
            away=round(nearest),
            within=self.within_m,
        )


def _apart_m(one: Point, other: Point) -> float:
    return _M_PER_KM * distance("wgs84", *one, *other)


def _called(item: Waypoint) -> Said:
    names = _FLOWN_TO | _LANDS | _PLACES | _RELEASES | _REPEATS
    return said("item {number} ({command})", number=item.number, command=names[item.command])


class _Reading:
    """A flight file that is read; `passed_over` is what it flies over that is no place of the problem."""

    def __init__(self, known: _Known, file: FlightFile) -> None:
        self._known, self._file = known, file
        self.passed_over: list[Waypoint] = []

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
                detail = said("{item}: missions that repeat items are not read", item=_called(item))
                raise _Refused(detail, "content")
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
                raise _Refused(self._known.where(item, unknown.place), "content")
        return flights

    def _lands_next(self, item: Waypoint, following: Waypoint | None) -> bool:
        """Say whether a UAV flies over a base to land there."""
        if following is None or self._landing(following) is None:
            return False
        return _apart_m(item.place, following.place) <= _SAME_PLACE_M

    def _nowhere(self, item: Waypoint) -> Waypoint | None:
        """Take note of a place that is no area's; return it where it is none of the problem's at all."""
        is_home = (
            self._file.home is not None and _apart_m(item.place, self._file.home) <= self._known.within_m
        )
        known = is_home or self._known.bases.near(item.place) or self._known.others.near(item.place)
        if item.command in _PLACES or (item.command in _LANDS and not known):
            raise _Refused(self._known.where(item, item.place), "content")
        if known:
            return None
        self.passed_over.append(item)
        return item

    def _area(self, item: Waypoint) -> int | None:
        near = self._known.areas.near(item.place)
        if not near:
            return None
        if len(near) > 1 and near[1][0] - near[0][0] < _SAME_PLACE_M:
            one, other = (self._known.problem.targets[j].id for _, j in near[:2])
            detail = said(
                "{item} is as near to {one!r} as to {other!r}: the file does not say which",
                item=_called(item),
                one=one,
                other=other,
            )
            raise _Refused(detail, "content")
        return near[0][1]

    def _base(self, place: Point | None) -> int | None:
        near = [] if place is None else self._known.bases.near(place)
        return near[0][1] if near else None

    def _landing(self, item: Waypoint) -> int | None:
        """Return the base at which an item lands; None if it lands at none, or at an area that is nearer."""
        bases = self._known.bases.near(item.place) if item.command in _LANDS else []
        areas = self._known.areas.near(item.place) if bases else []
        if not bases or (areas and areas[0][0] < bases[0][0]):
            return None
        return bases[0][1]
