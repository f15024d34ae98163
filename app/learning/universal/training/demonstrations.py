"""Near-optimal plans of generated problems, by the compiled local search: what the policy learns from."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from app.domain.problem import Problem
from app.learning.universal.episodes.best_plan import BestPlan
from app.learning.universal.episodes.effort import effort
from app.learning.universal.episodes.rollout import play_in_orders
from app.learning.universal.episodes.turn_order import some_orders
from app.learning.universal.network.agent import UniversalAgent
from app.learning.universal.training.curriculum import Shard, draw_shard
from app.simulation.arrays import Floats, Integers, ProblemArrays, compile_problem
from app.simulation.columns import AREAS, BASES, TERMS, UAVS
from app.simulation.generator import FAMILIES
from app.simulation.stacks import stack
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.annealing import actions_of, anneal, new_search, set_routes
from app.solvers.scale import largest_level


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


@dataclass(frozen=True, slots=True)
class Series:
    """Shards of one kind, numbered from 0.

    Attributes
    ----------
    name
        Begins the names of their files.
    stream
        Tells their random numbers from those of other series.
    families
        Families of their problems.
    search
        Share of the moves of a full search that a plan is searched with.
    """

    name: str
    stream: tuple[int, ...] = ()
    families: tuple[str, ...] = tuple(FAMILIES)
    search: float = 1.0


def demonstrate(
    shard: Shard, rng: np.random.Generator, agent: UniversalAgent | None = None
) -> Demonstrations:
    """Search a plan for each problem of a shard; problems in which nothing can be earned are left out.

    Parameters
    ----------
    shard
        At least one of its problems can be earned from.
    rng
        Source of the search's randomness.
    agent
        Policy from whose best greedy roll-out the search begins, cooler than from the greedy rule's plan: of
        the many plans that are about as good it finds one that is near to what the policy would do.
    """
    steps = max(problem.max_steps for problem in shard.problems)
    compiled, plans, rewards = [], [], []
    for problem in shard.problems:
        arrays = compile_problem(problem)
        search = new_search(arrays)
        if not len(search.near.active) or not len(search.near.wanted):
            continue
        start, heat = _start(problem, arrays, rng, agent)
        set_routes(search, start)
        scale = largest_level(arrays)
        stream = np.random.Generator(np.random.SFC64(rng.integers(2**63)))
        # All arguments: with one left out it would be compiled again.
        anneal(search, stream, shard.moves, heat * scale, 0.001 * scale, 0.01 * scale, 0.0, 0.0, False)
        if search.best[0] <= 1e-3 * scale:
            continue
        plan = np.full((steps, shard.n_uavs), shard.n_targets, np.int64)
        plan[: problem.max_steps] = actions_of(search)
        compiled.append(arrays)
        plans.append(plan)
        rewards.append(float(search.best[0]))
    return Demonstrations(stack(compiled), np.stack(plans), np.array(rewards))


def _start(
    problem: Problem, arrays: ProblemArrays, rng: np.random.Generator, agent: UniversalAgent | None
) -> tuple[Integers, float]:
    """Plan that a search begins from, and its first temperature in largest levels."""
    greedy = greedy_plan(problem).as_array()
    if agent is None:
        return greedy, 0.1
    best = BestPlan(arrays)
    best.consider(greedy[None])
    best.consider(play_in_orders(agent, arrays, some_orders(effort(arrays).orders, problem.n_uavs, rng)))
    return best.actions, 0.02


def write_shard(
    folder: Path, series: Series, seed: int, number: int, agent: UniversalAgent | None = None
) -> Path:
    """Make one shard of demonstrations, unless its file is there.

    Parameters
    ----------
    folder
        Where the files are.
    series, seed, number
        They decide which problems it has.
    agent
        As :func:`demonstrate` has it.
    """
    path = folder / f"{series.name}-{seed}-{number:05}.npz"
    if not path.exists():
        rng = np.random.default_rng([seed, number, *series.stream])
        shard = draw_shard(rng, series.families)
        shard = replace(shard, moves=round(series.search * shard.moves))
        save_shard(path, demonstrate(shard, rng, agent))
    return path


def save_shard(path: Path, shown: Demonstrations) -> None:
    """Write demonstrations so that the file is there whole or not at all."""
    partial = path.with_suffix(".part")
    with partial.open("wb") as file:
        np.savez(file, plans=shown.plans, rewards=shown.rewards, **shown.arrays._asdict())
    os.replace(partial, path)


def read_shard(path: Path) -> Demonstrations:
    """Read what :func:`write_shard` wrote."""
    with np.load(path) as file:
        arrays = ProblemArrays(**{name: file[name] for name in ProblemArrays._fields})
        # A file does not say that its records are aligned; for others everything would be compiled again.
        arrays = arrays._replace(
            uavs=arrays.uavs.view(UAVS),
            areas=arrays.areas.view(AREAS),
            bases=arrays.bases.view(BASES),
            terms=arrays.terms.view(TERMS),
        )
        return Demonstrations(arrays, file["plans"], file["rewards"])
