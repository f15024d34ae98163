"""What in a problem was probably not meant. It is taken as it is: a warning refuses nothing.

Every check is either a fact (nobody carries what is needed) or a guess that ordinary problems stay far away
from (a point is ten times as far off as the rest is wide, and out of everybody's range).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app.domain.geometry import EARTH_RADIUS_KM, distances, unrolled
from app.domain.hindrances import hindrances
from app.domain.problem import TOLERANCE, Problem
from app.domain.supplies import loads_later, most_loaded
from app.domain.time_warnings import odd_times

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

CODES = (
    "all_returning",
    "committed_beyond_steps",
    "committed_in_vain",
    "coordinates_swapped",
    "deadline_passed",
    "degrees_on_plane",
    "earliest_after_deadline",
    "far_point",
    "inside_zone",
    "never_available",
    "no_capacity",
    "no_level",
    "none_in_range",
    "not_carried",
    "not_needed",
    "nothing_needed",
    "one_place",
    "range_implausible",
    "range_spent",
    "speed_implausible",
    "wind_too_strong",
)
"""Every code that a warning can have."""

MOST = 10
"""Warnings of one code; the last one says how many more there are."""

_FAR = 10.0
"""Times the width of all other places that a place must be away from them to count as far."""

_FEWEST_PLACES = 5
"""Of fewer places none is an outlier, and small regions are chance."""

_OUTLIERS = 0.25
"""Share of the places that may be far; more are a second group."""

_NEARER = 10.0
"""Times as near that exchanged coordinates must be to the other kind of points."""

_NEAR_RANGES = 5.0
"""Ranges within which exchanged coordinates must be."""

_ROUND_THE_EARTH_KM = 2 * math.pi * EARTH_RADIUS_KM
_SLOWEST_KM_H, _FASTEST_KM_H = 1.0, 1235.0
"""A slow walk, and sound."""

_CROSSINGS = 1e8
"""Time units to cross a plane, or crossings in a time unit, beyond which a speed is of another unit."""

_OFF_ORIGIN, _AMPLE_RANGE = 3.0, 25.0
"""Extents of a plane: how far from 0, 0 it must lie to be one of degrees, and how far its UAVs must fly."""

_LEAST_RANGE_KM = 5.0
"""Range that its UAVs must have, in whatever unit."""

_ROUGH_KM = 0.2
"""By what nearest distances on the globe, which are found by chords, may be wrong."""


@dataclass(frozen=True, slots=True)
class ProblemWarning:
    """One warning.

    Attributes
    ----------
    pointer
        JSON pointer into the problem (RFC 6901).
    code
        One of :data:`CODES`.
    detail
        One sentence for people, with its numbers.
    """

    pointer: str
    code: str
    detail: str


class _Scene(NamedTuple):
    """A problem in arrays; M UAVs, N targets, K materials."""

    problem: Problem
    start: Floats  # (M, 2)
    current: Floats  # (M, 2)
    area: Floats  # (N, 2)
    ready: Flags  # (M,) not returning
    wanted: Flags  # (N,) needs anything
    left: Floats  # (M,) range left, with the tolerance of the rules
    load: Floats  # (M, K) the larger of what it carries and what it can load
    need: Floats  # (N, K)
    near_uav: Floats  # (M,) distance to the nearest wanted target, roughly
    near_target: Floats  # (N,) distance to the nearest ready UAV, or base, roughly


def problem_warnings(problem: Problem) -> tuple[ProblemWarning, ...]:
    """List what in a problem was probably not meant.

    Parameters
    ----------
    problem
        M UAVs, N targets; it takes some 20 ms where M is 1000 and N is 2000.
    """
    scene = _scene(problem)
    listed = (*odd_times(problem), *hindrances(problem))
    times = (warning for code, places in listed for warning in warnings_of(code, places))
    found = [*_supplies(scene), *times, *_speeds_and_ranges(scene), *_levels(scene)]
    if problem.matrices is not None:
        # Positions are for display alone.
        return tuple(found)
    places = np.concatenate([scene.start, scene.current, scene.area])
    if (places == places[0]).all():
        if problem.n_targets > 1:
            found.append(ProblemWarning("/targets/0/x", "one_place", "all positions are one and the same"))
        return tuple(found)
    swapped = list(_swapped_targets(scene)) if problem.crs == "wgs84" else []
    found += swapped or _far_points(scene, places)
    if problem.crs == "local":
        found += _degrees(scene, places)
    # With a wind behind it a UAV gets farther than its range, and with bases on the way.
    plain = not problem.bases and (problem.wind is None or not problem.wind.speed)
    if plain and scene.ready.any() and scene.wanted.any() and not _anyone_in_range(scene):
        back = " and the way home" if problem.objective.return_to_base else ""
        says = f"no UAV that can be sent has the range for any target that needs anything{back}"
        found.append(ProblemWarning("/uavs", "none_in_range", says))
    return tuple(found)


def _scene(problem: Problem) -> _Scene:
    uavs, targets, most = problem.uavs, problem.targets, most_loaded(problem)
    of_uavs = np.array(
        [
            (
                u.x_s,
                u.y_s,
                u.x_c,
                u.y_c,
                u.voyage,
                u.dis,
                u.ret,
                *(map(max, u.loadlist, loads_later(problem, u, most[i]))),
            )
            for i, u in enumerate(uavs)
        ],
        dtype=np.float64,
    )
    area = np.array([(t.x, t.y) for t in targets], dtype=np.float64)
    need = np.array([t.need for t in targets], dtype=np.float64)
    ready: Flags = of_uavs[:, 6] == 0.0
    wanted: Flags = need.max(axis=1) > 0.0
    left = of_uavs[:, 4] * (1.0 + TOLERANCE) - of_uavs[:, 5]
    near_uav, near_target = _nearest(problem.crs, of_uavs[:, 2:4], area, ready, wanted)
    if problem.bases:
        bases = np.array([(base.x, base.y) for base in problem.bases], dtype=np.float64)
        _, near_base = _nearest(problem.crs, bases, area, np.ones(len(bases), np.bool_), wanted)
        near_target = np.minimum(near_target, near_base)
    return _Scene(
        problem, of_uavs[:, 0:2], of_uavs[:, 2:4], area, ready, wanted, left, of_uavs[:, 7:], need, near_uav,
        near_target,
    )  # fmt: skip


def _nearest(crs: str, a: Floats, b: Floats, of_a: Flags, of_b: Flags) -> tuple[Floats, Floats]:
    """Return how far all `a` are from the nearest of some `b`, and those `b` from the nearest of some `a`.

    They are infinite where there are none, and for the other `b`. On the globe they are found by chords, and
    may be wrong by ``_ROUGH_KM`` or a millionth.
    """
    some = b[of_b]
    if crs == "local":
        squares = (a[:, 0, None] - some[None, :, 0]) ** 2
        squares += (a[:, 1, None] - some[None, :, 1]) ** 2
    else:
        squares = _on_sphere(a) @ (-2.0 * _on_sphere(some).T)
        squares += 2.0
    near_a, near_b = np.full(len(a), np.inf), np.full(len(b), np.inf)
    near_a[:] = squares.min(axis=1, initial=np.inf)
    near_b[of_b] = (squares if of_a.all() else squares[of_a]).min(axis=0, initial=np.inf)
    return _length(crs, near_a), _length(crs, near_b)


def _length(crs: str, squares: Floats) -> Floats:
    """Return distances: on the globe from the squares of chords of the unit sphere."""
    lengths = np.sqrt(np.maximum(squares, 0.0))
    if crs == "local":
        return lengths
    arcs = 2.0 * EARTH_RADIUS_KM * np.arcsin(np.minimum(lengths / 2.0, 1.0))
    return np.where(np.isinf(squares), np.inf, arcs)


def _on_sphere(points: Floats) -> Floats:
    longitude, latitude = np.radians(points[:, 0]), np.radians(points[:, 1])
    flat = np.cos(latitude)
    return np.stack([flat * np.cos(longitude), flat * np.sin(longitude), np.sin(latitude)], axis=1)


def warnings_of(code: str, found: Sequence[tuple[str, str]]) -> Iterator[ProblemWarning]:
    """Make warnings of one code out of pointers and details: ten at most, and the last counts all others."""
    for number, (pointer, detail) in enumerate(found[:MOST], 1):
        more = len(found) - MOST
        tail = f"; so it is at {more} more places" if number == MOST and more > 0 else ""
        yield ProblemWarning(pointer, code, detail + tail)


def _supplies(scene: _Scene) -> Iterator[ProblemWarning]:
    if not scene.wanted.any():
        yield ProblemWarning("/targets", "nothing_needed", "no target needs anything")
        return
    if not scene.ready.any():
        yield ProblemWarning("/uavs", "all_returning", "every UAV is returning, so none can be sent")
        return
    carried = (scene.load[scene.ready] > 0.0).any(axis=0)
    for k in np.flatnonzero(scene.need.any(axis=0) & ~carried):
        needing = np.flatnonzero(scene.need[:, k])
        says = (
            f"material {k + 1} is needed by {len(needing)} targets, and no UAV that can be sent carries any"
            + (", or can load any" if scene.problem.bases else "")
        )
        yield ProblemWarning(f"/targets/{needing[0]}/loadlist/{k}", "not_carried", says)
    for k in np.flatnonzero(~scene.need.any(axis=0) & carried):
        carrying = np.flatnonzero(scene.ready & (scene.load[:, k] > 0.0))
        says = f"material {k + 1} is carried by {len(carrying)} UAVs, and no target needs any"
        yield ProblemWarning(f"/uavs/{carrying[0]}/loadlist/{k}", "not_needed", says)


def _levels(scene: _Scene) -> Iterator[ProblemWarning]:
    levels = [t.level for t, wanted in zip(scene.problem.targets, scene.wanted, strict=True) if wanted]
    if levels and not any(levels):
        says = "the level of every target that needs anything is 0, so nothing is worth a flight"
        yield ProblemWarning(f"/targets/{np.argmax(scene.wanted)}/level", "no_level", says)


def _speeds_and_ranges(scene: _Scene) -> Iterator[ProblemWarning]:
    problem = scene.problem
    on_globe, extent = problem.crs == "wgs84", problem.extent
    slowest, fastest = (
        (_SLOWEST_KM_H, _FASTEST_KM_H) if on_globe else (extent / _CROSSINGS, extent * _CROSSINGS)
    )
    unit = " km/h" if on_globe else ""
    odd, long, spent = [], [], []
    for i, uav in enumerate(problem.uavs):
        if not slowest <= uav.speed <= fastest:
            limit = f"slower than {slowest:g}" if uav.speed < slowest else f"faster than {fastest:g}"
            odd.append((f"/uavs/{i}/speed", f"{uav.id!r} flies {uav.speed:g}{unit}, {limit}{unit}"))
        if on_globe and uav.voyage > _ROUND_THE_EARTH_KM:
            says = f"the range of {uav.id!r}, {uav.voyage:g} km, is more than once round the Earth"
            long.append((f"/uavs/{i}/voyage", says))
        if scene.left[i] < 0.0 and not uav.ret:
            says = f"{uav.id!r} has flown {uav.dis:g}, more than its range of {uav.voyage:g}"
            spent.append((f"/uavs/{i}/dis", says))
    yield from warnings_of("speed_implausible", odd)
    yield from warnings_of("range_implausible", long)
    yield from warnings_of("range_spent", spent)


def _swapped_targets(scene: _Scene) -> Iterator[ProblemWarning]:
    """Targets out of range that would be near the UAVs with latitude and longitude exchanged."""
    farthest = float(scene.left[scene.ready].max(initial=0.0))
    asked = np.flatnonzero(
        scene.wanted
        & (scene.near_target > farthest)
        & (np.abs(scene.area[:, 0]) <= 90.0)
        & np.isfinite(scene.near_target)
    )
    if not len(asked) or farthest <= 0.0:
        return
    exchanged = scene.area[asked][:, ::-1]
    all_asked = np.ones(len(asked), np.bool_)
    _, near = _nearest("wgs84", scene.current, exchanged, scene.ready, all_asked)
    before = scene.near_target[asked]
    swapped = (near <= _NEAR_RANGES * farthest) & (near * _NEARER <= before)
    found = [
        (
            f"/targets/{asked[q]}/x",
            f"{scene.problem.targets[asked[q]].id!r} is {before[q]:.6g} km from the nearest UAV; with "
            f"latitude and longitude exchanged, here or at the UAVs, it would be {near[q]:.6g} km",
        )
        for q in np.flatnonzero(swapped)
    ]
    yield from warnings_of("coordinates_swapped", found)


def _far_points(scene: _Scene, places: Floats) -> Iterator[ProblemWarning]:
    """Places far away from all others, and out of range; some because their coordinates are exchanged."""
    crs = scene.problem.crs
    flat = np.column_stack([unrolled(crs, places[:, 0]), places[:, 1]])
    distinct, first = np.unique(flat, axis=0, return_index=True)
    count = len(distinct)
    if count < _FEWEST_PLACES:
        return
    middle = _rolled(crs, np.median(distinct, axis=0, keepdims=True))
    distinct = _rolled(crs, distinct)
    away = distances(crs, middle, distinct)[0]
    order = np.argsort(away, kind="stable")
    # The first long step outwards that leaves most places inside.
    steps = np.arange(count - 1 - max(1, int(_OUTLIERS * count)), count - 1)
    near, far = away[order[steps]], away[order[steps + 1]]
    steps = steps[(near > 0.0) & (far > 2.0 * _FAR * near)]
    if not len(steps):
        return
    radius = float(away[order[steps[0]]])
    found: dict[str, list[tuple[str, str]]] = {"coordinates_swapped": [], "far_point": []}
    for q in order[steps[0] + 1 :]:
        pointer, name, out_of_reach = _place(scene, int(first[q]))
        if not out_of_reach:
            continue
        says = (
            f"{name} is {away[q]:.6g} from the middle of all others, {away[q] / (2.0 * radius):.3g} times "
            "the width of the region that they lie in"
        )
        if scene.problem.objective.distance_weight is None:
            says += "; distance counts for about as many times less because of it"
        x, y = distinct[q]
        code = "far_point"
        if crs == "wgs84" and abs(x) <= 90.0:
            then = float(distances(crs, middle, np.array([[y, x]]))[0, 0])
            if then <= 2.0 * _FAR * radius and then * _NEARER <= away[q]:
                code = "coordinates_swapped"
                says += f"; with latitude and longitude exchanged it would be {then:.6g}"
        found[code].append((pointer, says))
    for code, each in found.items():
        yield from warnings_of(code, each)


def _place(scene: _Scene, at: int) -> tuple[str, str, bool]:
    """Return pointer, name, and whether nobody gets there, of a start, a current position or a target."""
    problem, m = scene.problem, len(scene.start)
    if at >= 2 * m:
        j = at - 2 * m
        farthest = float(scene.left[scene.ready].max(initial=0.0))
        return f"/targets/{j}/x", repr(problem.targets[j].id), bool(scene.near_target[j] > farthest)
    i = at % m
    if at >= m:
        return f"/uavs/{i}/x_c", repr(problem.uavs[i].id), bool(scene.near_uav[i] > scene.left[i])
    to_areas = distances(problem.crs, scene.start[i : i + 1], scene.area[scene.wanted])
    alone = bool(to_areas.min(initial=np.inf) > scene.left[i])
    return f"/uavs/{i}/x_s", f"the starting point of {problem.uavs[i].id!r}", alone


def _rolled(crs: str, points: Floats) -> Floats:
    """Bring longitudes back to -180..180."""
    if crs == "local":
        return points
    return np.column_stack([np.where(points[:, 0] > 180.0, points[:, 0] - 360.0, points[:, 0]), points[:, 1]])


def _degrees(scene: _Scene, places: Floats) -> Iterator[ProblemWarning]:
    """A plane on which everything lies as degrees do, off the origin, with ranges as they are in km."""
    extent = scene.problem.extent
    in_degrees = bool((np.abs(places) <= (180.0, 90.0)).all() and (places % 1.0).any())
    if not in_degrees or len(np.unique(places, axis=0)) < _FEWEST_PLACES:
        return
    off = float(np.hypot(*places.mean(axis=0)))
    ranges = float(np.median([uav.voyage for uav in scene.problem.uavs]))
    if off > _OFF_ORIGIN * extent and ranges > max(_LEAST_RANGE_KM, _AMPLE_RANGE * extent):
        says = (
            f"x and y look like degrees: all lie within {extent:.4g} of each other and {off:.4g} from 0, 0, "
            f"and the ranges are {ranges:g}; crs is 'local', a plane, not 'wgs84'"
        )
        yield ProblemWarning("/crs", "degrees_on_plane", says)


def _anyone_in_range(scene: _Scene) -> bool:
    """Whether a UAV has the range for a target that needs anything, by the rules."""
    problem, area = scene.problem, scene.area[scene.wanted]
    # Most cannot get anywhere where nobody can: a rough distance tells, and the others are looked at.
    nearest = scene.near_uav - (_ROUGH_KM + scene.near_uav * TOLERANCE if problem.crs == "wgs84" else 0.0)
    for i in np.flatnonzero(scene.ready & (nearest <= scene.left * (1.0 + TOLERANCE))):
        way = distances(problem.crs, scene.current[i : i + 1], area)
        if problem.objective.return_to_base:
            way = way + distances(problem.crs, scene.start[i : i + 1], area)
        if (way <= scene.left[i]).any():
            return True
    return False
