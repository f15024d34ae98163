"""What surrounds generated problems, each part drawn by itself: wind, zones, roads, promises, batteries."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from app.domain.matrices import Matrix
from app.domain.problem import UAV, Problem, Target
from app.domain.surroundings import NoFlyZone, Wind
from app.simulation.arrays import Floats

MOST_PLACES = 60
"""Places of a problem up to which it may get matrices, which have a number for each pair of places."""

SHARE = 0.12
"""Probability of each part, beside that of any at all."""


def with_surroundings(problem: Problem, rng: np.random.Generator) -> Problem:
    """Add parts that are drawn, one at least.

    Parameters
    ----------
    problem
        Legs are of matrices only where it is on a plane, small, and has no bases, zones or wind.
    rng
        Decides which parts, and what they are.
    """
    parts = (_windy, _zoned, _skilled, _promised, _partly_served, _fair, _hurried, _under_way, _on_roads)
    chosen = rng.random(len(parts)) < SHARE
    chosen[int(rng.integers(len(parts)))] = True
    for part, is_chosen in zip(parts, chosen, strict=True):
        if is_chosen:
            problem = part(problem, rng)
    return problem


def _windy(problem: Problem, rng: np.random.Generator) -> Problem:
    slowest = min(uav.speed for uav in problem.uavs)
    return replace(
        problem, wind=Wind(slowest * float(rng.uniform(0.05, 0.6)), float(rng.uniform(0.0, 360.0)))
    )


def _zoned(problem: Problem, rng: np.random.Generator) -> Problem:
    """Add one to three zones where areas are, of three to five corners."""
    places = np.array([(target.x, target.y) for target in problem.targets])
    low, high = places.min(axis=0), places.max(axis=0)
    across = max(float(np.hypot(*(high - low))), 1e-3)
    zones = []
    for number in range(int(rng.integers(1, 4))):
        centre, corners = rng.uniform(low, high), int(rng.integers(3, 6))
        radius = across * float(rng.uniform(0.03, 0.2))
        angles = (np.arange(corners) + rng.uniform(0.0, 0.8, corners)) / corners * 2.0 * math.pi
        around = centre + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        zones.append(NoFlyZone(f"zone-{number + 1}", tuple((float(x), float(y)) for x, y in around)))
    return replace(problem, no_fly_zones=tuple(zones))


def _skilled(problem: Problem, rng: np.random.Generator) -> Problem:
    """Let some areas need a skill that some UAVs have, and exclude UAVs from areas."""
    ids = [target.id for target in problem.targets]
    has, needs, excluded = rng.uniform(0.2, 0.9), rng.uniform(0.05, 0.5), rng.uniform(0.0, 0.3)
    uavs = tuple(
        replace(
            uav,
            skills=("winch",) if rng.random() < has else (),
            excluded=tuple(each for each in ids if rng.random() < excluded),
        )
        for uav in problem.uavs
    )
    targets = tuple(
        replace(target, skills=("winch",) if rng.random() < needs else ()) for target in problem.targets
    )
    return replace(problem, uavs=uavs, targets=targets)


def _promised(problem: Problem, rng: np.random.Generator) -> Problem:
    """Commit some UAVs to one area or two that they may be sent to; no area is promised twice."""
    free = list(rng.permutation(problem.n_targets))
    share = rng.uniform(0.1, 0.7)

    def promises(uav: UAV) -> tuple[str, ...]:
        if rng.random() >= share:
            return ()
        possible = [j for j in free if problem.targets[j].id not in uav.excluded][: int(rng.integers(1, 3))]
        for j in possible:
            free.remove(j)
        return tuple(problem.targets[j].id for j in possible)

    return replace(problem, uavs=tuple(replace(uav, committed=promises(uav)) for uav in problem.uavs))


def _partly_served(problem: Problem, rng: np.random.Generator) -> Problem:
    """Let some areas have got a part of what they asked for."""
    share = rng.uniform(0.2, 1.0)

    def served(target: Target) -> Target:
        if rng.random() >= share:
            return target
        times = float(rng.uniform(1.0, 5.0))
        return replace(target, requested=tuple(times * amount for amount in target.loadlist))

    return replace(problem, targets=tuple(map(served, problem.targets)))


def _fair(problem: Problem, rng: np.random.Generator) -> Problem:
    """Let the first share that an area gets earn more."""
    share, weight = float(rng.uniform(0.1, 0.7)), float(rng.uniform(1.5, 5.0))
    return replace(problem, objective=replace(problem.objective, minimum_share=share, minimum_weight=weight))


def _hurried(problem: Problem, rng: np.random.Generator) -> Problem:
    """Let the time until all have landed cost what a few areas are worth, at most."""
    hours = float(np.median([uav.voyage / uav.speed for uav in problem.uavs]))
    worth = float(np.median([target.level for target in problem.targets]))
    weight = worth / max(hours, 1e-6) * float(np.exp(rng.uniform(np.log(0.05), np.log(3.0))))
    return replace(problem, objective=replace(problem.objective, makespan_weight=weight))


def _under_way(problem: Problem, rng: np.random.Generator) -> Problem:
    """Let some UAVs have flown already: they are near an area, with less range and less load."""
    share = rng.uniform(0.2, 1.0)
    if problem.crs != "local":
        return problem

    def flown(uav: UAV) -> UAV:
        if rng.random() >= share:
            return uav
        target, way = problem.targets[int(rng.integers(problem.n_targets))], float(rng.uniform(0.2, 1.0))
        x, y = uav.x_s + way * (target.x - uav.x_s), uav.y_s + way * (target.y - uav.y_s)
        length = math.hypot(x - uav.x_s, y - uav.y_s)
        if 2.0 * length > uav.voyage:
            return uav
        left = float(rng.uniform(0.0, 1.0))
        return replace(
            uav,
            x_c=x,
            y_c=y,
            dis=length,
            airborne=length / uav.speed if uav.endurance is not None else 0.0,
            loadlist=tuple(round(left * amount, 2) for amount in uav.loadlist),
            full_load=uav.full,
        )

    return replace(problem, uavs=tuple(map(flown, problem.uavs)))


def _on_roads(problem: Problem, rng: np.random.Generator) -> Problem:
    """Take the legs from matrices of a profile or two: longer than straight ways, some more than others."""
    places = [(uav.x_c, uav.y_c) for uav in problem.uavs] + [(uav.x_s, uav.y_s) for uav in problem.uavs]
    places += [(target.x, target.y) for target in problem.targets]
    surrounded = problem.bases or problem.no_fly_zones or problem.wind
    if len(places) > MOST_PLACES or surrounded or problem.crs != "local":
        return problem
    xy, m = np.array(places), problem.n_uavs
    straight = np.asarray(np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1)))

    def table() -> Floats:
        detour = rng.uniform(1.0, rng.uniform(1.1, 2.0), straight.shape)
        bent = straight * (detour if rng.random() < 0.3 else np.sqrt(detour * detour.T))
        return np.asarray(bent.round(6))

    names = ("rotor", "wing")[: int(rng.integers(1, 3))]
    uavs = tuple(
        replace(uav, location=i, home_location=m + i, profile=str(rng.choice(names)))
        for i, uav in enumerate(problem.uavs)
    )
    targets = tuple(replace(target, location=2 * m + j) for j, target in enumerate(problem.targets))
    matrices = {name: Matrix(table(), None) for name in names}
    return replace(problem, uavs=uavs, targets=targets, matrices=matrices)
