"""Corrections: what should have been done from a state on that the policy has come to.

A policy that only imitates searched plans never sees where its own mistakes lead. Here it plays a problem up
to a step that is drawn; what it has flown stays, and the rest is searched, beginning from what it did.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.domain.plan import Actions, Plan
from app.domain.problem import UAV, Problem
from app.learning.universal.episodes.played import AnySizePolicy
from app.learning.universal.training.demonstrations import Demonstration, demonstrate
from app.simulation.arrays import compile_problem

GREEDY_SHARE = 0.5
"""Share of the episodes that are played greedily; the others are sampled."""

TEMPERATURE = 0.7
"""Of the sampled ones."""


def correct(
    problem: Problem, policy: AnySizePolicy, moves: int, rng: np.random.Generator
) -> Demonstration | None:
    """Let the policy play, and search the rest of its plan from a step on.

    Parameters
    ----------
    problem
        Changes of its own plan cost nothing here: the plan to begin from is the policy's.
    policy
        Plays one episode.
    moves
        Of the search.
    rng
        Decides how the policy plays, the step, and the search.

    Returns
    -------
    Demonstration or None
        The whole plan, worth imitating from the step on, or from where the search left the policy's plan
        before it. None where nothing can be earned.
    """
    problem = replace(problem, start_plan=None, objective=replace(problem.objective, change_weight=0.0))
    arrays = compile_problem(problem)
    own = rng if rng.random() >= GREEDY_SHARE else None
    played = policy.play(arrays, np.zeros(1, np.int64), own, TEMPERATURE)
    plan = played.plans[0]
    step = draw_step(plan, problem.n_targets, rng)
    made = demonstrate(continued(problem, plan, step), moves, rng)
    if made is None:
        return None
    first = min(step, first_difference(plan, made.plan))
    return made._replace(problem=problem, first=first, played=float(played.rewards[0]))


def draw_step(plan: Actions, home: int, rng: np.random.Generator) -> int:
    """Draw a step of a plan (S, M), none after its last action nor after its first reload.

    A reload before the step would be free to change, as only visits are committed to.
    """
    acting = np.flatnonzero((plan != home).any(axis=1))
    reloading = np.flatnonzero((plan > home).any(axis=1))
    steps = int(acting[-1]) + 1 if len(acting) else 1
    if len(reloading):
        steps = min(steps, int(reloading[0]) + 1)
    return int(rng.integers(steps))


def continued(problem: Problem, plan: Actions, step: int) -> Problem:
    """Return a problem whose UAVs are committed to what a plan has visited before a step, and begin with it.

    Parameters
    ----------
    problem
        The problem.
    plan
        (S, M), allowed; without a reload before the step.
    step
        From 0.
    """
    uavs = tuple(_committed(problem, uav, plan[:step, i].tolist()) for i, uav in enumerate(problem.uavs))
    return replace(problem, uavs=uavs, start_plan=Plan.of(plan, problem.n_targets).assignment)


def _committed(problem: Problem, uav: UAV, actions: list[int]) -> UAV:
    visited = tuple(problem.targets[j].id for j in actions if j != problem.n_targets)
    # A plan begins with what was committed to before.
    return replace(uav, committed=visited + uav.committed[len(visited) :])


def first_difference(one: Actions, other: Actions) -> int:
    """Return the first step at which two plans (S', M) differ, or how many steps they have in common."""
    common = min(len(one), len(other))
    differs = np.flatnonzero((one[:common] != other[:common]).any(axis=1))
    return int(differs[0]) if len(differs) else common
