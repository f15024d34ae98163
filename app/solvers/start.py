"""The plan that a request has already: searches begin from it, and no answer earns less."""

from __future__ import annotations

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import rewards_of
from app.simulation.visit import ALLOWED
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.annealing import Search, set_routes
from app.solvers.protocol import StopCriterion


def own_plan(problem: Problem) -> tuple[Plan, float] | None:
    """Return the ``start_plan`` of a problem and what it earns where unloading is greedy.

    None is returned where there is none, or where it is not legal so.
    """
    if not problem.start_plan:
        return None
    plan = Plan(problem.start_plan)
    result = rewards_of(compile_problem(problem), np.array([plan.assignment], np.int64))
    return (plan, float(result.reward[0])) if result.rule[0] == ALLOWED else None


def begin_search(search: Search, problem: Problem, stop: StopCriterion) -> None:
    """Make the greedy rule's plan the current one, or the problem's own where that earns more."""
    set_routes(search, greedy_plan(problem, stop).as_array())
    own = own_plan(problem)
    if own is not None and own[1] > search.best[0]:
        set_routes(search, own[0].as_array())
