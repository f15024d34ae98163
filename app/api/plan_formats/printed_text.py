"""How amounts, times and positions are written on a printed page."""

from __future__ import annotations

from app.api.plan_formats.flown_plan import FlownPlan
from app.domain.clock import clock
from app.domain.problem import UAV, Target
from app.domain.surroundings import Base, NoFlyZone

_DAY_MINUTES = 24 * 60
_BETWEEN = " · "


def unit_text(plan: FlownPlan, unit: str) -> str:
    """Return a unit where the problem has units."""
    return unit if plan.problem.crs == "wgs84" else ""


def called(item: UAV | Target | Base | NoFlyZone) -> str:
    """Name an item for people: names need not be unique, so the id is there too."""
    return item.id if item.name in (None, item.id) else f"{item.name} ({item.id})"


def time_text(plan: FlownPlan, time: float | None) -> str:
    """Write a time: of the day where it is known when the plan begins, from its begin otherwise.

    A dash where the time is not known.
    """
    if time is None:
        return "–"
    if plan.problem.crs != "wgs84":
        return f"{time:.4g}"
    if plan.begins is None:
        return f"+{clock(time)} h"
    days, minutes = divmod(60 * plan.begins.hour + plan.begins.minute + round(60 * time), _DAY_MINUTES)
    return f"{minutes // 60:02d}:{minutes % 60:02d}" + (f" +{days} d" if days else "")


def amounts_text(amounts: tuple[float, ...]) -> str:
    """Write amounts, one a material."""
    return _BETWEEN.join(f"{amount:g}" for amount in amounts)


def named_amounts_text(plan: FlownPlan, amounts: tuple[float, ...]) -> str:
    """Write the amounts that are not 0, each with the name of its material where it has one."""
    named = plan.problem.materials
    names = [f" of {each.name}" for each in named] or [
        f" of material {k}" if len(amounts) > 1 else "" for k in range(1, len(amounts) + 1)
    ]
    some = [f"{amount:g}{name}" for amount, name in zip(amounts, names, strict=True) if amount]
    return ", ".join(some) or "nothing"


def materials_text(plan: FlownPlan, title: str) -> str:
    """Write what stands above amounts: a title, and the names of the materials where they have any."""
    named = plan.problem.materials
    return f"{title}: {_BETWEEN.join(each.name for each in named)}" if named else title


def duration_text(plan: FlownPlan, time: float) -> str:
    """Write how long something takes."""
    return f"{clock(time)} h" if plan.problem.crs == "wgs84" else f"{time:.4g}"


def position_text(plan: FlownPlan, x: float, y: float) -> str:
    """Write a position as people read it out."""
    if plan.problem.crs != "wgs84":
        return f"{x:g}, {y:g}"
    return f"{abs(y):.5f}° {'N' if y >= 0 else 'S'}, {abs(x):.5f}° {'E' if x >= 0 else 'W'}"
