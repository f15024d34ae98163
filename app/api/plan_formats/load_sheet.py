"""Who takes what on which flight, where and when: what people at a base need to load UAVs.

A UAV that is on its way already has its load aboard; its first flight is in the sheet all the same, with no
time of a take-off.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass

from app.api.plan_formats.csv_table import amounts, or_nothing, plain
from app.api.plan_formats.flights import Flight, Point
from app.api.plan_formats.flown_plan import FlownPlan, FlownRoute
from app.domain.problem import UAV
from app.domain.surroundings import Base


@dataclass(frozen=True, slots=True)
class Loading:
    """What one UAV has aboard for one flight.

    Attributes
    ----------
    base, place
        Where it takes up material; None: its starting point, or wherever it is.
    uav, flight
        The UAV, and the number of its flight, from 1.
    landing_time
        When it lands there; None for what it has from the start.
    ready_time, take_off_time
        When it may take off, and when it does; the latter None where it is on its way already, or flies no
        more.
    loaded, aboard
        Amounts taken up (a negative one is left at the base), and aboard then, one a material.
    """

    base: Base | None
    place: Point
    uav: UAV
    flight: int
    landing_time: float | None
    ready_time: float
    take_off_time: float | None
    loaded: tuple[float, ...]
    aboard: tuple[float, ...]


def loadings(plan: FlownPlan) -> tuple[Loading, ...]:
    """Return the loadings of all UAVs that fly: at the start, then base for base, each in order of time."""
    order = {base.id: number for number, base in enumerate(plan.problem.bases)}

    def place_and_time(each: Loading) -> tuple[int, float]:
        return (-1 if each.base is None else order[each.base.id]), each.landing_time or each.ready_time

    return tuple(sorted((each for route in plan.flying for each in _of(route)), key=place_and_time))


def load_sheet(plan: FlownPlan) -> str:
    """Write the loadings as CSV (RFC 4180), a row each; texts are written as in the table of the plan."""
    written = io.StringIO()
    numbers = range(1, plan.problem.n_materials + 1)
    columns = ["base_id", "x", "y", "uav_id", "flight", "landing_time", "ready_time", "take_off_time"]
    columns += [f"{stem}_{k}" for stem in ("loaded", "aboard") for k in numbers]
    table = csv.DictWriter(written, columns)
    table.writeheader()
    for each in loadings(plan):
        x, y = each.place
        table.writerow(
            {
                "base_id": "" if each.base is None else plain(each.base.id),
                "x": x,
                "y": y,
                "uav_id": plain(each.uav.id),
                "flight": each.flight,
                "landing_time": or_nothing(each.landing_time),
                "ready_time": each.ready_time,
                "take_off_time": or_nothing(each.take_off_time),
                **amounts("loaded", each.loaded),
                **amounts("aboard", each.aboard),
            }
        )
    return written.getvalue()


def _of(route: FlownRoute) -> Iterator[Loading]:
    before: Flight | None = None
    for flight in route.flights:
        yield Loading(
            base=flight.origin,
            place=flight.place,
            uav=route.uav,
            flight=flight.number,
            landing_time=None if before is None else before.landing.time,
            ready_time=flight.ready_time,
            take_off_time=flight.take_off_time if flight.flies else None,
            loaded=flight.loaded,
            aboard=flight.aboard,
        )
        before = flight
