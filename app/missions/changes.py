"""What an event does to what remains of a mission, whether its plan can still be flown or not.

Time has been moved on to the event's clock before. Whether the stops that are left can be made is for
:mod:`app.missions.flying`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import singledispatch
from typing import Any

from app.domain.errors import Violation
from app.domain.fields import Context
from app.domain.problem import Target
from app.domain.said import said
from app.missions import events, reports
from app.missions.draft import Draft
from app.missions.errors import EventRefused
from app.missions.state import Stop


def change(draft: Draft, event: events.Event) -> None:
    """Let an event change a draft.

    Raises
    ------
    EventRefused
        If it is about something unknown, or impossible; pointers are into the event.
    """
    problem = draft.problem
    violations = list(events.broken_rules(event, Context(problem.crs, problem.n_materials)))
    if violations:
        raise EventRefused.of(violations)
    _change(event, draft)


@singledispatch
def _change(event: Any, draft: Draft) -> None:  # noqa: ARG001 - each kind of event has its own
    raise TypeError(f"{type(event).__name__} does not change what remains")


@_change.register
def _(_event: events.Clock, draft: Draft) -> None:
    draft.as_planned = True


@_change.register
def _(event: events.UavLost, draft: Draft) -> None:
    i = draft.uav(event.uav_id)
    draft.drop(i, "uav_lost")
    draft.lost += (event.uav_id,)
    draft.replace_in("uavs", i, ret=True, committed=())


@_change.register
def _(event: events.UavsAdded, draft: Draft) -> None:
    before = draft.problem.n_uavs
    _require_new(event.uavs, draft.problem.uavs, "/uavs")
    added = tuple(replace(uav, available_from=max(uav.available_from, draft.clock)) for uav in event.uavs)
    draft.routes += [[] for _ in added]
    draft.rebuild(
        {"uavs": draft.problem.uavs + added},
        lambda name, place, rest: (
            None if name != "uavs" or place is None or place < before else f"/uavs/{place - before}{rest}"
        ),
    )


@_change.register
def _(event: events.UavDelayed, draft: Draft) -> None:
    i = draft.uav(event.uav_id)
    uav = draft.problem.uavs[i]
    if event.until <= draft.clock:
        detail = said(
            "{time} is not after the event, which is at {clock}", time=event.until, clock=draft.clock
        )
        raise EventRefused.at("/until", detail)
    longer = max(0.0, event.until - uav.available_from)
    aloft = uav.airborne if uav.begins_on_ground else uav.airborne + longer
    draft.replace_in("uavs", i, available_from=uav.available_from + longer, airborne=aloft)


@_change.register
def _(event: events.AreasAdded, draft: Draft) -> None:
    before = draft.problem.n_targets
    _require_new(event.targets, draft.problem.targets, "/targets")
    draft.rebuild(
        {"targets": draft.problem.targets + event.targets},
        lambda name, place, rest: (
            None
            if name != "targets" or place is None or place < before
            else f"/targets/{place - before}{rest}"
        ),
    )


@_change.register
def _(event: events.AreasChanged, draft: Draft) -> None:
    targets = list(draft.problem.targets)
    places = [draft.target(each.id, f"/targets/{k}/id") for k, each in enumerate(event.targets)]
    for j, now in zip(places, event.targets, strict=True):
        targets[j] = _as_it_is_now(targets[j], now)
    changed = {target.id for target in event.targets}
    draft.cancelled = tuple(each for each in draft.cancelled if each not in changed)
    draft.rebuild(
        {"targets": tuple(targets)},
        lambda name, place, rest: (
            f"/targets/{places.index(place)}{rest}" if name == "targets" and place in places else None
        ),
    )


@_change.register
def _(event: events.AreaCancelled, draft: Draft) -> None:
    j = draft.target(event.target_id)
    if event.target_id in draft.cancelled:
        raise EventRefused.at("/target_id", said("{id!r} is cancelled already", id=event.target_id))
    for i in range(len(draft.routes)):
        draft.drop(i, "area_cancelled", Stop(event.target_id))
    draft.cancelled += (event.target_id,)
    _release(draft, event.target_id)
    target = draft.problem.targets[j]
    nothing = (0.0,) * draft.problem.n_materials
    draft.replace_in("targets", j, loadlist=nothing, requested=target.requested or target.loadlist)


@_change.register
def _(event: events.LevelChanged, draft: Draft) -> None:
    draft.replace_in("targets", draft.target(event.target_id), level=event.level)


@_change.register
def _(event: events.StockChanged, draft: Draft) -> None:
    draft.replace_in("bases", draft.base(event.base_id), stock=event.stock)


@_change.register
def _(event: events.ZonesChanged, draft: Draft) -> None:
    draft.rebuild({"no_fly_zones": event.no_fly_zones}, _same_field)


@_change.register
def _(event: events.WindChanged, draft: Draft) -> None:
    draft.rebuild({"wind": event.wind}, _same_field)


@_change.register
def _(event: events.VisitDone, draft: Draft) -> None:
    reports.visit_done(draft, event)


@_change.register
def _(event: events.ReloadDone, draft: Draft) -> None:
    reports.reload_done(draft, event)


def _as_it_is_now(before: Target, now: Target) -> Target:
    """Return a changed area; what it asked for is what it needs and what it got."""
    if now.requested is not None or before.requested is None:
        return now
    got = [max(0.0, asked - need) for asked, need in zip(before.requested, before.loadlist, strict=True)]
    if not any(got):
        return now
    return replace(now, requested=tuple(need + have for need, have in zip(now.loadlist, got, strict=False)))


def _release(draft: Draft, target_id: str) -> None:
    """Take an area out of what UAVs are committed to."""
    for i, uav in enumerate(draft.problem.uavs):
        if target_id in uav.committed:
            kept = tuple(each for each in uav.committed if each != target_id)
            draft.replace_in("uavs", i, committed=kept)


def _require_new(items: Sequence[Any], known: Sequence[Any], at: str) -> None:
    taken = {each.id for each in known}
    violations = [
        Violation(f"{at}/{k}/id", said("{id!r} is the id of another one already", id=each.id))
        for k, each in enumerate(items)
        if each.id in taken
    ]
    if violations:
        raise EventRefused.of(violations)


def _same_field(name: str, place: int | None, rest: str) -> str | None:
    return f"/{name}{'' if place is None else f'/{place}'}{rest}"
