"""Task summaries: what two tasks have in common whatever their sizes.

The paper compares tasks number by number (:mod:`app.library.description`), so only tasks of the same M, N and
K can be compared, and the same task with its UAVs in another order is another task. A summary is a row of 28
numbers that depends neither on sizes being equal, nor on the order of UAVs, targets or materials, nor on
units, nor on where on the map the task lies. Every number is a share, a bounded ratio or a logarithm of a
size, so that none decides alone; tasks are as far apart as the sum of squared differences says.

Of the world beyond places, loads and deadlines it has what changes one of these numbers: reserve and
endurance shorten the range, skills and exclusions leave fewer pairs in range. ``README.md`` says why there
are no more.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from app.domain.geometry import distances, unrolled
from app.domain.problem import TOLERANCE, UAV, Problem

SUMMARY_SPACE = "task-summary-1"
"""Kind and version of the features; tasks of every size share it."""

FEATURES = (
    "uavs",
    "targets",
    "materials",
    "supply_against_demand",
    "demand_that_supply_covers",
    "load_against_need",
    "load_dispersion",
    "need_dispersion",
    "level_dispersion",
    "base_spread",
    "target_spread",
    "target_clustering",
    "target_elongation",
    "base_to_target",
    "range",
    "range_dispersion",
    "pairs_in_range",
    "speed_dispersion",
    "cost_against_level",
    "steps",
    "visits_against_targets",
    "deadline_share",
    "deadline_tightness",
    "service_time",
    "mission_progress",
    "displacement",
    "returning_share",
    "objective",
)
"""What the numbers of a summary mean, in order."""

_MOST_POINTS = 512
"""Spreads are taken over at most so many points: their matrix of distances grows with the square."""

_OF_SIZE = 4.0
"""A task of e^4 = 55 times the size is 1 apart."""


def task_summary(problem: Problem) -> npt.NDArray[np.float64]:
    """Summarise a task.

    Parameters
    ----------
    problem
        M UAVs, N targets, K materials.

    Returns
    -------
    numpy.ndarray
        Shape (28,), finite; see :data:`FEATURES`.
    """
    uavs, targets = problem.uavs, problem.targets
    extent, across = problem.extent, _straight(problem).extent
    out = np.array([not u.ret for u in uavs])
    load = np.array([u.loadlist for u in uavs]) * out[:, None]  # (M, K) what can still be delivered
    need = np.array([t.need for t in targets])  # (N, K)
    wanted = need.sum(axis=1) > 0
    supply, demand = load.sum(axis=0), need.sum(axis=0)
    covered = np.minimum(supply, demand).sum()

    start = np.array([(u.x_s, u.y_s) for u in uavs])
    current = np.array([(u.x_c, u.y_c) for u in uavs])
    area = np.array([(t.x, t.y) for t in targets])
    to_target = distances(problem.crs, current, area)  # (M, N)
    apart = distances(problem.crs, _some(area), _some(area))
    home = distances(problem.crs, start, area) if problem.objective.return_to_base else 0.0
    voyage = np.array([u.voyage for u in uavs])
    flown = np.array([u.dis for u in uavs])
    speed = np.array([u.speed for u in uavs])
    usable = np.array([_usable_range(u) for u in uavs])
    left = np.maximum(usable - flown, 0.0)
    # Where legs are from matrices they are taken to be as long as positions say, in their own unit.
    unit = extent / across
    reach = flown[:, None] + to_target * unit + home * unit
    in_range = (reach <= usable[:, None] * (1.0 + TOLERANCE)) & out[:, None] & wanted[None, :]
    in_range &= _may_visit(problem)

    crossing = extent / speed.mean()
    level = np.array([t.urgency for t in targets])
    deadlines = np.array([t.deadline for t in targets if t.deadline is not None])
    time_allowed = np.maximum(deadlines, 0.0).mean() if len(deadlines) else np.inf
    service = np.array([t.service_time for t in targets])
    visits = problem.max_steps * problem.n_uavs
    moved = np.diagonal(distances(problem.crs, start, current))
    features = {
        "uavs": math.log(problem.n_uavs) / _OF_SIZE,
        "targets": math.log(problem.n_targets) / _OF_SIZE,
        "materials": math.log(problem.n_materials) / _OF_SIZE,
        "supply_against_demand": _against(supply.sum(), demand.sum()),
        "demand_that_supply_covers": _share(covered, demand.sum()),
        "load_against_need": _against(load.mean(), need.mean()),
        "load_dispersion": _dispersion(load.sum(axis=1)),
        "need_dispersion": _dispersion(need.sum(axis=1)),
        "level_dispersion": _dispersion(level),
        "base_spread": _mean_distance(problem, start) / across,
        "target_spread": float(apart.mean()) / across,
        "target_clustering": min(_nearest_neighbour(apart) * math.sqrt(len(apart)) / across, 1.0),
        "target_elongation": _elongation(problem, area),
        "base_to_target": float(to_target.mean()) / across,
        "range": _against(left.mean(), extent),
        "range_dispersion": _dispersion(left),
        "pairs_in_range": _share(in_range.sum(), out.sum() * wanted.sum()),
        "speed_dispersion": _dispersion(speed),
        "cost_against_level": _against(problem.distance_weight * extent, level.mean()),
        "steps": math.log(problem.max_steps) / _OF_SIZE,
        "visits_against_targets": _against(visits, problem.n_targets),
        "deadline_share": len(deadlines) / problem.n_targets,
        "deadline_tightness": _against(crossing, time_allowed),
        "service_time": _against(service.mean(), crossing),
        "mission_progress": _share(np.minimum(flown, voyage).sum(), voyage.sum()),
        "displacement": min(float(moved.mean()) / across, 1.0),
        "returning_share": 1.0 - float(out.mean()),
        "objective": 0.5 * problem.objective.return_to_base + 0.5 * (not problem.objective.charge_return),
    }
    return np.array([features[name] for name in FEATURES], dtype=np.float64)


def _straight(problem: Problem) -> Problem:
    """Return the task with legs between positions, which with matrices may have a size of their own."""
    if problem.matrices is None:
        return problem
    uavs = tuple(replace(u, location=None, home_location=None, profile=None) for u in problem.uavs)
    targets = tuple(replace(t, location=None) for t in problem.targets)
    bases = tuple(replace(base, location=None) for base in problem.bases)
    return replace(problem, uavs=uavs, targets=targets, bases=bases, matrices=None)


def _usable_range(uav: UAV) -> float:
    """Return how long the whole flight of a UAV can be, by its range and by its endurance."""
    share = 1.0 - uav.reserve
    by_range = uav.voyage * share
    if uav.endurance is None:
        return by_range
    return min(by_range, uav.dis + (uav.endurance * share - uav.airborne) * uav.speed)


def _may_visit(problem: Problem) -> npt.NDArray[np.bool_]:
    """Return (M, N) whether each UAV may be sent to each target, by skills and exclusions."""
    allowed = np.ones((problem.n_uavs, problem.n_targets), np.bool_)
    needed = [set(t.skills) for t in problem.targets]
    if any(needed):
        allowed &= [[each <= set(u.skills) for each in needed] for u in problem.uavs]
    place = {t.id: j for j, t in enumerate(problem.targets)}
    for i, uav in enumerate(problem.uavs):
        allowed[i, [place[identifier] for identifier in uav.excluded]] = False
    return allowed


def _against(a: float, b: float) -> float:
    """Compare two amounts of one unit: 0 for nothing against something, 1/2 for equal ones, towards 1."""
    return float(a / (a + b)) if a + b > 0 else 0.5


def _share(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else 0.0


def _dispersion(amounts: npt.NDArray[np.float64]) -> float:
    """Coefficient of variation, mapped to 0..1."""
    return _against(float(amounts.std()), float(amounts.mean())) if amounts.any() else 0.0


def _some(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """At most ``_MOST_POINTS`` points, the same whatever their order."""
    if len(points) <= _MOST_POINTS:
        return points
    ordered = points[np.lexsort(points.T)]
    return ordered[np.linspace(0, len(points) - 1, _MOST_POINTS).astype(np.int64)]


def _mean_distance(problem: Problem, points: npt.NDArray[np.float64]) -> float:
    some = _some(points)
    return float(distances(problem.crs, some, some).mean())


def _nearest_neighbour(apart: npt.NDArray[np.float64]) -> float:
    """Mean distance (P, P) of a point from the nearest other one; 0 where there is none."""
    if len(apart) < 2:
        return 0.0
    others = apart.copy()
    np.fill_diagonal(others, np.inf)
    return float(others.min(axis=1).mean())


def _elongation(problem: Problem, points: npt.NDArray[np.float64]) -> float:
    """How much longer than wide the cloud of points is: 0 for a round one, 1 for points on a line."""
    flat = np.column_stack([unrolled(problem.crs, points[:, 0]), points[:, 1]])
    plane = flat - flat.mean(axis=0)
    if problem.crs == "wgs84":
        plane = plane * [math.cos(math.radians(float(points[:, 1].mean()))), 1.0]
    narrow, wide = np.sqrt(np.maximum(np.linalg.eigvalsh(plane.T @ plane), 0.0))
    return 1.0 - float(narrow / wide) if wide > 0 else 0.0
