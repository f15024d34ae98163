"""What keeps UAVs from flying, whatever the plan: zones that they are in, wind, promises they cannot keep."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from app.domain.geometry import distance
from app.domain.plane import Plane
from app.domain.problem import TOLERANCE, UAV, Problem, Target
from app.domain.time_warnings import Found

Floats = npt.NDArray[np.float64]
Place = tuple[str, str, tuple[float, float]]
"""A pointer, what lies there, and where that is."""

_TOUCHING = 1e-9
"""Sizes of the scene that a place inside a zone is away from its border; nearer ones lie on it."""


def hindrances(problem: Problem) -> Iterator[Found]:
    """Yield the places of UAVs, bases, wind and promises that ground somebody."""
    yield "inside_zone", list(_inside_zones(problem))
    wind = 0.0 if problem.wind is None else problem.wind.speed
    yield (
        "wind_too_strong",
        [
            (
                f"/uavs/{i}/speed",
                f"{uav.id!r} flies {uav.speed:g}, no faster than the wind, {wind:g}: "
                "it cannot fly against it",
            )
            for i, uav in enumerate(problem.uavs)
            if 0.0 < uav.speed <= wind and not uav.ret
        ],
    )
    targets = {target.id: target for target in problem.targets}
    promised = ((i, uav, _in_vain(problem, uav, targets)) for i, uav in enumerate(problem.uavs))
    yield (
        "committed_in_vain",
        [
            (
                f"/uavs/{i}/committed/{which[0]}",
                f"{uav.id!r} makes no visit before that of {uav.committed[which[0]]!r}, which is promised, "
                f"and cannot make it: {which[1]}",
            )
            for i, uav, which in promised
            if which is not None
        ],
    )


def _in_vain(problem: Problem, uav: UAV, targets: dict[str, Target]) -> tuple[int, str] | None:
    """Return the first promised visit of a UAV that no plan can have, and why; None where there is none."""
    if uav.ret:
        return None
    # Legs of matrices, and those with the wind, may be shorter than they look.
    plain = problem.matrices is None and (problem.wind is None or not problem.wind.speed)
    x, y, flown = uav.x_c, uav.y_c, uav.dis
    usable = uav.voyage * (1.0 - uav.reserve) * (1.0 + TOLERANCE)
    for c, target_id in enumerate(uav.committed):
        target = targets[target_id]
        lacked = sorted(set(target.skills) - set(uav.skills))
        flown += distance(problem.crs, x, y, target.x, target.y) if plain else 0.0
        x, y = target.x, target.y
        if lacked:
            return c, f"it has not the skills {', '.join(lacked)}"
        if not any(target.need):
            return c, "that needs nothing"
        if not any(load > 0.0 and need > 0.0 for load, need in zip(uav.loadlist, target.need, strict=True)):
            return c, "it carries nothing that is needed there"
        if target.deadline is not None and target.deadline < uav.available_from:
            return c, f"the deadline there is {target.deadline:g}, and it takes off at {uav.available_from:g}"
        if flown > usable:
            return c, f"it would have flown {flown:g} there, and may fly {uav.voyage * (1.0 - uav.reserve):g}"
    return None


def _inside_zones(problem: Problem) -> Iterator[tuple[str, str]]:
    """Yield the positions of UAVs and bases that lie inside a zone."""
    zones = problem.no_fly_zones
    places = list(_places(problem))
    if not zones or not places:
        return
    # The same plane as that of the zones' rules, in which all has to lie.
    every = [(uav.x_s, uav.y_s) for uav in problem.uavs] + [(uav.x_c, uav.y_c) for uav in problem.uavs]
    every += [(target.x, target.y) for target in problem.targets]
    every += [(base.x, base.y) for base in problem.bases]
    every += [(x, y) for zone in zones for x, y in zone.polygon]
    plane = Plane.around(problem.crs, np.array(every))
    points = plane.flat(np.array([at for *_, at in places]))
    inside = {zone.id: _inside(points, plane.flat(np.array(zone.polygon))) for zone in zones}
    for p, (pointer, what, _) in enumerate(places):
        around = next((name for name, holds in inside.items() if holds[p]), None)
        if around is not None:
            yield pointer, f"{what} lies in the no-fly zone {around!r}: no way leads there or away"


def _places(problem: Problem) -> Iterator[Place]:
    for i, uav in enumerate(problem.uavs):
        start, now = (uav.x_s, uav.y_s), (uav.x_c, uav.y_c)
        if uav.ret:
            continue
        yield f"/uavs/{i}/x_s", f"the starting point of {uav.id!r}", start
        if now != start:
            yield f"/uavs/{i}/x_c", f"the position of {uav.id!r}", now
    for d, base in enumerate(problem.bases):
        yield f"/bases/{d}/x", f"base {base.id!r}", (base.x, base.y)


def _inside(points: Floats, polygon: Floats) -> npt.NDArray[np.bool_]:
    """Which of some points (P, 2) lie inside a polygon (C, 2), and not on its border."""
    inside = np.zeros(len(points), np.bool_)
    nearest = np.full(len(points), np.inf)
    x, y = points[:, 0], points[:, 1]
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / length, 0.0, 1.0) if length else np.zeros(len(x))
        nearest = np.minimum(nearest, np.hypot(ax + along * dx - x, ay + along * dy - y))
        if dy:
            crosses = ((ay > y) != (by > y)) & (x < ax + (y - ay) / dy * dx)
            inside ^= crosses
    return inside & (nearest > _TOUCHING)
