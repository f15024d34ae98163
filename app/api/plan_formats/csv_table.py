"""The whole plan as CSV (RFC 4180): a row an event, in the order a UAV flies them.

Names of UAVs and areas are a client's. One that a spreadsheet would take for a formula is written with an
apostrophe in front, and with one more where it has some; the dashboard's files follow the same rule.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence

from app.api.plan_formats.flights import Flight, FlownLanding, FlownReload, FlownStop, Points
from app.api.plan_formats.flown_plan import FlownPlan, FlownRoute

_COLUMNS = ("uav_id", "order", "event", "target_id", "x", "y", "time", "leg_distance", "range_left", "step")
_OF_WORLD = ("begin_time", "departure_time", "endurance_left", "waiting", "waits_on_ground", "path")
"""Columns that a plan has where its answer has what is in them."""
_OF_BASES = ("flight", "base_id")
"""Columns that a plan has where its problem has bases."""
_FORMULA = re.compile(r"'*[=+\-@\t\r]")


def csv_table(plan: FlownPlan) -> str:
    """Write a row for every start, visit, reload and return.

    Amounts unloaded are ``delivered_1`` to ``delivered_K``; with bases ``loaded_1`` to ``loaded_K`` are those
    taken up. Ways are written as well-known text (OGC 06-103r4).
    """
    written = io.StringIO()
    materials = range(1, plan.problem.n_materials + 1)
    columns = [*_COLUMNS, *(f"delivered_{k}" for k in materials)]
    columns += _OF_WORLD if plan.in_world else ()
    if plan.has_bases:
        columns += [*_OF_BASES, *(f"loaded_{k}" for k in materials)]
    table = csv.DictWriter(written, columns, restval="", extrasaction="ignore")
    table.writeheader()
    for route in plan.routes:
        table.writerows({"uav_id": plain(route.uav.id), **row} for row in _rows(route))
    return written.getvalue()


Row = dict[str, float | int | str]


def _rows(route: FlownRoute) -> Iterator[Row]:
    uav = route.uav
    yield {
        "order": 0,
        "event": "start",
        "x": uav.x_c,
        "y": uav.y_c,
        "time": uav.available_from,
        "leg_distance": 0.0,
        "range_left": uav.voyage - uav.dis,
        "flight": 1 if route.flies else "",
        **amounts("loaded", uav.loadlist),
    }
    for flight in route.flights:
        for number, stop in enumerate(flight.stops):
            yield _visit(flight, number, stop)
        landing = flight.landing
        if isinstance(landing, FlownReload):
            yield _reload(flight, landing)
    if route.flies:
        yield {
            "order": len(route.stops) + len(route.flights),
            "event": "return",
            "flight": route.flights[-1].number,
            **_landing(route.landing),
        }


def _visit(flight: Flight, number: int, stop: FlownStop) -> Row:
    on_ground = number == 0 and flight.waiting_on_ground > 0.0
    return {
        "order": stop.number + 1,
        "event": "visit",
        "target_id": plain(stop.target.id),
        "x": stop.target.x,
        "y": stop.target.y,
        "time": stop.arrival_time,
        "leg_distance": stop.distance,
        "range_left": stop.range_left,
        "step": stop.step,
        **amounts("delivered", stop.delivered),
        "begin_time": stop.begin_time,
        "departure_time": stop.departure_time,
        "endurance_left": or_nothing(stop.endurance_left),
        "waiting": stop.waiting,
        "waits_on_ground": int(on_ground),
        "path": _line(stop.path),
        "flight": flight.number,
    }


def _reload(flight: Flight, landing: FlownReload) -> Row:
    return {
        "order": landing.number + 1,
        "event": "reload",
        "step": landing.step,
        "departure_time": landing.departure_time,
        "endurance_left": or_nothing(landing.endurance_left),
        "flight": flight.number,
        **amounts("loaded", landing.loaded),
        **_landing(landing),
    }


def _landing(landing: FlownLanding) -> Row:
    x, y = landing.place
    return {
        "x": x,
        "y": y,
        "time": or_nothing(landing.time),
        "leg_distance": landing.distance,
        "range_left": landing.range_left,
        "path": _line(landing.path),
        "base_id": "" if landing.base is None else plain(landing.base.id),
    }


def amounts(stem: str, values: Sequence[float]) -> dict[str, float]:
    """Return amounts by the names of their columns."""
    return {f"{stem}_{k}": value for k, value in enumerate(values, 1)}


def _line(points: Points) -> str:
    """Write a way as well-known text; nothing where it is not known."""
    coordinates = ", ".join(f"{x!r} {y!r}" for x, y in points)
    return f"LINESTRING ({coordinates})" if len(points) > 1 else ""


def or_nothing(value: float | None) -> float | str:
    """Leave the cell of a number that there is not empty."""
    return "" if value is None else value


def plain(text: str) -> str:
    """Keep a text from being read as a formula."""
    return f"'{text}" if _FORMULA.match(text) else text
