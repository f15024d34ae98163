"""An upper bound on the reward of any plan, as good as the time allows."""

from __future__ import annotations

from typing import NamedTuple

from app.domain.problem import Problem
from app.solvers.bound.instance import Instance, new_instance
from app.solvers.bound.target_sets import MAX_TARGETS, TargetSets, count_sets, sets_of
from app.solvers.bound.tree import Tree
from app.solvers.bound.visits import visit_bound
from app.solvers.bound.whole_routes import route_bound
from app.solvers.protocol import StopCriterion

MOST_SETS = 500_000
"""Target sets, over all UAVs, that are enumerated; beyond it a bound over single visits takes over.

Their worth at one vector of prices takes some 50 ms.
"""


class UpperBound(NamedTuple):
    """A bound.

    Attributes
    ----------
    value
        No plan earns more, whether it unloads greedily or as planned.
    tight
        Whether the bound is known to be reached, by planned unloading or by the reward that was given.
    """

    value: float
    tight: bool


def upper_bound(problem: Problem, reward: float | None, stop: StopCriterion) -> UpperBound:
    """Bound the reward of any plan for a problem, under either unloading rule.

    Parameters
    ----------
    problem
        The problem.
    reward
        What some plan earns, under either rule; parts of the search that cannot beat it are left out, so the
        bound is never below it. None: no plan is known but staying at home.
    stop
        When true, the bound so far is returned. It is asked every few milliseconds on problems of the
        paper's sizes; on larger ones a round of pricing is the longest time between two looks.
    """
    instance = new_instance(problem)
    lower = float(instance.idle.sum())
    if reward is not None:
        lower = max(lower, reward / instance.scale)
    sets = enumerate_sets(instance, stop)
    if sets is None:
        value = bound_without_sets(instance, lower, stop)
        return UpperBound(value * instance.scale, value <= lower)
    tree = Tree(instance, sets, lower)
    tree.run(stop)
    return UpperBound(tree.bound * instance.scale, tree.proven and tree.attained)


def bound_without_sets(instance: Instance, lower: float, stop: StopCriterion) -> float:
    """Bound the reward of any plan, in the instance's scale, where target sets are too many.

    Parameters
    ----------
    instance, lower
        The problem, and what some plan earns, in the instance's scale.
    stop
        As for :func:`upper_bound`.
    """
    # The one over visits is quick; the other takes all the time there is where routes are many.
    value = visit_bound(instance, lower, stop)
    if value > lower:
        value = min(value, route_bound(instance, lower, stop))
    return max(lower, value)


def enumerate_sets(instance: Instance, stop: StopCriterion) -> tuple[TargetSets, ...] | None:
    """Enumerate the target sets of every UAV; None where there are too many of them or too little time."""
    if instance.need.shape[0] > MAX_TARGETS or count_sets(instance) > MOST_SETS:
        return None
    sets = []
    for i in range(len(instance.idle)):
        if stop():
            return None
        sets.append(sets_of(instance, i))
    return tuple(sets)


def gap(bound: float, reward: float) -> float | None:
    """Return the share of the bound by which the reward may fall short of the best.

    Where there is nothing to gain and nothing was gained, it is 0; None where it is not defined, because the
    bound is not positive.
    """
    missing = max(0.0, bound - reward)
    if bound > 0:
        return missing / bound
    return 0.0 if missing <= 1e-9 * max(1.0, abs(bound)) else None
