"""Generated problems: named task families, every number drawn from one seeded generator.

A family is a recipe for what dispatchers send. The paper shows its instances only as pictures; ``uniform``
follows its sizes: positions in a unit square, levels up to 1, small whole amounts, λ = 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from app.domain.geometry import distances
from app.domain.problem import UAV, Objective, Problem, Target

Points = npt.NDArray[np.float64]
Family = Callable[[int, int, int, np.random.Generator], Problem]


def generate(family: str, n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """Generate one problem.

    Parameters
    ----------
    family
        A name in :data:`FAMILIES`.
    n_uavs, n_targets, n_materials
        M, N and K.
    rng
        The only source of randomness.

    Raises
    ------
    KeyError
        If there is no such family.
    """
    return FAMILIES[family](n_uavs, n_targets, n_materials, rng)


def uniform(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """UAVs and areas anywhere in a unit square, loads for about two areas each, ranges of 1.5 to 4."""
    starts = rng.random((n_uavs, 2))
    areas = rng.random((n_targets, 2))
    return Problem(
        uavs=_swarm(starts, rng.integers(2, 11, (n_uavs, n_materials)), rng),
        targets=_targets(areas, rng.integers(0, 7, (n_targets, n_materials)), rng),
        objective=Objective(distance_weight=1.0),
    )


def clustered(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """Areas in a few stricken towns, UAVs at a few bases, distances in tens of km, λ by the extent."""
    towns = rng.uniform(0, 20, (max(2, n_targets // 6), 2))
    bases = rng.uniform(0, 20, (max(2, n_uavs // 8), 2))
    areas = towns[rng.integers(len(towns), size=n_targets)] + rng.normal(0, 1.5, (n_targets, 2))
    starts = bases[rng.integers(len(bases), size=n_uavs)]
    problem = Problem(
        uavs=_swarm(starts, rng.integers(0, 11, (n_uavs, n_materials)), rng, scale=20.0),
        targets=_targets(areas, rng.integers(0, 7, (n_targets, n_materials)), rng),
        max_steps=6,
    )
    levels = rng.integers(1, 6, n_targets)
    targets = tuple(replace(t, level=float(level)) for t, level in zip(problem.targets, levels, strict=True))
    return replace(problem, targets=targets)


def scarce(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform`, but the swarm carries about a third of what is needed, and little range."""
    problem = uniform(n_uavs, n_targets, n_materials, rng)
    loads = rng.integers(0, 5, (n_uavs, n_materials))
    uavs = tuple(
        replace(u, loadlist=tuple(map(float, load)), voyage=0.75 * u.voyage)
        for u, load in zip(problem.uavs, loads, strict=True)
    )
    return replace(problem, uavs=uavs)


def single_base(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform`, but the whole swarm starts from one base."""
    problem = uniform(n_uavs, n_targets, n_materials, rng)
    x, y = rng.random(2)
    return replace(problem, uavs=tuple(_moved(u, x, y) for u in problem.uavs))


def deadline(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `single_base`, with service times, and deadlines at about half of the areas."""
    problem = single_base(n_uavs, n_targets, n_materials, rng)
    latest = rng.uniform(0.2, 2.0, n_targets)
    bound = rng.random(n_targets) < 0.5
    targets = tuple(
        replace(t, service_time=0.1, deadline=float(latest[j]) if bound[j] else None)
        for j, t in enumerate(problem.targets)
    )
    return replace(problem, targets=targets)


def mid_mission(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform`, but the mission has begun: UAVs are away from home, partly unloaded, some returning."""
    problem = uniform(n_uavs, n_targets, n_materials, rng)
    starts = np.array([(u.x_s, u.y_s) for u in problem.uavs])
    current = np.clip(starts + rng.normal(0, 0.3, starts.shape), 0, 1)
    flown = np.diagonal(distances("local", starts, current)) * rng.uniform(1.0, 1.5, n_uavs)
    kept = rng.random((n_uavs, n_materials))
    returning = rng.random(n_uavs) < 0.15
    uavs = tuple(
        replace(
            u,
            x_c=float(current[i, 0]),
            y_c=float(current[i, 1]),
            dis=float(flown[i]),
            ret=bool(returning[i]),
            loadlist=tuple(float(round(a * k)) for a, k in zip(u.loadlist, kept[i], strict=True)),
        )
        for i, u in enumerate(problem.uavs)
    )
    return replace(problem, uavs=uavs)


def corridor(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform`, but areas along a narrow valley or road, and bases near one end of it."""
    problem = uniform(n_uavs, n_targets, n_materials, rng)
    angle = rng.uniform(0, np.pi)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    width = rng.uniform(0.02, 0.1)

    def place(low: float, high: float) -> tuple[float, float]:
        x, y = rng.uniform(low, high) * along + rng.normal(0, width) * across
        return float(x), float(y)

    targets = []
    for target in problem.targets:
        x, y = place(0.0, 1.2)
        targets.append(replace(target, x=x, y=y))
    return replace(
        problem, uavs=tuple(_moved(u, *place(-0.1, 0.3)) for u in problem.uavs), targets=tuple(targets)
    )


def mixed_loads(n_uavs: int, n_targets: int, n_materials: int, rng: np.random.Generator) -> Problem:
    """As `uniform`, but a few carriers with large loads among many UAVs with small ones."""
    problem = uniform(n_uavs, n_targets, n_materials, rng)
    large = rng.random(n_uavs) < 0.25
    factor = np.where(large, rng.uniform(2, 5, n_uavs), rng.uniform(0.2, 0.6, n_uavs))
    uavs = tuple(
        replace(
            u,
            loadlist=tuple(float(np.ceil(amount * f)) for amount in u.loadlist),
            speed=0.6 * u.speed if big else u.speed,
        )
        for u, f, big in zip(problem.uavs, factor, large, strict=True)
    )
    return replace(problem, uavs=uavs)


FAMILIES: Mapping[str, Family] = {
    "uniform": uniform,
    "clustered": clustered,
    "scarce": scarce,
    "single_base": single_base,
    "deadline": deadline,
    "mid_mission": mid_mission,
    "corridor": corridor,
    "mixed_loads": mixed_loads,
}
"""The task families by name."""


def _swarm(
    starts: Points, loads: npt.NDArray[np.int64], rng: np.random.Generator, scale: float = 1.0
) -> tuple[UAV, ...]:
    speeds = scale * rng.uniform(0.3, 1.8, len(starts))
    voyages = scale * rng.uniform(1.5, 4.0, len(starts))
    return tuple(
        UAV(
            id=f"uav-{i + 1}",
            x_s=float(x),
            y_s=float(y),
            x_c=float(x),
            y_c=float(y),
            speed=float(speeds[i]),
            voyage=float(voyages[i]),
            loadlist=tuple(map(float, loads[i])),
        )
        for i, (x, y) in enumerate(starts)
    )


def _targets(areas: Points, needs: npt.NDArray[np.int64], rng: np.random.Generator) -> tuple[Target, ...]:
    levels = rng.integers(1, 6, len(areas)) / 5
    return tuple(
        Target(
            id=f"area-{j + 1}",
            x=float(x),
            y=float(y),
            level=float(levels[j]),
            loadlist=tuple(map(float, needs[j])),
        )
        for j, (x, y) in enumerate(areas)
    )


def _moved(uav: UAV, x: float, y: float) -> UAV:
    """Return the UAV, started from another place and still there."""
    return replace(uav, x_s=float(x), y_s=float(y), x_c=float(x), y_c=float(y))
