"""The whole plan as a page to print: a map, then a card a UAV; plain HTML with nothing from elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape
from itertools import pairwise

import numpy as np

from app.api.plan_formats.flights import Flight, FlownReload
from app.api.plan_formats.flown_plan import FlownPlan, FlownRoute
from app.api.plan_formats.printed_loads import load_tables
from app.api.plan_formats.printed_text import (
    amounts_text,
    called,
    duration_text,
    materials_text,
    position_text,
    time_text,
    unit_text,
)
from app.domain.geometry import unrolled
from app.domain.problem import Target
from app.domain.surroundings import Base

_SIGN = (
    '<p class="sign"><span>Loaded by</span><span>Checked by</span><span>Took off at</span>'
    "<span>Landed at</span></p>"
)
_WIDTH, _HEIGHT, _MARGIN = 720.0, 440.0, 24.0
COLOURS = ("#1150cd", "#938606", "#a92a13", "#0089e5", "#6e1731", "#d55c8c", "#431c90", "#754c7d")
"""Of UAVs by their place in the swarm: those of the dashboard in daylight."""
_PATTERNS = ("", "9 5", "2 4", "9 4 2 4")
"""Dashes of lines: another one each time that the colours begin again."""
_NAME_AT = 0.5
"""Where on its first leg a UAV's name stands."""
_MOST_NAMED = 24
"""With more UAVs that fly their names would cover the map."""
_STYLE = """
body { font: 11pt/1.4 system-ui, sans-serif; color: #111; max-width: 190mm; margin: 10mm auto }
h1 { font-size: 17pt; margin: 0 0 1mm } h2 { font-size: 13pt; margin: 0 0 1mm }
table { border-collapse: collapse; width: 100%; font-size: 9pt; font-variant-numeric: tabular-nums }
th, td { text-align: left; padding: 1mm 1.2mm; border-bottom: 1px solid #bbb }
td.n, th.n { text-align: right } td { white-space: nowrap } td:nth-child(2) { white-space: normal }
td.why { white-space: normal }
section { break-inside: avoid; margin: 6mm 0 } svg { width: 100%; border: 1px solid #bbb }
.key { display: inline-block; width: 3mm; height: 3mm; margin-right: 2mm } p { margin: 1mm 0 3mm }
.done { width: 14mm }
.sign { display: flex; gap: 6mm; margin: 3mm 0 0 }
.sign span { flex: 1; border-bottom: 1px solid #111; padding-top: 6mm }
@page { margin: 12mm }
"""


def printed_page(plan: FlownPlan) -> str:
    """Write the page; times are h and distances km in a ``wgs84`` problem, its own units otherwise."""
    name = f"Plan {plan.job_id[:8]}"
    title = plan.title or name
    return "".join(
        [
            '<!doctype html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width">',
            f"<title>{escape(title)}</title><style>{_STYLE}</style></head><body>",
            f"<h1>{escape(title)}</h1>",
            f"<p>{name}{_begin(plan)}</p>",
            f"<p><strong>{_figures(plan)}</strong></p>",
            f"<p>{len(plan.flying)} of {len(plan.routes)} UAVs fly.{_world(plan)} "
            f"{escape(plan.algorithm)}: reward {plan.reward:.4g}, satisfaction {plan.satisfaction:.4g}, "
            f"distance {plan.distance:.5g}{unit_text(plan, ' km')}.</p>",
            _map(plan),
            *(_card(plan, route) for route in plan.flying),
            load_tables(plan) if plan.has_bases else "",
            _unmet(plan),
            "</body></html>\n",
        ]
    )


def _begin(plan: FlownPlan) -> str:
    """Say when the plan begins, and what its times count from."""
    if plan.problem.crs != "wgs84":
        return ""
    if plan.begins is None:
        return ", begins on ____________ at ________; times count from then"
    return f", begins on {plan.begins:%Y-%m-%d} at {plan.begins:%H:%M}; times are of the day"


def _figures(plan: FlownPlan) -> str:
    """Say who is served, how much arrives, when the last of it does, and when all are home."""
    areas = len(plan.problem.targets)
    asked = [target.requested or target.loadlist for target in plan.problem.targets]
    arrived = [sum(each) for each in zip(*asked, strict=True)]
    whole = tuple(arrived)
    for each in plan.unmet:
        arrived = [had - lacks for had, lacks in zip(arrived, each.remaining, strict=True)]
    delivered = " · ".join(f"{part:g} of {all_:g}" for part, all_ in zip(arrived, whole, strict=True))
    unloaded = [stop.departure_time for route in plan.flying for stop in route.stops]
    home = [route.landing.time for route in plan.flying]
    last = time_text(plan, max(unloaded)) if unloaded else "–"
    landed = time_text(plan, max(t for t in home if t is not None)) if home and None not in home else "–"
    return (
        f"{areas - len(plan.unmet)} of {areas} areas get all they need. "
        f"{escape(materials_text(plan, 'Delivered'))}: {delivered}. "
        f"Last delivery {last}, all home {landed}."
    )


def _world(plan: FlownPlan) -> str:
    """Say what the wind is, and what must not be flown through."""
    wind, zones = plan.problem.wind, plan.problem.no_fly_zones
    said = ""
    if wind is not None:
        said += f" Wind: {wind.speed:g}{unit_text(plan, ' km/h')} towards {wind.towards:g}°."
    if zones:
        said += f" No-fly zones: {', '.join(escape(called(zone)) for zone in zones)}."
    return said


def _card(plan: FlownPlan, route: FlownRoute) -> str:
    uav = route.uav
    rows: list[str] = []
    for flight in route.flights:
        if flight.number > 1 and flight.flies:
            rows.append(_flight(plan, flight))
        rows += [_visit(plan, flight, number) for number in range(len(flight.stops))]
        rows.append(_landing(plan, flight, len(route.stops) + len(route.flights)))
    km = unit_text(plan, ", km")
    times = '<th class="n">Begin</th><th class="n">End</th>' if plan.in_world else ""
    return (
        f'<section><h2><span class="key" style="background:{_colour(route)}"></span>'
        f"{escape(called(uav))}</h2>"
        f"<p>{escape(materials_text(plan, 'Load'))}: {amounts_text(uav.loadlist)}; "
        f"range left {uav.voyage - uav.dis:g}{unit_text(plan, ' km')}; "
        f"speed {uav.speed:g}{unit_text(plan, ' km/h')}{_take_off(plan, route.flights[0])}</p>"
        "<table><thead><tr><th>#</th><th>Where</th><th>Position</th>"
        f'<th class="n">Arrival</th>{times}<th class="n">Leg{km}</th>'
        f'<th class="n">{escape(materials_text(plan, "Unload"))}</th>'
        f'<th class="n">Range left{km}</th><th>Done</th></tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table>{_SIGN}</section>"
    )


def _flight(plan: FlownPlan, flight: Flight) -> str:
    columns = 8 + 2 * plan.in_world
    return (
        f'<tr><th colspan="{columns}">Flight {flight.number}, with {amounts_text(flight.aboard)}'
        f"{_take_off(plan, flight)}</th></tr>"
    )


def _visit(plan: FlownPlan, flight: Flight, number: int) -> str:
    stop = flight.stops[number]
    waits = flight.waiting_in_air(number)
    waiting = f"<br>waits {duration_text(plan, waits)} in the air" if waits > 0.0 else ""
    return (
        f"<tr><td>{stop.number + 1}</td><td>{escape(called(stop.target))}{waiting}</td>"
        f"<td>{position_text(plan, stop.target.x, stop.target.y)}</td>"
        f'<td class="n">{time_text(plan, flight.arrives(number))}</td>'
        f"{_times(plan, stop.begin_time, stop.departure_time)}"
        f'<td class="n">{stop.distance:.4g}</td>'
        f'<td class="n">{amounts_text(stop.delivered)}</td><td class="n">{stop.range_left:.4g}</td>'
        '<td class="done">☐</td></tr>'
    )


def _landing(plan: FlownPlan, flight: Flight, last: int) -> str:
    """Write the row of a landing, which is the `last` one of the card where it is for good."""
    landing = flight.landing
    order, amounts, departure = last, "", None
    where = "home" if landing.base is None else f"home: base {escape(called(landing.base))}"
    if isinstance(landing, FlownReload):
        order, departure = landing.number + 1, landing.departure_time
        where = f"reload: base {escape(called(landing.base))}"
        amounts = f"load {amounts_text(landing.loaded)}"
    return (
        f"<tr><td>{order}</td><td>{where}</td><td>{position_text(plan, *landing.place)}</td>"
        f'<td class="n">{time_text(plan, landing.time)}</td>{_times(plan, None, departure)}'
        f'<td class="n">{landing.distance:.4g}</td>'
        f'<td class="n">{amounts}</td><td class="n">{landing.range_left:.4g}</td><td class="done">☐</td></tr>'
    )


def _times(plan: FlownPlan, *times: float | None) -> str:
    """Write when a stop begins and has ended, where stops have such times."""
    if not plan.in_world:
        return ""
    texts = ("" if time is None else time_text(plan, time) for time in times)
    return "".join(f'<td class="n">{text}</td>' for text in texts)


def _take_off(plan: FlownPlan, flight: Flight) -> str:
    """Say when a UAV takes off, where that is not at once."""
    waits, takes_off = flight.waiting_on_ground, flight.take_off_time
    if takes_off is None or takes_off <= 0.0:
        return ""
    why = f" (waits {duration_text(plan, waits)} on the ground)" if waits > 0.0 else ""
    return f"; takes off {time_text(plan, takes_off)}{why}"


def _unmet(plan: FlownPlan) -> str:
    if not plan.unmet:
        return "<section><h2>Unmet needs</h2><p>None: every area gets all it needs.</p></section>"
    rows = "".join(
        f'<tr><td>{escape(called(each.target))}</td><td class="n">{each.target.level:g}</td>'
        f'<td class="n">{amounts_text(each.remaining)}</td><td class="why">{escape(each.reason)}</td>'
        f'<td class="why">{escape(each.remedy or "–")}</td></tr>'
        for each in plan.unmet
    )
    return (
        '<section><h2>Unmet needs</h2><table><thead><tr><th>Area</th><th class="n">Level</th>'
        f'<th class="n">{escape(materials_text(plan, "Still needed"))}</th><th>Why</th><th>Would help</th>'
        f"</tr></thead><tbody>{rows}</tbody></table></section>"
    )


def _colour(route: FlownRoute) -> str:
    return COLOURS[route.number % len(COLOURS)]


def _pattern(route: FlownRoute) -> str:
    """Return the dashes of a route's line, as an attribute."""
    dashes = _PATTERNS[route.number // len(COLOURS) % len(_PATTERNS)]
    return f' stroke-dasharray="{dashes}"' if dashes else ""


def _map(plan: FlownPlan) -> str:
    shapes = "".join(_shapes(plan))
    return (
        f'<svg viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" aria-label="Map of the routes" '
        f'font-family="sans-serif" font-size="10">{shapes}</svg>'
    )


def _shapes(plan: FlownPlan) -> Iterator[str]:
    problem = plan.problem
    places: list[Target | Base] = [*problem.targets, *problem.bases]
    given = [x for u in problem.uavs for x in (u.x_s, u.x_c)] + [each.x for each in places]
    corners = [corner for zone in problem.no_fly_zones for corner in zone.polygon]
    given += [x for x, _ in corners]
    # One map without the jump at the antimeridian; places are drawn where it has them.
    xs = unrolled(problem.crs, np.array(given))
    on_map = dict(zip(given, xs.tolist(), strict=True))
    around = 360.0 if problem.crs == "wgs84" else math.inf
    ys = [y for u in problem.uavs for y in (u.y_s, u.y_c)] + [each.y for each in places]
    ys += [y for _, y in corners]
    west, south = float(xs.min()), min(ys)
    span_x, span_y = float(xs.max()) - west or 1.0, max(ys) - south or 1.0
    scale = min((_WIDTH - 2 * _MARGIN) / span_x, (_HEIGHT - 2 * _MARGIN) / span_y)
    left = (_WIDTH - scale * span_x) / 2
    bottom = (_HEIGHT + scale * span_y) / 2

    def place(x: float, y: float) -> tuple[float, float]:
        return left + (x - west) * scale, bottom - (y - south) * scale

    def at(x: float, y: float) -> tuple[float, float]:
        return place(on_map[x], y)

    for zone in problem.no_fly_zones:
        points = " ".join("{:.1f},{:.1f}".format(*at(x, y)) for x, y in zone.polygon)
        yield (
            f'<polygon points="{points}" fill="#c22" fill-opacity="0.15" stroke="#c22" '
            f'stroke-dasharray="4 2"><title>{escape(called(zone))}</title></polygon>'
        )
    named = len(plan.flying) <= _MOST_NAMED
    for route in plan.flying:
        way = [route.flights[0].place]
        for flight in route.flights:
            for stop in flight.stops:
                way += stop.path[1:]
            way += flight.landing.path[1:]
        for line in _lines([(on_map[x], y) for x, y in way], around):
            points = " ".join("{:.1f},{:.1f}".format(*place(x, y)) for x, y in line)
            yield (
                f'<polyline points="{points}" fill="none" stroke="{_colour(route)}" '
                f'stroke-width="1.5"{_pattern(route)}/>'
            )
        if named:
            # Of one that is in the air and does not return only the place may be known.
            (x_a, y_a), (x_b, y_b) = (place(on_map[x], y) for x, y in (*way, *way)[:2])
            yield (
                f'<text x="{x_a + _NAME_AT * (x_b - x_a):.1f}" y="{y_a + _NAME_AT * (y_b - y_a):.1f}" '
                f'font-weight="bold" stroke="#fff" stroke-width="3" paint-order="stroke" '
                f'fill="{_colour(route)}">{escape(route.uav.name or route.uav.id)}</text>'
            )
    for target in problem.targets:
        x, y = at(target.x, target.y)
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="#fff" stroke="#111"/>'
        yield f'<text x="{x + 6:.1f}" y="{y + 3:.1f}">{escape(target.name or target.id)}</text>'
    for base in problem.bases:
        x, y = at(base.x, base.y)
        yield f'<path d="M{x - 5:.1f} {y - 5:.1f}h10v10h-10z" fill="#fff" stroke="#111" stroke-width="2"/>'
        yield f'<text x="{x + 8:.1f}" y="{y + 3:.1f}">{escape(base.name or base.id)}</text>'
    for x_s, y_s in {(uav.x_s, uav.y_s) for uav in problem.uavs}:
        x, y = at(x_s, y_s)
        yield f'<path d="M{x:.1f} {y - 6:.1f}l5 9h-10z" fill="#111"/>'


def _lines(places: Sequence[tuple[float, float]], around: float) -> Iterator[list[tuple[float, float]]]:
    """Draw legs the shorter way round: one that leaves the map at an edge comes in at the other."""
    line = [places[0]]
    for (x_a, y_a), (x_b, y_b) in pairwise(places):
        if abs(x_b - x_a) > around / 2:
            turn = math.copysign(around, x_b - x_a)
            yield [*line, (x_b - turn, y_b)]
            line = [(x_a + turn, y_a)]
        line.append((x_b, y_b))
    yield line
