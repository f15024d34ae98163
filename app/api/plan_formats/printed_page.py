"""The whole plan as a page to print: a map, then a card a UAV; plain HTML with nothing from elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape
from itertools import pairwise

import numpy as np

from app.api.plan_formats.flown_plan import FlownPlan, FlownRoute, FlownStop
from app.domain.geometry import unrolled
from app.domain.problem import UAV, Target
from app.domain.surroundings import NoFlyZone

_WIDTH, _HEIGHT, _MARGIN = 720.0, 440.0, 24.0
_COLOURS = ("#0b6e99", "#b4451f", "#3d7a2a", "#7a3f9d", "#a17a00", "#00736b", "#a8325e", "#4a5568")
_STYLE = """
body { font: 11pt/1.4 system-ui, sans-serif; color: #111; max-width: 190mm; margin: 10mm auto }
h1 { font-size: 17pt; margin: 0 0 1mm } h2 { font-size: 13pt; margin: 0 0 1mm }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums }
th, td { text-align: left; padding: 1mm 2mm; border-bottom: 1px solid #bbb }
td.n, th.n { text-align: right } td { white-space: nowrap } td.why { white-space: normal }
section { break-inside: avoid; margin: 6mm 0 } svg { width: 100%; border: 1px solid #bbb }
.key { display: inline-block; width: 3mm; height: 3mm; margin-right: 2mm } p { margin: 1mm 0 3mm }
.done { width: 14mm } @page { margin: 12mm }
"""


def printed_page(plan: FlownPlan) -> str:
    """Write the page; times are h and distances km in a ``wgs84`` problem, its own units otherwise."""
    title = f"Plan {plan.job_id[:8]}"
    return "".join(
        [
            '<!doctype html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width">',
            f"<title>{escape(title)}</title><style>{_STYLE}</style></head><body>",
            f"<h1>{escape(title)}</h1>",
            f"<p>{escape(plan.algorithm)}: reward {plan.reward:.4g}, satisfaction {plan.satisfaction:.4g}, "
            f"distance {plan.distance:.5g}{_unit(plan, ' km')}. "
            f"{len(plan.flying)} of {len(plan.routes)} UAVs fly.{_world(plan)}</p>",
            _map(plan),
            *(_card(plan, route) for route in plan.flying),
            _unmet(plan),
            "</body></html>\n",
        ]
    )


def clock(hours: float) -> str:
    """Write a time in h as hours and minutes, rounded to the minute."""
    minutes = round(hours * 60)
    return f"{minutes // 60}:{minutes % 60:02d}"


def _unit(plan: FlownPlan, unit: str) -> str:
    return unit if plan.problem.crs == "wgs84" else ""


def _world(plan: FlownPlan) -> str:
    """Say what the wind is, and what must not be flown through."""
    wind, zones = plan.problem.wind, plan.problem.no_fly_zones
    said = ""
    if wind is not None:
        said += f" Wind: {wind.speed:g}{_unit(plan, ' km/h')} towards {wind.towards:g}°."
    if zones:
        said += f" No-fly zones: {', '.join(escape(_called(zone)) for zone in zones)}."
    return said


def _called(item: UAV | Target | NoFlyZone) -> str:
    """Name an item for people: names need not be unique, so the id is there too."""
    return item.id if item.name in (None, item.id) else f"{item.name} ({item.id})"


def _time(plan: FlownPlan, time: float | None) -> str:
    if time is None:
        return "–"
    return f"+{clock(time)} h" if plan.problem.crs == "wgs84" else f"{time:.4g}"


def _amounts(amounts: tuple[float, ...]) -> str:
    return " · ".join(f"{amount:g}" for amount in amounts)


def _card(plan: FlownPlan, route: FlownRoute) -> str:
    uav = route.uav
    rows = [
        f"<tr><td>{order}</td><td>{escape(_called(stop.target))}{_waiting(plan, route, order - 1)}</td>"
        f"<td>{_position(plan, stop.target.x, stop.target.y)}</td>"
        f'<td class="n">{_time(plan, route.arrives(order - 1))}</td>{_times(plan, stop)}'
        f'<td class="n">{stop.distance:.4g}</td>'
        f'<td class="n">{_amounts(stop.delivered)}</td><td class="n">{stop.range_left:.4g}</td>'
        '<td class="done">☐</td></tr>'
        for order, stop in enumerate(route.stops, 1)
    ]
    rows.append(
        f"<tr><td>{len(route.stops) + 1}</td><td>home</td><td>{_position(plan, uav.x_s, uav.y_s)}</td>"
        f'<td class="n">{_time(plan, route.return_time)}</td>{_times(plan, None)}'
        f'<td class="n">{route.return_distance:.4g}</td>'
        f'<td class="n"></td><td class="n">{route.range_left:.4g}</td><td class="done">☐</td></tr>'
    )
    km = _unit(plan, ", km")
    times = '<th class="n">Begin</th><th class="n">End</th>' if plan.in_world else ""
    return (
        f'<section><h2><span class="key" style="background:{_colour(route)}"></span>'
        f"{escape(_called(uav))}</h2>"
        f"<p>Load {_amounts(uav.loadlist)}; range left {uav.voyage - uav.dis:g}{_unit(plan, ' km')}; "
        f"speed {uav.speed:g}{_unit(plan, ' km/h')}{_take_off(plan, route)}</p>"
        "<table><thead><tr><th>#</th><th>Where</th><th>Position</th>"
        f'<th class="n">Arrival</th>{times}<th class="n">Leg{km}</th><th class="n">Unload</th>'
        f'<th class="n">Range left{km}</th><th>Done</th></tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></section>"
    )


def _times(plan: FlownPlan, stop: FlownStop | None) -> str:
    """Write when a visit begins and has ended, where visits have such times."""
    if not plan.in_world:
        return ""
    times = ("", "") if stop is None else (_time(plan, stop.begin_time), _time(plan, stop.departure_time))
    return "".join(f'<td class="n">{time}</td>' for time in times)


def _waiting(plan: FlownPlan, route: FlownRoute, number: int) -> str:
    waits = route.waiting_in_air(number)
    return f"<br>waits {_duration(plan, waits)} in the air" if waits > 0.0 else ""


def _take_off(plan: FlownPlan, route: FlownRoute) -> str:
    """Say when a UAV takes off, where that is not at once."""
    waits = route.waiting_on_ground
    takes_off = route.uav.available_from + waits
    if not route.starts_at_home or takes_off <= 0.0:
        return ""
    why = f" (waits {_duration(plan, waits)} on the ground)" if waits > 0.0 else ""
    return f"; takes off {_time(plan, takes_off)}{why}"


def _duration(plan: FlownPlan, time: float) -> str:
    return _time(plan, time).removeprefix("+")


def _position(plan: FlownPlan, x: float, y: float) -> str:
    if plan.problem.crs != "wgs84":
        return f"{x:g}, {y:g}"
    return f"{abs(y):.5f}° {'N' if y >= 0 else 'S'}, {abs(x):.5f}° {'E' if x >= 0 else 'W'}"


def _unmet(plan: FlownPlan) -> str:
    if not plan.unmet:
        return "<section><h2>Unmet needs</h2><p>None: every area gets all it needs.</p></section>"
    rows = "".join(
        f'<tr><td>{escape(_called(each.target))}</td><td class="n">{each.target.level:g}</td>'
        f'<td class="n">{_amounts(each.remaining)}</td><td class="why">{escape(each.reason)}</td></tr>'
        for each in plan.unmet
    )
    return (
        '<section><h2>Unmet needs</h2><table><thead><tr><th>Area</th><th class="n">Level</th>'
        f'<th class="n">Still needed</th><th>Why</th></tr></thead><tbody>{rows}</tbody></table></section>'
    )


def _colour(route: FlownRoute) -> str:
    return _COLOURS[route.number % len(_COLOURS)]


def _map(plan: FlownPlan) -> str:
    shapes = "".join(_shapes(plan))
    return (
        f'<svg viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" aria-label="Map of the routes" '
        f'font-family="sans-serif" font-size="10">{shapes}</svg>'
    )


def _shapes(plan: FlownPlan) -> Iterator[str]:
    problem = plan.problem
    given = [x for u in problem.uavs for x in (u.x_s, u.x_c)] + [t.x for t in problem.targets]
    corners = [corner for zone in problem.no_fly_zones for corner in zone.polygon]
    given += [x for x, _ in corners]
    # One map without the jump at the antimeridian; places are drawn where it has them.
    xs = unrolled(problem.crs, np.array(given))
    on_map = dict(zip(given, xs.tolist(), strict=True))
    around = 360.0 if problem.crs == "wgs84" else math.inf
    ys = [y for u in problem.uavs for y in (u.y_s, u.y_c)] + [t.y for t in problem.targets]
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
            f'stroke-dasharray="4 2"><title>{escape(_called(zone))}</title></polygon>'
        )
    for route in plan.flying:
        uav = route.uav
        places = [(uav.x_c, uav.y_c)]
        for stop in route.stops:
            places += stop.path[1:]
        places += route.return_path[1:]
        for line in _lines([(on_map[x], y) for x, y in places], around):
            points = " ".join("{:.1f},{:.1f}".format(*place(x, y)) for x, y in line)
            yield f'<polyline points="{points}" fill="none" stroke="{_colour(route)}" stroke-width="1.5"/>'
    for target in problem.targets:
        x, y = at(target.x, target.y)
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="#fff" stroke="#111"/>'
        yield f'<text x="{x + 6:.1f}" y="{y + 3:.1f}">{escape(_called(target))}</text>'
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
