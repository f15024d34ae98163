"""Random problems that use what there is in the world beyond places, loads and deadlines."""

import math
from dataclasses import replace

import numpy as np
from problems import random_problem

from app.domain.geometry import distance
from app.domain.matrices import Matrix
from app.domain.problem import Problem
from app.domain.surroundings import Base, Material, NoFlyZone, Wind
from app.simulation.drawn_generator import drawn


def random_world(rng: np.random.Generator, max_uavs: int = 4, max_targets: int = 6) -> Problem:
    """A random problem with each of the fields of the world now and then, in sizes that matter."""
    problem = random_problem(rng, max_uavs, max_targets)
    across = problem.extent / float(np.median([uav.speed for uav in problem.uavs]))
    problem = _timed(problem, rng, across)
    problem = _promised(problem, rng)
    if rng.random() < 0.3:
        return _in_matrices(problem, rng, across)
    if rng.random() < 0.5:
        slowest = min(uav.speed for uav in problem.uavs)
        wind = Wind(slowest * float(rng.uniform(0.0, 1.2)), float(rng.uniform(-360, 360)))
        problem = replace(problem, wind=wind)
    if rng.random() < 0.6:
        problem = replace(problem, no_fly_zones=_zones(problem, rng))
    return problem


def random_sorties(rng: np.random.Generator, max_uavs: int = 4, max_targets: int = 6) -> Problem:
    """The same with one or two bases; some UAVs begin empty, some may not use all of them."""
    problem = random_world(rng, max_uavs, max_targets)
    across = problem.extent / float(np.median([uav.speed for uav in problem.uavs]))
    places = [(uav.x_s, uav.y_s, uav.location) for uav in problem.uavs]
    places += [(target.x, target.y, target.location) for target in problem.targets]
    bases = []
    for number in range(int(rng.integers(1, 3))):
        x, y, row = places[int(rng.integers(0, len(places)))]
        if problem.matrices is None and rng.random() < 0.6:
            x, y = (float((here + there) / 2) for here, there in zip((x, y), places[0][:2], strict=True))
        stock = tuple(float(amount) for amount in rng.integers(0, 9, problem.n_materials))
        bases.append(
            Base(
                f"base-{number + 1}",
                x,
                y,
                stock=stock if rng.random() < 0.6 else None,
                turnaround=across * float(rng.uniform(0, 0.3)) if rng.random() < 0.6 else 0.0,
                location=row,
            )
        )
    ids = [base.id for base in bases]
    uavs = tuple(
        replace(
            uav,
            loadlist=(0.0,) * problem.n_materials if rng.random() < 0.3 else uav.loadlist,
            full_load=tuple(map(float, rng.integers(0, 9, problem.n_materials)))
            if rng.random() < 0.5
            else None,
            bases=tuple(ids[: int(rng.integers(0, len(ids) + 1))]) if rng.random() < 0.3 else None,
            voyage=uav.voyage * (0.5 if rng.random() < 0.5 else 1.0),
        )
        for uav in problem.uavs
    )
    return replace(problem, uavs=uavs, bases=tuple(bases))


def some_with_bases(count: int) -> list[Problem]:
    """Drawn problems with bases, of several UAVs, whose unloading is greedy."""
    found, number = [], 0
    while len(found) < count:
        problem = drawn(5, 12, 2, np.random.default_rng([17, number]))
        if problem.bases:
            objective = replace(problem.objective, unloading="greedy")
            found.append(replace(problem, objective=objective))
        number += 1
    return found


def random_loading(rng: np.random.Generator, max_uavs: int = 3, max_targets: int = 5) -> Problem:
    """The same with amounts that are planned: what visits unload and, mostly, what reloads take."""
    problem = random_sorties(rng, max_uavs, max_targets)
    weights = [float(rng.choice([0.25, 0.5, 1.0, 2.0, 0.0])) for _ in range(problem.n_materials)]
    materials = tuple(Material(f"material-{k + 1}", weight) for k, weight in enumerate(weights))
    uavs = []
    for uav in problem.uavs:
        loads = map(max, uav.loadlist, uav.full)
        least = sum(weight * amount for weight, amount in zip(weights, loads, strict=True))
        capacity = max(least, float(rng.uniform(1, 10)))
        uavs.append(replace(uav, capacity=capacity if rng.random() < 0.9 else None))
    objective = replace(
        problem.objective,
        half_life=None,
        unloading="planned",
        loading="planned" if rng.random() < 0.8 else "refill",
    )
    bases = problem.bases
    if rng.random() < 0.4:
        bases = tuple(replace(base, stock=None) for base in bases)
    if rng.random() < 0.5:
        uavs = [replace(uav, loadlist=(0.0,) * problem.n_materials) for uav in uavs]
    return replace(problem, uavs=tuple(uavs), materials=materials, bases=bases, objective=objective)


def _timed(problem: Problem, rng: np.random.Generator, across: float) -> Problem:
    def maybe(value: object, otherwise: object, share: float = 0.35) -> object:
        return value if rng.random() < share else otherwise

    uavs = tuple(
        replace(
            uav,
            endurance=maybe(across * float(rng.uniform(0.5, 4)), None),
            airborne=maybe(across * float(rng.uniform(0, 0.3)), 0.0, 0.2),
            reserve=maybe(float(rng.uniform(0, 0.4)), 0.0),
            available_from=maybe(across * float(rng.uniform(0, 1)), 0.0),
            available_until=maybe(across * float(rng.uniform(0.5, 5)), None),
        )
        for uav in problem.uavs
    )
    targets = tuple(
        replace(
            target,
            earliest=maybe(across * float(rng.uniform(0, 2)), 0.0),
            requested=maybe(tuple(1.5 * amount for amount in target.loadlist), None, 0.2),
        )
        for target in problem.targets
    )
    objective = replace(
        problem.objective,
        half_life=maybe(across * float(rng.uniform(0.3, 3)), None),
        minimum_share=maybe(float(rng.uniform(0, 1)), 0.0, 0.5),
        minimum_weight=maybe(float(rng.uniform(1, 4)), 1.0, 0.5),
        makespan_weight=maybe(float(rng.uniform(0, 1)) / across, 0.0),
    )
    return replace(problem, uavs=uavs, targets=targets, objective=objective)


def _promised(problem: Problem, rng: np.random.Generator) -> Problem:
    """Add skills, exclusions, promises, and a plan to begin from."""
    ids = [target.id for target in problem.targets]
    words = ("medic", "winch")
    uavs = []
    for uav in problem.uavs:
        mixed = list(rng.permutation(ids))
        cut = int(rng.integers(0, 2)) if rng.random() < 0.3 else 0
        promised = int(rng.integers(1, 3)) if rng.random() < 0.3 else 0
        skills = tuple(word for word in words if rng.random() < 0.7)
        committed = tuple(map(str, mixed[cut : cut + promised]))
        uavs.append(replace(uav, skills=skills, excluded=tuple(map(str, mixed[:cut])), committed=committed))
    targets = tuple(
        replace(target, skills=tuple(word for word in words if rng.random() < 0.15))
        for target in problem.targets
    )
    problem = replace(problem, uavs=tuple(uavs), targets=targets)
    if rng.random() < 0.4:
        steps = int(rng.integers(1, problem.max_steps + 1))
        rows = rng.integers(0, problem.n_targets + 1, (steps, problem.n_uavs)).tolist()
        weight = float(rng.choice([0.0, 0.2]))
        problem = replace(
            problem,
            start_plan=tuple(map(tuple, rows)),
            objective=replace(problem.objective, change_weight=weight),
        )
    return problem


def _in_matrices(problem: Problem, rng: np.random.Generator, across: float) -> Problem:
    """The same problem with legs from matrices: lengths bent a little, some missing."""
    places = [(uav.x_c, uav.y_c) for uav in problem.uavs] + [(uav.x_s, uav.y_s) for uav in problem.uavs]
    places += [(target.x, target.y) for target in problem.targets]
    m, r = problem.n_uavs, len(places)
    straight = np.array([[distance(problem.crs, *a, *b) for b in places] for a in places])

    def table(scale: float) -> np.ndarray:
        bent = straight * scale * rng.uniform(0.7, 1.4, (r, r))
        bent[rng.random((r, r)) < 0.05] = math.inf
        np.fill_diagonal(bent, 0.0)
        return bent

    names = ("road", "air")[: int(rng.integers(1, 3))]
    matrices = {
        name: Matrix(table(1.0), table(across / problem.extent) if rng.random() < 0.5 else None)
        for name in names
    }
    uavs = tuple(
        replace(
            uav,
            location=i,
            home_location=None if (uav.x_c, uav.y_c) == (uav.x_s, uav.y_s) else m + i,
            profile=str(rng.choice(names)) if len(names) > 1 or rng.random() < 0.5 else None,
        )
        for i, uav in enumerate(problem.uavs)
    )
    targets = tuple(replace(target, location=2 * m + j) for j, target in enumerate(problem.targets))
    return replace(problem, uavs=uavs, targets=targets, matrices=matrices)


def _zones(problem: Problem, rng: np.random.Generator) -> tuple[NoFlyZone, ...]:
    """One to three zones of three to five corners, which may overlap."""
    xs = [uav.x_s for uav in problem.uavs] + [target.x for target in problem.targets]
    ys = [uav.y_s for uav in problem.uavs] + [target.y for target in problem.targets]
    across = problem.extent if problem.crs == "local" else math.hypot(max(xs) - min(xs), max(ys) - min(ys))
    zones = []
    for number in range(int(rng.integers(1, 4))):
        x, y = rng.uniform(min(xs), max(xs) + 1e-9), rng.uniform(min(ys), max(ys) + 1e-9)
        size, corners = across * rng.uniform(0.05, 0.25), int(rng.integers(3, 6))
        angles = (np.arange(corners) + rng.uniform(0, 0.8, corners)) / corners * 2 * math.pi
        polygon = tuple(
            (float(x + size * math.cos(angle)), float(y + size * math.sin(angle))) for angle in angles
        )
        zones.append(NoFlyZone(f"zone-{number + 1}", polygon))
    return tuple(zones)
