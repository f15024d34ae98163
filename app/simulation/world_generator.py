"""Generated problems of the second edition, a family for each thing that a relief day has besides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from app.domain.matrices import Matrix
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.surroundings import Base, Material, NoFlyZone, Wind
from app.simulation.generator import Family, single_base, uniform

_LIGHT = Objective(distance_weight=0.3)

_SKILLS = ("cold chain", "winch", "night flight")


def windows(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform` with whole needs; areas open and close, batteries count, UAVs come later."""
    problem = _whole_needs(uniform(n_uavs, n_targets, n_materials, rng), rng)
    opens = rng.uniform(0, 2.0, n_targets) * (rng.random(n_targets) < 0.7)
    stays = rng.uniform(0.5, 1.5, n_targets)
    targets = tuple(
        replace(t, earliest=float(o), deadline=float(o + s), service_time=float(rng.uniform(0.02, 0.1)))
        for t, o, s in zip(problem.targets, opens, stays, strict=True)
    )
    uavs = tuple(
        replace(u, endurance=float(rng.uniform(2, 4)), reserve=0.1, available_from=float(rng.uniform(0, 0.5)))
        for u in problem.uavs
    )
    return replace(problem, uavs=uavs, targets=targets)


def zones(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform` with whole needs, and a few no-fly zones between areas."""
    problem = _whole_needs(uniform(n_uavs, n_targets, n_materials, rng), rng)
    return replace(problem, no_fly_zones=tuple(_zone(problem, number, rng) for number in range(4)))


def windy(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform`, in a wind of up to half of the slowest UAV's speed, with batteries."""
    problem = uniform(n_uavs, n_targets, n_materials, rng)
    slowest = min(uav.speed for uav in problem.uavs)
    uavs = tuple(replace(u, endurance=float(rng.uniform(1.5, 3)), reserve=0.15) for u in problem.uavs)
    wind = Wind(slowest * float(rng.uniform(0.2, 0.5)), float(rng.uniform(0, 360)))
    return replace(problem, uavs=uavs, wind=wind)


def promised(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform`, with skills, exclusions, and visits that are promised."""
    problem = uniform(n_uavs, n_targets, n_materials, rng)
    targets = tuple(
        replace(t, skills=(str(rng.choice(_SKILLS)),) if rng.random() < 0.4 else ()) for t in problem.targets
    )
    return replace(problem, uavs=tuple(_promise(u, targets, rng) for u in problem.uavs), targets=targets)


def _promise(uav: UAV, targets: tuple[Target, ...], rng: np.random.Generator) -> UAV:
    skills = tuple(rng.choice(_SKILLS, int(rng.integers(1, 4)), replace=False).tolist())
    may = [t for t in targets if set(t.skills) <= set(skills) and any(t.loadlist)]
    excluded = (may.pop(int(rng.integers(len(may)))).id,) if may and rng.random() < 0.3 else ()
    may.sort(key=lambda t: (t.x - uav.x_c) ** 2 + (t.y - uav.y_c) ** 2)
    committed = (may[0].id,) if may and rng.random() < 0.3 else ()
    return replace(uav, skills=skills, excluded=excluded, committed=committed)


def fair(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform`, where a first share for everybody, soon, and an early landing are worth more."""
    problem = uniform(n_uavs, n_targets, n_materials, rng)
    objective = replace(
        problem.objective,
        minimum_share=float(rng.uniform(0.2, 0.5)),
        minimum_weight=2.0,
        half_life=float(rng.uniform(1, 4)),
        makespan_weight=float(rng.uniform(0, 0.2)),
    )
    return replace(problem, objective=objective)


def partly(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `fair` without haste, where most areas have got a part of what they asked for."""
    problem = fair(n_uavs, n_targets, n_materials, rng)
    targets = tuple(
        replace(t, requested=tuple(need + float(rng.integers(0, 6)) for need in t.loadlist))
        for t in problem.targets
    )
    objective = replace(problem.objective, half_life=None, makespan_weight=0.0)
    return replace(problem, targets=targets, objective=objective)


def matrix(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform`, with legs of two kinds of UAV as matrices: not symmetric, some missing."""
    problem = uniform(n_uavs, n_targets, n_materials, rng)
    places = np.array([(u.x_s, u.y_s) for u in problem.uavs] + [(t.x, t.y) for t in problem.targets])
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    matrices = {}
    for profile in ("multirotor", "fixed-wing"):
        distance = apart * rng.uniform(1.0, 1.4, apart.shape)
        distance[rng.random(apart.shape) < 0.03] = np.inf
        np.fill_diagonal(distance, 0.0)
        matrices[profile] = Matrix(distance, distance / rng.uniform(0.8, 1.6, apart.shape))
    uavs = tuple(
        replace(u, location=i, profile=str(rng.choice(list(matrices)))) for i, u in enumerate(problem.uavs)
    )
    targets = tuple(replace(t, location=n_uavs + j) for j, t in enumerate(problem.targets))
    return replace(problem, uavs=uavs, targets=targets, matrices=matrices)


def sorties(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `single_base`, where UAVs come back, reload, and fly again: small loads, short ranges, one day."""
    problem = single_base(n_uavs, n_targets, n_materials, rng)
    x, y = problem.uavs[0].x_s, problem.uavs[0].y_s
    uavs = tuple(
        replace(
            u,
            voyage=float(rng.uniform(1.0, 2.0)),
            loadlist=tuple(map(float, rng.integers(1, 6, n_materials))),
            available_until=float(rng.uniform(4, 8)),
        )
        for u in problem.uavs
    )
    base = Base("base-1", x, y, turnaround=0.1)
    return replace(problem, uavs=uavs, bases=(base,), max_steps=15, objective=_LIGHT)


def stock(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `sorties` from several bases, whose stocks run out; some UAVs begin empty, some keep to a base."""
    problem = sorties(n_uavs, n_targets, n_materials, rng)
    needed = np.array([t.loadlist for t in problem.targets]).sum(axis=0)
    bases = tuple(
        Base(
            f"base-{number + 1}",
            float(rng.random()),
            float(rng.random()),
            stock=tuple(np.round(needed * rng.uniform(0.1, 0.3, n_materials)).tolist()),
            turnaround=float(rng.uniform(0.05, 0.25)),
        )
        for number in range(3)
    )
    uavs = tuple(
        replace(
            u,
            full_load=tuple(map(float, rng.integers(1, 6, n_materials))),
            loadlist=(0.0,) * n_materials if rng.random() < 0.3 else u.loadlist,
            bases=(str(rng.choice([base.id for base in bases])),) if rng.random() < 0.3 else None,
        )
        for u in problem.uavs
    )
    return replace(problem, uavs=uavs, bases=bases)


def loading(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `sorties`, where UAVs begin empty and what each flight carries, by weight, is planned."""
    problem = sorties(n_uavs, n_targets, n_materials, rng)
    weights = rng.choice([0.25, 0.5, 1.0, 2.0], n_materials)
    materials = tuple(Material(f"material-{k + 1}", float(weight)) for k, weight in enumerate(weights))
    empty = (0.0,) * n_materials
    uavs = tuple(
        replace(u, loadlist=empty, full_load=empty, capacity=float(rng.uniform(2, 5))) for u in problem.uavs
    )
    needed = np.array([t.loadlist for t in problem.targets]).sum(axis=0)
    stock = np.round(needed * rng.uniform(0.5, 1.0, n_materials)) if rng.random() < 0.5 else None
    bases = (replace(problem.bases[0], stock=None if stock is None else tuple(stock.tolist())),)
    objective = replace(_LIGHT, unloading="planned", loading="planned")
    return replace(problem, uavs=uavs, bases=bases, materials=materials, objective=objective)


def _whole_needs(problem: Problem, rng: np.random.Generator) -> Problem:
    """Let every UAV carry enough for all that it can visit, so that areas are visited once or not at all."""
    most = sum(sorted((sum(t.loadlist) for t in problem.targets), reverse=True)[: problem.max_steps])
    uavs = tuple(
        replace(u, loadlist=tuple(most + float(rng.integers(1, 5)) for _ in u.loadlist)) for u in problem.uavs
    )
    return replace(problem, uavs=uavs)


def _zone(problem: Problem, number: int, rng: np.random.Generator) -> NoFlyZone:
    """Return a polygon of 4 to 8 corners in a quarter of the square, with no place of the problem inside."""
    places = [(u.x_s, u.y_s) for u in problem.uavs] + [(t.x, t.y) for t in problem.targets]
    centre = np.array([0.25 + 0.5 * (number % 2), 0.25 + 0.5 * (number // 2)]) + rng.uniform(-0.08, 0.08, 2)
    # As large as the nearest place allows, which stays outside.
    radius = min(0.15, 0.9 * min(float(np.hypot(*(np.array(place) - centre))) for place in places))
    count = int(rng.integers(4, 9))
    angles = 2 * np.pi / count * (np.arange(count) + rng.uniform(0, 0.8, count))
    corners = centre + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return NoFlyZone(f"zone-{number + 1}", tuple((float(x), float(y)) for x, y in corners))


WORLD_FAMILIES: Mapping[str, Family] = {
    each.__name__: each
    for each in (windows, zones, windy, promised, fair, partly, matrix, sorties, stock, loading)
}
"""The families by name."""
