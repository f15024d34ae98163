"""Legs of a problem as arrays (section 8 of the rules): lengths, and times that do not follow from them.

UAVs that fly the same legs in the same time are of one class of legs: all of them on open ground or round
zones, those of one speed in wind, those of one profile (and, with durations, of no other difference) where
the request has matrices.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app.domain.errors import ProblemTooLarge
from app.domain.geometry import distance
from app.domain.problem import Problem, Target
from app.domain.said import said
from app.domain.surroundings import Base
from app.simulation.distances import between_points
from app.travel.choice import legs_between
from app.travel.legs import LegBlock, Legs
from app.travel.matrices import MatrixLegs
from app.travel.wind import Wind

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

UNREACHABLE = 1e30
"""Length and time of a leg that does not exist: beyond every limit, and finite, so nothing becomes NaN."""

MOST_LEGS = 100_000_000
"""Legs between targets and bases, over all classes; their lengths and times take 16 bytes each."""


class LegArrays(NamedTuple):
    """Legs of one problem; C is the number of classes.

    Lengths are over ground. Where times are not given they are lengths over speeds, and their arrays have no
    columns. Stops are targets and then bases, L of them.

    Attributes
    ----------
    start_target, between, home, start_home
        (M, L), (C, L, L), (M, L), (M,) lengths; the last two are to starting points, and 0 where no leg leads
        there.
    homeless, homeless_start
        (M, L) stops and (M,) UAVs from which no leg leads to the starting point.
    leg_class
        (M,) class of each UAV.
    timed, in_wind
        Whether times are given, and whether the air length is time · speed.
    metric
        Whether no way over a third place is shorter, or takes less time, than the leg itself.
    start_time, between_time, home_time, start_home_time
        Times of the same legs.
    """

    start_target: Floats
    between: Floats
    home: Floats
    start_home: Floats
    homeless: npt.NDArray[np.bool_]
    homeless_start: npt.NDArray[np.bool_]
    leg_class: Integers
    timed: bool
    in_wind: bool
    metric: bool
    start_time: Floats
    between_time: Floats
    home_time: Floats
    start_home_time: Floats


class _LegClass(NamedTuple):
    """UAVs that fly the same legs in the same time; `speed` is None where times follow from their own."""

    legs: Legs | MatrixLegs
    speed: float | None
    members: Integers


def places_of(problem: Problem) -> Floats:
    """Return current positions of M UAVs, their starting points, N targets, D bases, (2M + N + D, 2)."""
    uavs = problem.uavs
    places = [(u.x_c, u.y_c) for u in uavs] + [(u.x_s, u.y_s) for u in uavs]
    return np.array(places + [(stop.x, stop.y) for stop in stops_of(problem)], np.float64)


def stops_of(problem: Problem) -> tuple[Target | Base, ...]:
    """Return targets and bases, in this order."""
    return (*problem.targets, *problem.bases)


def zones_of(problem: Problem) -> list[Floats]:
    """Return the corners of each no-fly zone, (V, 2)."""
    return [np.array(zone.polygon, np.float64) for zone in problem.no_fly_zones]


def wind_of(problem: Problem) -> Wind | None:
    """Return the wind; None where the air is still."""
    given = problem.wind
    return None if given is None or given.speed == 0.0 else Wind(given.speed, given.towards)


def leg_arrays(problem: Problem) -> LegArrays:
    """Work out the legs of a problem.

    Raises
    ------
    ProblemTooLarge
        If there are more legs than :data:`MOST_LEGS`.
    """
    wind = wind_of(problem)
    if problem.matrices is not None:
        classes = _of_matrices(problem)
    elif problem.no_fly_zones or wind is not None:
        classes = _of_places(problem, wind)
    else:
        return _plain(problem)
    stops = len(stops_of(problem))
    if len(classes) * stops**2 > MOST_LEGS:
        raise ProblemTooLarge(
            said(
                "{classes} classes of UAVs (of other speeds in wind, of other profiles) times {stops}² legs "
                "between targets and bases are {legs}; the limit is {limit}",
                classes=len(classes),
                stops=stops,
                legs=len(classes) * stops**2,
                limit=MOST_LEGS,
            ),
            details={"legs": len(classes) * stops**2, "limit": MOST_LEGS},
        )
    return _measured(problem, classes, wind is not None)


def _plain(problem: Problem) -> LegArrays:
    uavs, stops = problem.uavs, stops_of(problem)
    start = np.array([(u.x_s, u.y_s) for u in uavs], dtype=np.float64)
    current = np.array([(u.x_c, u.y_c) for u in uavs], dtype=np.float64)
    stop = np.array([(each.x, each.y) for each in stops], dtype=np.float64)
    start_target = between_points(problem.crs, current, stop)
    # Most swarms are where they start, and have the same way to a target as home from it.
    home = start_target.copy() if np.array_equal(start, current) else between_points(problem.crs, start, stop)
    start_home = [distance(problem.crs, u.x_c, u.y_c, u.x_s, u.y_s) for u in uavs]
    between = between_points(problem.crs, stop, stop)[None]
    legs = _room(len(uavs), len(stops), 1, False)
    return legs._replace(
        start_target=start_target, between=between, home=home, start_home=np.array(start_home, np.float64)
    )


def _of_matrices(problem: Problem) -> list[_LegClass]:
    matrices = problem.matrices or {}
    only = next(iter(matrices))
    timed = any(matrix.duration is not None for matrix in matrices.values())
    here = [u.location for u in problem.uavs]
    home = [u.location if u.home_location is None else u.home_location for u in problem.uavs]
    rows = np.array([*here, *home, *(stop.location for stop in stops_of(problem))], np.int64)
    members: dict[tuple[str, float | None], list[int]] = {}
    for i, uav in enumerate(problem.uavs):
        profile = only if uav.profile is None else uav.profile
        by_speed = timed and matrices[profile].duration is None
        members.setdefault((profile, uav.speed if by_speed else 1.0 if timed else None), []).append(i)
    return [
        _LegClass(
            MatrixLegs(rows, matrices[profile].distance, matrices[profile].duration), speed, np.array(of)
        )
        for (profile, speed), of in members.items()
    ]


def _of_places(problem: Problem, wind: Wind | None) -> list[_LegClass]:
    uavs = problem.uavs
    legs = legs_between(problem.crs, places_of(problem), zones_of(problem), wind)
    if wind is None:
        return [_LegClass(legs, None, np.arange(len(uavs)))]
    members: dict[float, list[int]] = {}
    for i, uav in enumerate(uavs):
        members.setdefault(uav.speed, []).append(i)
    return [_LegClass(legs, speed, np.array(of)) for speed, of in members.items()]


def _measured(problem: Problem, classes: list[_LegClass], in_wind: bool) -> LegArrays:
    m, stops = problem.n_uavs, len(stops_of(problem))
    timed = classes[0].speed is not None
    # Round zones the way is the shortest, which in wind need not be the quickest.
    metric = problem.matrices is None and not (problem.no_fly_zones and in_wind)
    found = _room(m, stops, len(classes), timed)._replace(in_wind=in_wind, metric=metric)
    stop = 2 * m + np.arange(stops)
    blocks: dict[int, LegBlock] = {}
    for c, (legs, speed, here) in enumerate(classes):
        found.leg_class[here] = c
        if id(legs) not in blocks:
            blocks[id(legs)] = legs.between(stop[:, None], stop)
        between, between_time = _existing(blocks[id(legs)], speed)
        out, out_time = _existing(legs.between(here[:, None], stop), speed)
        back, back_time = _existing(legs.between(stop[:, None], m + here), speed)
        direct, direct_time = _existing(legs.between(here, m + here), speed)
        found.between[c], found.start_target[here] = _or(between, UNREACHABLE), _or(out, UNREACHABLE)
        found.homeless[here], found.homeless_start[here] = np.isinf(back.T), np.isinf(direct)
        found.home[here], found.start_home[here] = _or(back.T, 0.0), _or(direct, 0.0)
        if timed:
            found.between_time[c] = _or(between_time, UNREACHABLE)
            found.start_time[here] = _or(out_time, UNREACHABLE)
            found.home_time[here], found.start_home_time[here] = _or(back_time.T, 0.0), _or(direct_time, 0.0)
    return found


def _existing(block: LegBlock, speed: float | None) -> tuple[Floats, Floats]:
    """Return lengths and times of a block of legs, both infinite where a leg does not exist.

    Where times follow from the UAVs' own speeds, the lengths take their place.
    """
    if speed is None:
        return block.ground, block.ground
    time = block.flown(speed).time
    missing = np.isinf(block.ground) | np.isinf(time)
    return np.where(missing, np.inf, block.ground), np.where(missing, np.inf, time)


def _or(values: Floats, instead: float) -> Floats:
    """Return legs with something else in place of those that do not exist."""
    return np.where(np.isinf(values), instead, values)


def _room(m: int, stops: int, classes: int, timed: bool) -> LegArrays:
    """Make room for legs; all are of one class, and there is a way home from everywhere."""
    timed_stops = stops if timed else 0
    return LegArrays(
        start_target=np.empty((m, stops)),
        between=np.empty((classes, stops, stops)),
        home=np.empty((m, stops)),
        start_home=np.empty(m),
        homeless=np.zeros((m, stops), np.bool_),
        homeless_start=np.zeros(m, np.bool_),
        leg_class=np.zeros(m, np.int64),
        timed=timed,
        in_wind=False,
        metric=True,
        start_time=np.empty((m, timed_stops)),
        between_time=np.empty((classes, timed_stops, timed_stops)),
        home_time=np.empty((m, timed_stops)),
        start_home_time=np.zeros(m),
    )
