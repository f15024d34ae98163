"""The whole plan as CSV (RFC 4180): a row an event, in the order a UAV flies them.

Names of UAVs and areas are a client's. One that a spreadsheet would take for a formula is written with an
apostrophe in front, and with one more where it has some; the dashboard's files follow the same rule.
"""

from __future__ import annotations

import csv
import io
import re

from app.api.plan_formats.flown_plan import FlownPlan

_COLUMNS = ("uav_id", "order", "event", "target_id", "x", "y", "time", "leg_distance", "range_left", "step")
_FORMULA = re.compile(r"'*[=+\-@\t\r]")


def csv_table(plan: FlownPlan) -> str:
    """Write a row for every start, visit, return; amounts unloaded are ``delivered_1`` to ``delivered_K``."""
    written = io.StringIO()
    table = csv.writer(written)
    materials = range(1, plan.problem.n_materials + 1)
    table.writerow([*_COLUMNS, *(f"delivered_{k}" for k in materials)])
    nothing = [""] * plan.problem.n_materials
    for route in plan.routes:
        uav = route.uav
        left = uav.voyage - uav.dis
        name = _plain(uav.id)
        table.writerow([name, 0, "start", "", uav.x_c, uav.y_c, 0.0, 0.0, left, "", *nothing])
        for order, stop in enumerate(route.stops, 1):
            target = stop.target
            visit = [_plain(target.id), target.x, target.y, stop.arrival_time, stop.distance, stop.range_left]
            table.writerow([name, order, "visit", *visit, stop.step, *stop.delivered])
        if route.flies:
            home = [uav.x_s, uav.y_s, route.return_time, route.return_distance, route.range_left]
            table.writerow([name, len(route.stops) + 1, "return", "", *home, "", *nothing])
    return written.getvalue()


def _plain(text: str) -> str:
    """Keep a text from being read as a formula."""
    return f"'{text}" if _FORMULA.match(text) else text
