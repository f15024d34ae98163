"""The whole plan as CSV (RFC 4180): a row an event, in the order a UAV flies them.

Names of UAVs and areas are a client's. One that a spreadsheet would take for a formula is written with an
apostrophe in front, and with one more where it has some; the dashboard's files follow the same rule.
"""

from __future__ import annotations

import csv
import io
import re

from app.api.plan_formats.flown_plan import FlownPlan, FlownRoute, Points

_COLUMNS = ("uav_id", "order", "event", "target_id", "x", "y", "time", "leg_distance", "range_left", "step")
_OF_WORLD = ("begin_time", "departure_time", "endurance_left", "waiting", "waits_on_ground", "path")
"""Columns that a plan has where its answer has what is in them."""
_FORMULA = re.compile(r"'*[=+\-@\t\r]")


def csv_table(plan: FlownPlan) -> str:
    """Write a row for every start, visit, return; amounts unloaded are ``delivered_1`` to ``delivered_K``.

    Ways are written as well-known text (OGC 06-103r4).
    """
    written = io.StringIO()
    table = csv.writer(written)
    materials = range(1, plan.problem.n_materials + 1)
    of_world = _OF_WORLD if plan.in_world else ()
    table.writerow([*_COLUMNS, *(f"delivered_{k}" for k in materials), *of_world])
    nothing = [""] * plan.problem.n_materials
    without = [""] * len(of_world)
    for route in plan.routes:
        uav = route.uav
        left = uav.voyage - uav.dis
        name = _plain(uav.id)
        start = [uav.x_c, uav.y_c, uav.available_from, 0.0, left, ""]
        table.writerow([name, 0, "start", "", *start, *nothing, *without])
        for order, stop in enumerate(route.stops, 1):
            target = stop.target
            visit = [_plain(target.id), target.x, target.y, stop.arrival_time, stop.distance, stop.range_left]
            more = _of_visit(route, order - 1) if plan.in_world else ()
            table.writerow([name, order, "visit", *visit, stop.step, *stop.delivered, *more])
        if route.flies:
            home = [uav.x_s, uav.y_s, _or_nothing(route.return_time), route.return_distance, route.range_left]
            more = [*without[1:], _line(route.return_path)] if plan.in_world else ()
            table.writerow([name, len(route.stops) + 1, "return", "", *home, "", *nothing, *more])
    return written.getvalue()


def _of_visit(route: FlownRoute, number: int) -> list[float | int | str]:
    stop = route.stops[number]
    on_ground = int(number == 0 and route.waiting_on_ground > 0.0)
    times = [stop.begin_time, stop.departure_time, _or_nothing(stop.endurance_left), stop.waiting]
    return [*times, on_ground, _line(stop.path)]


def _line(points: Points) -> str:
    """Write a way as well-known text; nothing where it is not known."""
    coordinates = ", ".join(f"{x!r} {y!r}" for x, y in points)
    return f"LINESTRING ({coordinates})" if len(points) > 1 else ""


def _or_nothing(value: float | None) -> float | str:
    return "" if value is None else value


def _plain(text: str) -> str:
    """Keep a text from being read as a formula."""
    return f"'{text}" if _FORMULA.match(text) else text
