"""What was really done: reports of visits and reloads, held against what was planned until then.

A stop that the plan has done already is corrected. Another one puts its UAV there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from app.domain.allocation import TimedStop
from app.domain.geometry import distance
from app.domain.problem import ROUNDING, TOLERANCE, UAV, Problem, Target
from app.domain.said import said
from app.domain.surroundings import Base
from app.missions.draft import Draft
from app.missions.effects import stop_of
from app.missions.errors import EventRefused
from app.missions.events import ReloadDone, VisitDone
from app.missions.state import Done, Stop


def visit_done(draft: Draft, event: VisitDone) -> None:
    """Let a visit have been made.

    Raises
    ------
    EventRefused
        If UAV or area are not known, or the UAV had not as much aboard.
    """
    i, j = draft.uav(event.uav_id), draft.target(event.target_id)
    time = _time_of(event.time, draft.clock)
    stop = Stop(event.target_id)
    place = _planned(draft, event.uav_id, stop)
    planned = None if place is None else draft.done[place].amounts
    _move(draft, i, [-amount for amount in event.delivered], planned and [-each for each in planned])
    target = draft.problem.targets[j]
    brought = _difference(event.delivered, planned)
    whole = target.loadlist if target.requested is None else target.requested
    left = tuple(
        _without_rounding(max(0.0, need - more), of)
        for need, more, of in zip(target.loadlist, brought, whole, strict=True)
    )
    if left != target.loadlist:
        # What it gets less than planned, it still needs.
        asked = tuple(map(max, whole, left))
        draft.replace_in("targets", j, loadlist=left, requested=asked)
    _note(draft, i, Done(event.uav_id, stop, time, event.delivered, True), place, brought)
    if place is None:
        _arrive(draft, i, stop, target)


def reload_done(draft: Draft, event: ReloadDone) -> None:
    """Let a reload have been made.

    Raises
    ------
    EventRefused
        If UAV or base are not known, or the UAV cannot carry as much.
    """
    i, d = draft.uav(event.uav_id), draft.base(event.base_id)
    uav, time = draft.problem.uavs[i], _time_of(event.time, draft.clock)
    stop = Stop(event.base_id, True)
    place = _planned(draft, event.uav_id, stop)
    more = [now - before for now, before in zip(event.loadlist, uav.loadlist, strict=True)]
    _move(draft, i, more, None)
    base = draft.problem.bases[d]
    if base.stock is not None:
        stock = tuple(
            _without_rounding(max(0.0, had - taken), had) for had, taken in zip(base.stock, more, strict=True)
        )
        draft.replace_in("bases", d, stock=stock)
    taken = (
        tuple(more) if place is None else tuple(map(sum, zip(draft.done[place].amounts, more, strict=True)))
    )
    _note(draft, i, Done(event.uav_id, stop, time, taken, True), place, more)
    if place is None:
        _arrive(draft, i, stop, base)
        draft.replace_in("uavs", i, dis=0.0, airborne=0.0)


def _note(draft: Draft, i: int, done: Done, place: int | None, difference: Sequence[float]) -> None:
    """Write down what was done, in place of what was planned to be."""
    if place is None:
        draft.done.append(done)
        return
    draft.done[place] = done
    uav = draft.problem.uavs[i]
    last = max(k for k, each in enumerate(draft.done) if each.uav_id == done.uav_id)
    # It is over, whenever it was planned to be.
    ready = last == place and uav.available_from > draft.clock
    if ready:
        draft.replace_in("uavs", i, available_from=draft.clock)
    exact = all(abs(each) <= TOLERANCE for each in difference)
    draft.as_planned = exact and not ready


def _arrive(draft: Draft, i: int, stop: Stop, place: Target | Base) -> None:
    """Put a UAV where it has stopped, earlier than was planned, or though it was not planned at all."""
    uav, problem = draft.problem.uavs[i], draft.problem
    ahead = (each for each in draft.timed[i].stops if isinstance(each, TimedStop))
    known = next((each for each in ahead if stop_of(each) == stop), None)
    flown = uav.dis + _straight(problem, uav, place) if known is None else uav.voyage - known.range_left
    aloft = uav.airborne + max(0.0, draft.clock - uav.available_from)
    if stop in draft.routes[i]:
        draft.routes[i].remove(stop)
    home = uav.location if uav.home_location is None else uav.home_location
    draft.replace_in(
        "uavs",
        i,
        x_c=place.x,
        y_c=place.y,
        location=place.location if problem.matrices is not None else uav.location,
        home_location=home,
        dis=max(flown, uav.dis),
        airborne=aloft,
        available_from=draft.clock,
        committed=tuple(each for each in uav.committed if stop.is_base or each != stop.id),
    )


def _move(draft: Draft, i: int, change_of_load: Sequence[float], planned: Sequence[float] | None) -> None:
    """Change what is aboard a UAV, from what was planned to what was reported.

    Raises
    ------
    EventRefused
        If it had not as much.
    """
    uav = draft.problem.uavs[i]
    load = []
    for k, (have, change_by) in enumerate(zip(uav.loadlist, change_of_load, strict=True)):
        had = have - (planned[k] if planned else 0.0)
        left = had + change_by
        if left < -TOLERANCE * max(1.0, had):
            detail = said(
                "{amount} of material {number}, but {uav} had {had} aboard",
                amount=-change_by,
                number=k + 1,
                uav=uav.id,
                had=had,
            )
            raise EventRefused.at(f"/delivered/{k}", detail)
        load.append(_without_rounding(max(0.0, left), max(had, uav.full[k])))
    refills = draft.problem.bases and not draft.problem.plans_loading
    full = uav.full if refills else uav.full_load
    if tuple(load) != uav.loadlist:
        draft.replace_in("uavs", i, loadlist=tuple(load), full_load=full)


def _planned(draft: Draft, uav_id: str, stop: Stop) -> int | None:
    """Return the place of a stop that is taken as done by the plan, and not reported yet: the newest."""
    found = [
        place
        for place, each in enumerate(draft.done)
        if (each.uav_id, each.stop, each.reported) == (uav_id, stop, False)
    ]
    return found[-1] if found else None


def _difference(amounts: Sequence[float], planned: Sequence[float] | None) -> list[float]:
    return [a - p for a, p in zip(amounts, planned or (0.0,) * len(amounts), strict=True)]


def _without_rounding(amount: float, whole: float) -> float:
    return amount if amount >= ROUNDING * whole else 0.0


def _straight(problem: Problem, uav: UAV, place: Target | Base) -> float:
    """Return the length of the straight way to a place: no UAV has flown less."""
    if problem.matrices is None:
        return distance(problem.crs, uav.x_c, uav.y_c, place.x, place.y)
    names = list(problem.matrices)
    matrix = problem.matrices[names[0] if uav.profile is None else uav.profile]
    length = float(matrix.distance[uav.location][place.location])
    return length if math.isfinite(length) else 0.0


def _time_of(given: float | None, clock: float) -> float:
    if given is not None and given > clock:
        detail = said("{time} is later than the event, which is at {clock}", time=given, clock=clock)
        raise EventRefused.at("/time", detail)
    return clock if given is None else given
