"""The problem that remains at a moment of a plan: who is where, with what, and what is still needed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.domain.allocation import LandingRoute, LandingSomewhere, Reload, TimedStop
from app.domain.plan import Plan
from app.domain.problem import ROUNDING, UAV, Problem, Target
from app.domain.surroundings import Base
from app.simulation.amounts import Amounts
from app.simulation.breaches import breaches_of
from app.simulation.explain import timed_routes
from app.simulation.legs import wind_of, zones_of
from app.travel.choice import legs_between
from app.travel.legs import Legs, Way


def remaining_at(problem: Problem, plan: Plan, at: float, amounts: Amounts | None = None) -> Problem:
    """Return the problem as it stands at a clock of a plan, ready to be allocated (section 11).

    A UAV between two places is on its way, and committed to the visit that it is flying to; with matrices it
    is where it is flying to, and available when it arrives. One that unloads is there until it has, with the
    unloading done, and one at a base has reloaded.
    Who has landed for good is returning. The rest of the plan is the ``start_plan``.

    Parameters
    ----------
    problem, plan
        The problem and a legal plan of it.
    at
        On the clock of the problem.
    amounts
        What the plan's stops unload and load, where that is planned; the best amounts by default.

    Raises
    ------
    IllegalPlan
        If the plan is not legal.
    """
    routes = timed_routes(problem, plan, amounts)
    n = problem.n_targets
    targets = {target.id: j for j, target in enumerate(problem.targets)}
    bases = {base.id: n + 1 + d for d, base in enumerate(problem.bases)}
    needs = [list(target.loadlist) for target in problem.targets]
    taken = [[0.0] * problem.n_materials for _ in problem.bases]
    flights = [_Flight(problem, i, route, at) for i, route in enumerate(routes)]
    for flight in flights:
        for stop in flight.begun:
            if isinstance(stop, Reload):
                less, sign, moved = taken[bases[stop.base_id] - n - 1], 1.0, stop.loaded
            else:
                less, sign, moved = needs[targets[stop.target_id]], -1.0, stop.delivered
            for k, amount in enumerate(moved):
                less[k] += sign * amount
    rests = [
        [bases[stop.base_id] if isinstance(stop, Reload) else targets[stop.target_id] for stop in flight.rest]
        for flight in flights
    ]
    left = replace(
        problem,
        uavs=tuple(flight.uav for flight in flights),
        targets=tuple(map(_with_need, problem.targets, needs)),
        bases=tuple(map(_without, problem.bases, taken)),
        start_plan=((problem.n_targets,) * problem.n_uavs,),
    )
    return replace(left, start_plan=_legal_rest(left, rests))


def _legal_rest(problem: Problem, rests: list[list[int]]) -> tuple[tuple[int, ...], ...]:
    """Return the rest of a plan as joint actions.

    Steps count anew, so UAVs may come to a target in another order: a visit that is left without anything to
    unload is left out.
    """
    home = problem.n_targets
    while True:
        steps = max(1, *map(len, rests))
        rows = tuple(tuple(rest[s] if s < len(rest) else home for rest in rests) for s in range(steps))
        broken = _first_broken(problem, rows)
        if broken is None:
            return rows
        s, i = broken
        del rests[i][s]


def _first_broken(problem: Problem, rows: tuple[tuple[int, ...], ...]) -> tuple[int, int] | None:
    """Return step and UAV of the first action that is not allowed; None for a legal plan."""
    broken = breaches_of(problem, Plan(rows))
    if not broken:
        return None
    ids = [uav.id for uav in problem.uavs]
    return broken[0].step - 1, ids.index(str(broken[0].uav_id))


def _with_need(target: Target, need: Sequence[float]) -> Target:
    whole = target.loadlist if target.requested is None else target.requested
    left = tuple(
        amount if amount >= ROUNDING * all_of else 0.0 for amount, all_of in zip(need, whole, strict=True)
    )
    return target if left == target.loadlist else replace(target, loadlist=left, requested=whole)


def _without(base: Base, taken: Sequence[float]) -> Base:
    if base.stock is None or not any(taken):
        return base
    left = (
        had - gone if had - gone >= ROUNDING * had else 0.0
        for had, gone in zip(base.stock, taken, strict=True)
    )
    return replace(base, stock=tuple(left))


_Place = Target | Base


@dataclass(frozen=True, slots=True)
class _Leg:
    """A leg as it is flown: from when to when, its air length, and its way; no way with matrices."""

    takeoff: float
    arrival: float
    air: float
    way: Way | None


class _Flight:
    """One UAV at a moment of its route.

    Attributes
    ----------
    uav
        As it is then.
    begun, rest
        Stops that have begun, and those that have not.
    """

    def __init__(self, problem: Problem, i: int, route: LandingRoute, at: float) -> None:
        self._problem, self._i, self._at = problem, i, at
        self.begun: list[TimedStop | Reload] = []
        self.rest = [stop for stop in route.stops if isinstance(stop, TimedStop | Reload)]
        self.uav = problem.uavs[i]
        self._home = self.uav.location if self.uav.home_location is None else self.uav.home_location
        if not self.uav.ret:
            self.uav = self._fly(route)

    def _fly(self, route: LandingRoute) -> UAV:
        uav, at = self.uav, self._at
        clock, flown, aloft = uav.available_from, uav.dis, uav.airborne
        place: _Place | None = None
        if at <= clock:
            return uav
        while self.rest:
            stop = self.rest[0]
            there = self._place_of(stop)
            wait = self._waits_on_ground(stop, place)
            leg = self._leg(clock + wait, stop.arrival_time + wait, stop.distance, place, there)
            if at < leg.takeoff:
                return self._still(uav, place, at)
            if isinstance(stop, Reload):
                if at < stop.arrival_time:
                    return self._on_way(leg, flown, aloft, there)
                flown, aloft = 0.0, 0.0
            else:
                if at < stop.begin_time:
                    going = (stop.target_id, *uav.committed[len(self.begun) + 1 :])
                    return replace(self._on_way(leg, flown, aloft, there), committed=going)
                flown, aloft = flown + leg.air, aloft + stop.departure_time - leg.takeoff
            self.begun.append(self.rest.pop(0))
            clock, place = stop.departure_time, there
            uav = self._after(uav, stop)
            if at < clock:
                return self._at_place(uav, there, clock, flown, aloft)
        if place is None:
            return replace(uav, available_from=at)
        if not self._problem.objective.return_to_base:
            return replace(self._at_place(uav, place, at, flown, aloft), ret=True)
        self.uav = uav
        landing = clock if route.landing is None else route.landing.time
        home = None
        if isinstance(route.landing, LandingSomewhere) and route.landing.base_id is not None:
            home = self._base(route.landing.base_id)
        leg = self._leg(clock, landing, route.return_distance, place, home)
        if at < landing and leg.way is not None:
            return self._on_way(leg, flown, aloft, home)
        landed = self._at_place(uav, home, max(at, landing), flown + leg.air, aloft + landing - clock)
        return replace(landed, ret=True)

    def _waits_on_ground(self, stop: TimedStop | Reload, place: _Place | None) -> float:
        """Return how long it waits before it takes off: no longer than the area's deadline lets it."""
        uav, there = self._problem.uavs[self._i], self._place_of(stop)
        on_ground = isinstance(place, Base) or (place is None and uav.begins_on_ground)
        if not on_ground or isinstance(stop, Reload) or isinstance(there, Base):
            return 0.0
        last = math.inf if there.deadline is None else there.deadline
        return max(0.0, min(stop.begin_time, last) - stop.arrival_time)

    def _still(self, uav: UAV, place: _Place | None, clock: float) -> UAV:
        """Return the UAV on the ground where it is."""
        if place is None:
            return replace(uav, available_from=clock)
        return self._at_place(uav, place, clock, 0.0, 0.0)

    def _place_of(self, stop: TimedStop | Reload) -> _Place:
        if isinstance(stop, Reload):
            return self._base(stop.base_id)
        return next(target for target in self._problem.targets if target.id == stop.target_id)

    def _base(self, base_id: str) -> Base:
        return next(base for base in self._problem.bases if base.id == base_id)

    def _after(self, uav: UAV, stop: TimedStop | Reload) -> UAV:
        """Return the UAV with what is aboard after a stop; a commitment to a visit is kept."""
        before = self._problem.uavs[self._i]
        whole = map(max, before.loadlist, before.full)
        change = stop.loaded if isinstance(stop, Reload) else tuple(-amount for amount in stop.delivered)
        left = tuple(
            have + more if have + more > 0.0 and have + more >= ROUNDING * max(have, all_of) else 0.0
            for have, more, all_of in zip(uav.loadlist, change, whole, strict=True)
        )
        # What it leaves a base with is what it had at first, where nothing else is said; or what is planned.
        refills = self._problem.bases and not self._problem.plans_loading
        full = before.full_load if not self._problem.bases else before.full if refills else None
        return replace(uav, loadlist=left, full_load=full)

    def _at_place(self, uav: UAV, target: _Place | None, clock: float, flown: float, aloft: float) -> UAV:
        """Return the UAV at a target or base, or at its starting point."""
        x, y = (uav.x_s, uav.y_s) if target is None else (target.x, target.y)
        location = self._home if target is None else target.location
        return replace(
            uav, x_c=x, y_c=y, location=location, home_location=self._home, dis=flown, airborne=aloft,
            available_from=clock, committed=uav.committed[len(self.begun) :],
        )  # fmt: skip

    def _on_way(self, leg: _Leg, flown: float, aloft: float, target: _Place | None) -> UAV:
        """Return the UAV on a leg, or waiting at its end."""
        uav, at = self.uav if not self.begun else self._unloaded(), self._at
        if leg.way is None:
            clock = max(at, leg.arrival)
            return self._at_place(uav, target, clock, flown + leg.air, aloft + clock - leg.takeoff)
        if at >= leg.arrival:
            # It is there in time, however long it waits.
            deadline = target.deadline if isinstance(target, Target) else None
            clock = at if deadline is None or deadline >= at else max(leg.arrival, deadline)
            return self._at_place(uav, target, clock, flown + leg.air, aloft + clock - leg.takeoff)
        x, y, air = _point_on(leg.way, at - leg.takeoff, self._problem.crs)
        there = self._at_place(uav, target, at, flown + air, aloft + at - leg.takeoff)
        return replace(there, x_c=x, y_c=y)

    def _unloaded(self) -> UAV:
        uav = self._problem.uavs[self._i]
        for stop in self.begun:
            uav = self._after(uav, stop)
        return uav

    def _leg(
        self, takeoff: float, arrival: float, length: float, origin: _Place | None, target: _Place | None
    ) -> _Leg:
        if self._problem.matrices is not None:
            return _Leg(takeoff, arrival, length, None)
        uav = self._problem.uavs[self._i]
        start = (uav.x_c, uav.y_c) if origin is None else (origin.x, origin.y)
        end = (uav.x_s, uav.y_s) if target is None else (target.x, target.y)
        way = _legs(self._problem, start, end).way(0, 1, uav.speed)
        return _Leg(takeoff, arrival, length if way is None else float(way.air.sum()), way)


def _legs(problem: Problem, start: tuple[float, float], end: tuple[float, float]) -> Legs:
    return legs_between(problem.crs, np.array([start, end], np.float64), zones_of(problem), wind_of(problem))


def _point_on(way: Way, elapsed: float, crs: str) -> tuple[float, float, float]:
    """Return where a UAV is on a way after some time, and the air length that it has flown."""
    air = 0.0
    for piece, time in enumerate(way.time.tolist()):
        if elapsed < time:
            share = elapsed / time
            x, y = _between(way.points[piece].tolist(), way.points[piece + 1].tolist(), share, crs)
            return x, y, air + share * float(way.air[piece])
        elapsed -= time
        air += float(way.air[piece])
    x, y = way.points[-1].tolist()
    return x, y, air


def _between(a: Sequence[float], b: Sequence[float], share: float, crs: str) -> tuple[float, float]:
    """Return the point at a share of the straight line, or of the great circle, from a place to another."""
    if crs == "local":
        return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
    one, other = _on_sphere(a), _on_sphere(b)
    angle = 2.0 * math.asin(min(1.0, math.dist(one, other) / 2.0))
    if angle < 1e-12:
        return (a[0], a[1]) if share < 0.5 else (b[0], b[1])
    weights = math.sin((1.0 - share) * angle), math.sin(share * angle)
    x, y, z = (weights[0] * p + weights[1] * q for p, q in zip(one, other, strict=True))
    return math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y)))


def _on_sphere(place: Sequence[float]) -> tuple[float, float, float]:
    longitude, latitude = math.radians(place[0]), math.radians(place[1])
    around = math.cos(latitude)
    return around * math.cos(longitude), around * math.sin(longitude), math.sin(latitude)
