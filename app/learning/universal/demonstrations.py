"""Near-optimal plans of generated problems, by the compiled local search: what the policy learns from."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from app.learning.universal.curriculum import Shard, draw_shard
from app.simulation.arrays import Floats, Integers, ProblemArrays, compile_problem, stack
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.annealing import actions_of, anneal, new_search, set_routes


class Demonstrations(NamedTuple):
    """P problems of one M and N with a plan each.

    Attributes
    ----------
    arrays
        The stack of problems.
    plans
        (P, S, M) joint actions; rows after a plan's end send everybody home.
    rewards
        (P,) their rewards, all above 0.
    """

    arrays: ProblemArrays
    plans: Integers
    rewards: Floats


def demonstrate(shard: Shard, rng: np.random.Generator) -> Demonstrations:
    """Search a plan for each problem of a shard; problems in which nothing can be earned are left out.

    Parameters
    ----------
    shard
        At least one of its problems can be earned from.
    rng
        Source of the search's randomness.
    """
    steps = max(problem.max_steps for problem in shard.problems)
    compiled, plans, rewards = [], [], []
    for problem in shard.problems:
        arrays = compile_problem(problem)
        search = new_search(arrays)
        if not len(search.near.active) or not len(search.near.wanted):
            continue
        set_routes(search, greedy_plan(problem).as_array())
        scale = max(float(arrays.level[0].max()), 1e-12)
        stream = np.random.Generator(np.random.SFC64(rng.integers(2**63)))
        anneal(search, stream, shard.moves, 0.1 * scale, 0.001 * scale, 0.01 * scale)
        if search.best[0] <= 1e-3 * scale:
            continue
        plan = np.full((steps, shard.n_uavs), shard.n_targets, np.int64)
        plan[: problem.max_steps] = actions_of(search)
        compiled.append(arrays)
        plans.append(plan)
        rewards.append(float(search.best[0]))
    return Demonstrations(stack(compiled), np.stack(plans), np.array(rewards))


def write_shard(folder: Path, seed: int, number: int) -> Path:
    """Make one shard of demonstrations, unless its file is there.

    Parameters
    ----------
    folder
        Where the files are.
    seed, number
        They decide everything in the shard.
    """
    path = folder / f"demonstrations-{seed}-{number:05}.npz"
    if not path.exists():
        rng = np.random.default_rng([seed, number])
        shown = demonstrate(draw_shard(rng), rng)
        partial = path.with_suffix(".part")
        with partial.open("wb") as file:
            np.savez(file, plans=shown.plans, rewards=shown.rewards, **shown.arrays._asdict())
        os.replace(partial, path)
    return path


def read_shard(path: Path) -> Demonstrations:
    """Read what :func:`write_shard` wrote."""
    with np.load(path) as file:
        arrays = ProblemArrays(**{name: file[name] for name in ProblemArrays._fields})
        return Demonstrations(arrays, file["plans"], file["rewards"])
