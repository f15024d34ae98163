"""What a job answers with: a plan, whose it is, and what is known of it."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.domain.errors import AllocatorError
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.jobs.model import BEST_KNOWN
from app.simulation.evaluation import reward_of
from app.solvers import protocol

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class BestKnown:
    """The best plan of an earlier attempt at a job, evaluated anew.

    Attributes
    ----------
    plan, reward
        The plan, and what it earns.
    answered_by
        The algorithm that found it.
    """

    plan: Plan
    reward: float
    answered_by: str


@dataclass(frozen=True, slots=True)
class Found:
    """A solution, and the algorithm whose plan it is."""

    solution: protocol.Solution
    answered_by: str

    def or_better(self, problem: Problem, known: BestKnown | None) -> Found:
        """Return this, or the plan of an earlier attempt where that earns more.

        The history then never falls below that plan, as the best reward that was reported never did.
        """
        if known is None or reward_of(problem, self.solution.plan) >= known.reward:
            return self
        history = self.solution.history
        risen = [max(reward, known.reward) for reward in history.reward]
        solution = replace(
            self.solution, plan=known.plan, history=protocol.History(list(history.epoch), risen)
        )
        return Found(solution, known.answered_by)


def best_known(problem: Problem, payload: Mapping[str, Any]) -> BestKnown | None:
    """Return the best plan of an earlier attempt; None where there is none, or none that holds.

    The process that reported it has died or was killed: nothing that it said is taken for granted.
    """
    told = payload.get(BEST_KNOWN)
    if told is None:
        return None
    try:
        plan = _plan_of(problem, told["assignment"])
        reward = reward_of(problem, plan)
    except (AllocatorError, KeyError, TypeError, ValueError) as error:
        _log.warning("the plan of an earlier attempt is not used: %s", error)
        return None
    return BestKnown(plan, reward, told.get("answered_by") or payload["algorithm"])


def _plan_of(problem: Problem, assignment: Any) -> Plan:
    """Return a plan of the right shape.

    Raises
    ------
    TypeError, ValueError
        If it is none.
    """
    if not 1 <= len(assignment) <= problem.max_steps:
        raise ValueError(f"it has {len(assignment)} joint actions, not 1 to {problem.max_steps}")
    for row in assignment:
        if len(row) != problem.n_uavs:
            raise ValueError(f"a joint action has {len(row)} actions, not {problem.n_uavs}")
        last = problem.n_targets + problem.n_bases
        if not all(type(action) is int and 0 <= action <= last for action in row):
            raise ValueError(f"an action is not a whole number from 0 to {last}")
    return Plan(tuple(map(tuple, assignment)))
