"""How amounts, times and positions are written on a printed page."""

from __future__ import annotations

from app.api.plan_formats.flown_plan import FlownPlan
from app.domain.problem import UAV, Target
from app.domain.surroundings import Base, NoFlyZone


def clock(hours: float) -> str:
    """Write a time in h as hours and minutes, rounded to the minute."""
    minutes = round(hours * 60)
    return f"{minutes // 60}:{minutes % 60:02d}"


def unit_text(plan: FlownPlan, unit: str) -> str:
    """Return a unit where the problem has units."""
    return unit if plan.problem.crs == "wgs84" else ""


def called(item: UAV | Target | Base | NoFlyZone) -> str:
    """Name an item for people: names need not be unique, so the id is there too."""
    return item.id if item.name in (None, item.id) else f"{item.name} ({item.id})"


def time_text(plan: FlownPlan, time: float | None) -> str:
    """Write a time from the plan's begin; a dash where it is not known."""
    if time is None:
        return "–"
    return f"+{clock(time)} h" if plan.problem.crs == "wgs84" else f"{time:.4g}"


def amounts_text(amounts: tuple[float, ...]) -> str:
    """Write amounts, one a material."""
    return " · ".join(f"{amount:g}" for amount in amounts)


def duration_text(plan: FlownPlan, time: float) -> str:
    """Write how long something takes."""
    return time_text(plan, time).removeprefix("+")


def position_text(plan: FlownPlan, x: float, y: float) -> str:
    """Write a position as people read it out."""
    if plan.problem.crs != "wgs84":
        return f"{x:g}, {y:g}"
    return f"{abs(y):.5f}° {'N' if y >= 0 else 'S'}, {abs(x):.5f}° {'E' if x >= 0 else 'W'}"
