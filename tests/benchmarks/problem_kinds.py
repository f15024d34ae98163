"""Kinds of problems that no policy was trained on and no search tuned on, a function each.

Those of :data:`KINDS` are for policies too; :data:`HARD_KINDS` are where searches have been weak.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from app.domain.problem import UAV, Objective, Problem, Target
from app.simulation.drawn_generator import drawn, drawn_size
from app.simulation.drawn_surroundings import with_surroundings
from app.simulation.generator import FAMILIES, generate

Random = np.random.Generator
Kind = Callable[[int, Random], Problem]

SIZES = ((5, 10), (7, 15), (10, 20), (20, 30))


def of_a_family(number: int, rng: Random) -> Problem:
    """Families take turns, then sizes; K is 3 in half of them, otherwise 1 to 6."""
    m, n = SIZES[number // len(FAMILIES) % len(SIZES)]
    k = 3 if rng.random() < 0.5 else int(rng.integers(1, 7))
    return generate(list(FAMILIES)[number % len(FAMILIES)], m, n, k, rng)


def of_no_family(_number: int, rng: Random) -> Problem:
    return drawn(*drawn_size(rng), rng)


def until(is_wanted: Callable[[Problem], bool], make: Callable[[Random], Problem], rng: Random) -> Problem:
    """Draw until a problem is of the kind."""
    while not is_wanted(problem := make(rng)):
        pass
    return problem


def with_bases(number: int, rng: Random) -> Problem:
    return until(lambda p: bool(p.bases), partial(of_no_family, number), rng)


def surrounded(number: int, rng: Random) -> Problem:
    return with_surroundings(of_no_family(number, rng), rng)


def all_deadlines(_number: int, rng: Random) -> Problem:
    """15 x 40 of any place, with a deadline at every area."""
    return until(lambda p: all(t.deadline is not None for t in p.targets), lambda r: drawn(15, 40, 3, r), rng)


def six_materials(_number: int, rng: Random) -> Problem:
    """Six materials, of which a UAV carries one or two."""
    return until(
        lambda p: all(0 < sum(a > 0 for a in u.loadlist) <= 2 for u in p.uavs),
        lambda r: drawn(*drawn_size(r)[:2], 6, r),
        rng,
    )


def all_alike(number: int, rng: Random) -> Problem:
    """UAVs that differ in nothing."""
    return _alike(of_a_family(number, rng))


def _alike(problem: Problem) -> Problem:
    first = problem.uavs[0]
    return replace(problem, uavs=tuple(replace(first, id=uav.id) for uav in problem.uavs))


def many_visits(_number: int, rng: Random) -> Problem:
    """Twenty visits a UAV, about: few UAVs with range and load for all of it."""
    m = int(rng.integers(1, 5))
    return _far_and_full(generate("clustered", m, 20 * m, 2, rng), 4.0, 25)


def _far_and_full(problem: Problem, farther: float, max_steps: int) -> Problem:
    uavs = tuple(
        replace(uav, voyage=farther * uav.voyage, loadlist=tuple(20.0 * amount for amount in uav.loadlist))
        for uav in problem.uavs
    )
    return replace(problem, uavs=uavs, max_steps=max_steps)


KINDS: dict[str, Kind] = {
    "families": of_a_family,
    "no-family": of_no_family,
    "bases": with_bases,
    "surrounded": surrounded,
    "deadlines": all_deadlines,
    "six-materials": six_materials,
    "alike": all_alike,
    "many-visits": many_visits,
}
"""Of many sizes, for policies."""


def _one_village(number: int, rng: Random) -> Problem:
    """15 x 30 within some 50 m, 10 km from the base."""
    return _villages(rng, ((10.0, 0.0),), float(rng.choice([0.01, 0.1, 1.0])))


def _two_villages(number: int, rng: Random) -> Problem:
    """15 x 30 in two places far apart, and far from the base."""
    return _villages(rng, ((10.0, 0.0), (-6.0, 8.0)), float(rng.choice([0.01, 0.1, 1.0])))


def _villages(rng: Random, centres: tuple[tuple[float, float], ...], weight: float) -> Problem:
    at = [np.array(centres[j % len(centres)]) + rng.normal(0, 0.025, 2) for j in range(30)]
    targets = tuple(
        Target(
            f"area-{j + 1}",
            float(x),
            float(y),
            float(rng.integers(1, 10)),
            tuple(map(float, rng.integers(0, 7, 3))),
        )
        for j, (x, y) in enumerate(at)
    )
    uavs = tuple(
        UAV(f"uav-{i + 1}", 0.0, 0.0, 0.0, 0.0, 1.0, float(rng.uniform(18.0, 32.0)), _amounts(rng, 2, 11))
        for i in range(15)
    )
    return Problem(uavs, targets, objective=Objective(distance_weight=weight), max_steps=5)


def _amounts(rng: Random, low: int, high: int) -> tuple[float, ...]:
    return tuple(map(float, rng.integers(low, high, 3)))


def _far_levels(number: int, rng: Random) -> Problem:
    """8 x 16 or 15 x 30 with levels of 0.1, 1, 10 and 100."""
    problem = generate("uniform", *((8, 16), (15, 30))[number % 2], 3, rng)
    levels = rng.choice([0.1, 1.0, 10.0, 100.0], problem.n_targets)
    targets = tuple(replace(t, level=float(v)) for t, v in zip(problem.targets, levels, strict=True))
    return replace(problem, targets=targets)


def _one_large_level(number: int, rng: Random) -> Problem:
    """One area counts a hundred times as much as all others."""
    problem = of_a_family(number, rng)
    place = int(rng.integers(problem.n_targets))
    targets = list(problem.targets)
    targets[place] = replace(targets[place], level=100.0 * max(t.level for t in targets))
    return replace(problem, targets=tuple(targets))


def _tight_deadlines(number: int, rng: Random) -> Problem:
    """15 x 40 from one base, all with a deadline, many tight."""
    problem = generate("single_base", 15, 40, 3, rng)
    speed = float(np.median([uav.speed for uav in problem.uavs]))
    base = problem.uavs[0]
    targets = tuple(
        replace(t, deadline=float(np.hypot(t.x - base.x_s, t.y - base.y_s) / speed * rng.uniform(1.0, 3.0)))
        for t in problem.targets
    )
    return replace(problem, targets=targets)


def _small_loads(number: int, rng: Random) -> Problem:
    """20 x 12 where a UAV carries some hundredths of what areas need."""
    problem = generate("uniform", 20, 12, 3, rng)
    targets = tuple(replace(t, loadlist=tuple(20.0 * need for need in t.loadlist)) for t in problem.targets)
    return replace(problem, targets=targets)


def _one_way(number: int, rng: Random) -> Problem:
    """8 x 20 with deadlines, where nobody has to return."""
    problem = generate("deadline", 8, 20, 3, rng)
    return replace(problem, objective=replace(problem.objective, return_to_base=False))


def _identical(number: int, rng: Random) -> Problem:
    """15 UAVs that differ in nothing at one base, 30 areas."""
    return _alike(generate("single_base", 15, 30, 3, rng))


def _six_materials_25(number: int, rng: Random) -> Problem:
    """25 x 40, six materials, of which a UAV carries one or two."""
    problem = generate("uniform", 25, 40, 6, rng)
    uavs = []
    for uav in problem.uavs:
        carried = rng.choice(6, int(rng.integers(1, 3)), replace=False)
        uavs.append(
            replace(
                uav, loadlist=tuple(float(a) if k in carried else 0.0 for k, a in enumerate(uav.loadlist))
            )
        )
    return replace(problem, uavs=tuple(uavs))


def _long_routes(number: int, rng: Random) -> Problem:
    """6 x 80, twenty to thirty visits a UAV."""
    return _far_and_full(generate("clustered", 6, 80, 2, rng), 5.0, 30)


HARD_KINDS: dict[str, Kind] = {
    "one village": _one_village,
    "two villages": _two_villages,
    "levels far apart": _far_levels,
    "one large level": _one_large_level,
    "tight deadlines": _tight_deadlines,
    "six materials 25x40": _six_materials_25,
    "small loads": _small_loads,
    "one way": _one_way,
    "identical": _identical,
    "long routes": _long_routes,
}
"""Where searches have been weak."""
