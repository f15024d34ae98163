"""An upper bound on the reward of any plan, as good as the time allows."""

from __future__ import annotations

from typing import NamedTuple

from app.domain.problem import Problem
from app.simulation.simulator import new_episodes
from app.solvers.bound.instance import Instance, ceiling, new_instance
from app.solvers.bound.target_sets import MAX_TARGETS, TargetSets, count_sets, sets_of
from app.solvers.bound.tree import PROVEN, Tree
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
        When true, the bound so far is returned. It is asked every few milliseconds, and HiGHS is told how
        long it leaves.
    """
    instance = new_instance(problem)
    lower = float(instance.idle.sum())
    if reward is not None:
        lower = max(lower, reward / instance.scale)
    if not instance.useful.any() or new_episodes(instance.arrays, 1).done[0]:
        # No visit is allowed, so there is but one plan.
        return UpperBound(float(instance.idle.sum()) * instance.scale, True)
    sets = enumerate_sets(instance, stop)
    if sets is None:
        value = bound_without_sets(instance, lower, stop)
        tight = value <= lower
    else:
        tree = Tree(instance, sets, lower)
        tree.run(stop)
        reached = instance.exact or tree.bound <= lower
        value, tight = tree.bound, tree.proven and tree.attained and reached
    return UpperBound(_without_margin(instance, lower, value) * instance.scale, tight)


def _without_margin(instance: Instance, lower: float, value: float) -> float:
    """Leave a bound as it is, unless it is nothing but what was added for rounding errors."""
    margin = 2.0 * (ceiling(instance) - float(instance.worth.sum()) + PROVEN)
    return max(lower, 0.0) if value <= margin and abs(lower) <= margin else value


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


def sets_are_few(instance: Instance) -> bool:
    """Say whether the target sets of all UAVs are few enough to be enumerated; with reloads never."""
    if instance.arrays.n_bases:
        return False
    return instance.need.shape[0] <= MAX_TARGETS and count_sets(instance) <= MOST_SETS


def enumerate_sets(instance: Instance, stop: StopCriterion) -> tuple[TargetSets, ...] | None:
    """Enumerate the target sets of every UAV; None where there are too many of them or too little time."""
    if not sets_are_few(instance):
        return None
    sets = []
    for i in range(len(instance.idle)):
        own = sets_of(instance, i, stop)
        if own is None:
            return None
        sets.append(own)
    return tuple(sets)


def gap(bound: float, reward: float) -> float | None:
    """Return the share of the bound by which the reward may fall short of the best.

    None where it is not defined, because the bound is not positive.
    """
    return max(0.0, bound - reward) / bound if bound > 0 else None
