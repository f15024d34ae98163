"""What the policy for every size is trained on: problems of no family, and of every family, varied.

Some have a wind, zones, promises and whatever else is around a swarm, and some a plan to keep to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.domain.problem import Objective, Problem
from app.simulation.drawn_generator import drawn, drawn_size
from app.simulation.drawn_surroundings import with_surroundings
from app.simulation.generator import FAMILIES, generate
from app.solvers.greedy import greedy_plan

DRAWN_SHARE = 0.75
"""Share of the problems that are of no family."""

SURROUNDED_SHARE = 0.3
"""Share of all that get surroundings."""

KEPT_SHARE = 0.1
"""Share of all that get a plan from which changes cost reward."""

KNOWN_BEFORE = 0.8
"""Share of the areas for which that plan was made."""

SHAPES: tuple[tuple[int, int, float], ...] = (
    (3, 3, 0.02),
    (3, 6, 0.04),
    (5, 10, 0.12),
    (10, 10, 0.10),
    (10, 5, 0.08),
    (5, 20, 0.08),
    (7, 15, 0.08),
    (12, 12, 0.08),
    (10, 20, 0.14),
    (20, 10, 0.07),
    (15, 20, 0.07),
    (20, 20, 0.06),
    (20, 30, 0.04),
    (30, 60, 0.02),
    (50, 100, 0.01),
    (100, 300, 0.01),
)
"""M, N and how often, of the problems of families."""

VARIED_SHARE = 0.35
"""Probability of each variation of a problem of a family."""


def draw_problem(rng: np.random.Generator) -> Problem:
    """Draw a problem, of no family or of any."""
    problem = drawn(*drawn_size(rng), rng) if rng.random() < DRAWN_SHARE else _of_a_family(rng)
    problem = with_greedy_unloading(problem)
    if rng.random() < SURROUNDED_SHARE:
        problem = with_surroundings(problem, rng)
    return _with_plan(problem, rng) if rng.random() < KEPT_SHARE else problem


def _with_plan(problem: Problem, rng: np.random.Generator) -> Problem:
    """Let changes cost reward, of a plan that was made before some of the areas needed anything."""
    targets = tuple(
        target if rng.random() < KNOWN_BEFORE else replace(target, loadlist=(0.0,) * len(target.loadlist))
        for target in problem.targets
    )
    plan = greedy_plan(replace(problem, targets=targets))
    worth = float(np.median([target.level for target in problem.targets]))
    price = worth * float(np.exp(rng.uniform(np.log(0.01), np.log(1.0))))
    return replace(
        problem,
        start_plan=plan.assignment or None,
        objective=replace(problem.objective, change_weight=price),
    )


def with_greedy_unloading(problem: Problem) -> Problem:
    """Return a problem of which nothing is planned but where UAVs fly: that is what the policy decides."""
    return replace(problem, objective=replace(problem.objective, unloading="greedy"))


def _of_a_family(rng: np.random.Generator) -> Problem:
    shares = np.array([share for _, _, share in SHAPES])
    m, n, _ = SHAPES[rng.choice(len(SHAPES), p=shares / shares.sum())]
    k = 3 if rng.random() < 0.6 else int(rng.integers(1, 7))
    return vary(generate(str(rng.choice(list(FAMILIES))), m, n, k, rng), rng)


def vary(problem: Problem, rng: np.random.Generator) -> Problem:
    """Change what a dispatcher may set or a swarm may have: weight, objective, steps, ranges, loads."""
    objective, weight = problem.objective, problem.distance_weight
    if rng.random() < VARIED_SHARE:
        weight *= float(np.exp(rng.uniform(-1.2, 0.7)))
    return_to_base = objective.return_to_base and rng.random() < 0.9
    charge_return = objective.charge_return or rng.random() < 0.1
    steps, uavs = problem.max_steps, problem.uavs
    if rng.random() < VARIED_SHARE:
        steps = int(rng.integers(2, 8))
    if rng.random() < VARIED_SHARE:
        longer = float(np.exp(rng.uniform(-0.5, 0.5)))
        uavs = tuple(replace(u, voyage=u.voyage * longer) for u in uavs)
    if rng.random() < VARIED_SHARE:
        fuller = float(rng.uniform(0.4, 2.5))
        uavs = tuple(replace(u, loadlist=tuple(float(round(a * fuller)) for a in u.loadlist)) for u in uavs)
    return replace(
        problem, uavs=uavs, max_steps=steps, objective=Objective(weight, return_to_base, charge_return)
    )
