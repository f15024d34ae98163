"""What the universal policy is trained on: every family, many sizes, variations of what dispatchers set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.domain.problem import Objective, Problem
from app.simulation.generator import FAMILIES, generate

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
"""M, N and how often."""

VARIED_SHARE = 0.35
"""Probability of each variation."""


@dataclass(frozen=True, slots=True)
class Shard:
    """Problems of one M and N that are searched and stored together.

    Attributes
    ----------
    n_uavs, n_targets
        M and N.
    problems
        The problems; K may differ among them.
    moves
        Moves of the search for each demonstration.
    """

    n_uavs: int
    n_targets: int
    problems: Sequence[Problem]
    moves: int


def draw_shard(rng: np.random.Generator, families: Sequence[str] = tuple(FAMILIES)) -> Shard:
    """Draw a shard: a shape, then problems of random families, varied.

    Parameters
    ----------
    rng
        The only source of randomness.
    families
        What to draw from.
    """
    shares = np.array([share for _, _, share in SHAPES])
    m, n, _ = SHAPES[rng.choice(len(SHAPES), p=shares / shares.sum())]
    count = int(np.clip(64 * 300 / (m * n), 12, 64))
    problems: list[Problem] = []
    while len(problems) < count:
        k = 3 if rng.random() < 0.6 else int(rng.integers(1, 7))
        problem = generate(str(rng.choice(families)), m, n, k, rng)
        problems.append(vary(problem, rng))
    return Shard(m, n, problems, moves=int(np.clip(1000 * m * n, 100_000, 3_000_000)))


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
