"""Random problems that use every option of the specification, for tests."""

from dataclasses import replace

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Objective, Problem
from app.simulation import simulator, visit
from app.simulation.arrays import compile_problem
from app.simulation.generator import FAMILIES, generate


def random_problem(rng: np.random.Generator, max_uavs: int = 6, max_targets: int = 8) -> Problem:
    """A problem of a random family, size, crs and objective, with oddities mixed in."""
    family = str(rng.choice(list(FAMILIES)))
    m, n, k = rng.integers(1, max_uavs + 1), rng.integers(1, max_targets + 1), rng.integers(1, 5)
    problem = generate(family, int(m), int(n), int(k), rng)
    weight = [None, 0.0, 1.0, 0.3][rng.integers(4)]
    objective = Objective(
        weight, return_to_base=bool(rng.random() < 0.7), charge_return=bool(rng.random() < 0.4)
    )
    problem = replace(problem, objective=objective, max_steps=int(rng.integers(1, 7)))
    targets = list(problem.targets)
    if rng.random() < 0.3:
        j = int(rng.integers(len(targets)))
        targets[j] = replace(targets[j], loadlist=(0.0,) * int(k))
    if rng.random() < 0.5:
        scale = float(rng.uniform(0.1, 3))
        targets = [
            replace(
                t,
                loadlist=tuple(amount * scale for amount in t.loadlist),
                service_time=float(rng.uniform(0, 0.3)),
                deadline=float(rng.uniform(-0.1, 3)) if rng.random() < 0.4 else None,
            )
            for t in targets
        ]
    problem = replace(problem, targets=tuple(targets))
    return on_earth(problem, rng) if rng.random() < 0.4 else problem


def on_earth(problem: Problem, rng: np.random.Generator) -> Problem:
    """The same problem in degrees around a random place; ranges and speeds in km and km/h."""
    lon, lat = rng.uniform(-150, 150), rng.uniform(-60, 60)
    size = 0.5 / max(problem.extent, 1.0)
    km = 111.0 * size

    def move(item, *names):
        place = {}
        for x, y in names:
            place[x], place[y] = lon + size * getattr(item, x), lat + size * getattr(item, y)
        return replace(item, **place)

    uavs = tuple(
        replace(
            move(u, ("x_s", "y_s"), ("x_c", "y_c")), speed=u.speed * km, voyage=u.voyage * km, dis=u.dis * km
        )
        for u in problem.uavs
    )
    targets = tuple(move(t, ("x", "y")) for t in problem.targets)
    return replace(problem, uavs=uavs, targets=targets, crs="wgs84")


def strained(problem: Problem, rng: np.random.Generator) -> Problem:
    """The same problem with UAVs on their way or returning, short ranges, and deadlines that bind."""
    uavs = []
    for uav in problem.uavs:
        place = {"x_c": uav.x_c, "y_c": uav.y_c}
        if rng.random() < 0.4:
            near = problem.targets[int(rng.integers(problem.n_targets))]
            place = {"x_c": (uav.x_s + near.x) / 2, "y_c": (uav.y_s + near.y) / 2}
        uavs.append(
            replace(
                uav,
                **place,
                voyage=uav.voyage * float(rng.uniform(0.2, 1.1)),
                dis=uav.voyage * float(rng.choice([0.0, 0.1, 0.3])),
                ret=bool(rng.random() < 0.1),
            )
        )
    # The time in which a usual UAV flies across the scene.
    across = problem.extent / float(np.median([uav.speed for uav in uavs]))
    targets = tuple(
        replace(
            target,
            deadline=across * float(rng.uniform(-0.1, 2.5)) if rng.random() < 0.5 else None,
            service_time=across * float(rng.choice([0.0, 0.2, 1.0])),
            level=target.level * float(10.0 ** rng.integers(-2, 2)),
            requested=tuple(2 * amount for amount in target.loadlist) if rng.random() < 0.2 else None,
        )
        for target in problem.targets
    )
    return replace(problem, uavs=tuple(uavs), targets=targets)


def random_plan(problem: Problem, rng: np.random.Generator) -> Plan:
    """A random plan that is legal under greedy unloading."""
    arrays = compile_problem(problem)
    episodes = simulator.new_episodes(arrays, 1)
    rows = []
    for _ in range(problem.max_steps):
        row = []
        for i in range(problem.n_uavs):
            stops = [j for j in range(problem.n_targets + 1 + problem.n_bases) if j != problem.n_targets]
            allowed = [j for j in stops if simulator.verdict(arrays, episodes, 0, i, j) == visit.ALLOWED]
            stays = not allowed or rng.random() < 0.15
            row.append(problem.n_targets if stays else int(rng.choice(allowed)))
            simulator.act(arrays, episodes, 0, i, row[-1])
        rows.append(tuple(row))
    return Plan(tuple(rows))
