"""What `bench_ablation.py` learns from and tries: problems of one size, with searched plans."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from app.learning.universal.training.curriculum import with_greedy_unloading
from app.learning.universal.training.demonstrations import (
    demonstrate,
    read_demonstrations,
    write_demonstrations,
)
from app.simulation.drawn_generator import drawn
from app.simulation.evaluation import reward_of
from app.simulation.generator import FAMILIES, generate
from app.solvers.greedy import greedy_plan

M, N, K = 7, 15, 3
LEARNED, TRIED, CORRECTED = 1024, 64, 512
MOVES, SHORT, LONG = 60_000, 6_000, 400_000
"""Of the searches for demonstrations, and for what is compared with."""
KINDS = {"families": tuple(FAMILIES), "uniform": ("uniform",), "none": ()}
"""Families of the problems; where there are none, every property is drawn."""
TRIED_KINDS = ("families", "none")


def problems_of(kind, count):
    """Problems of which the greedy rule earns something; another number of them is others."""
    rng, found = np.random.default_rng([60_000_011, count, list(KINDS).index(kind)]), []
    families = KINDS[kind]
    while len(found) < count:
        if families:
            problem = generate(families[len(found) % len(families)], M, N, K, rng)
        else:
            problem = with_greedy_unloading(drawn(M, N, K, rng))
        if reward_of(problem, greedy_plan(problem)) > 0.05 * max(t.level for t in problem.targets):
            found.append(problem)
    return found


def searched(folder, kind, count, moves):
    """Write a plan for each problem, unless the file is there; return where."""
    path = folder / f"{kind}-{count}-{moves}.jsonl"
    if not path.exists():
        rng = np.random.default_rng(count)
        write_demonstrations(path, [demonstrate(each, moves, rng) for each in problems_of(kind, count)])
    return path


@lru_cache
def read(path):
    return read_demonstrations(path)


def of_greedy_rule(tried):
    """(problems,) reward of the greedy rule, over that of the searched plan."""
    return np.array([reward_of(each.problem, greedy_plan(each.problem)) / each.reward for each in tried])
