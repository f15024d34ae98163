"""Whether direct flights tell what no plan can do."""

from __future__ import annotations

from app.domain.problem import Problem

_SEVERAL = 2
"""Bases from which on a flight may lead from one to another by way of an area."""


def direct_flights_tell(problem: Problem) -> bool:
    """Whether what no direct flight can do, from the start or a base flown to directly, no plan can do.

    Where it is false, a way over other places may be shorter in the air or in time than the direct one, or
    exist where that does not: of `matrices`, in wind on the globe or round zones, and with several bases.
    """
    windy = problem.wind is not None and problem.wind.speed > 0.0
    bent = windy and (problem.crs == "wgs84" or bool(problem.no_fly_zones))
    return problem.matrices is None and not bent and len(problem.bases) < _SEVERAL
