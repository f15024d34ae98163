"""What a plan earns, by the problem's own rule of unloading; an illegal one is refused by name."""

from __future__ import annotations

import numpy as np

from app.domain.errors import IllegalPlan
from app.domain.plan import Actions, Plan
from app.domain.problem import Problem
from app.simulation import replay, visit
from app.simulation.amounts import Amounts
from app.simulation.arrays import ProblemArrays, compile_problem
from app.simulation.planned_amounts import best_amounts


def rewards_of(arrays: ProblemArrays, plans: Actions) -> replay.Replay:
    """Replay plans of the first problem of a stack, with greedy unloading.

    Parameters
    ----------
    arrays
        The stack.
    plans
        (B, S, M) actions.
    """
    return replay.replay(arrays, plans, np.zeros(len(plans), np.int64))


def reward_of(problem: Problem, plan: Plan) -> float:
    """Compute the reward of a plan; with planned unloading, that of its best amounts.

    Raises
    ------
    IllegalPlan
        If one of its actions is not allowed.
    """
    actions = plan.as_array()
    result, _ = replayed(problem, compile_problem(problem), actions)
    return float(result.reward[0])


def replayed(
    problem: Problem, arrays: ProblemArrays, actions: Actions, given: Amounts | None = None
) -> tuple[replay.Replay, Amounts | None]:
    """Replay a plan by the problem's rule of unloading; also return the amounts if they are planned.

    Planned amounts are the best ones, or those that are given.

    Raises
    ------
    IllegalPlan
        If one of its actions is not allowed; ``details`` has step (from 1), uav_id and rule.
    """
    last = problem.n_targets + problem.n_bases
    # Rows and actions are looked at here already, as amounts are worked out before the replay.
    sound = len(actions) <= problem.max_steps and 0 <= actions.min() <= actions.max() <= last
    amounts: Amounts | None = given if sound else None
    if amounts is not None:
        result = replay.replay_with(arrays, actions, amounts)
    elif sound:
        result, amounts = replay_at_best(arrays, actions, problem.plans_unloading)
    else:
        result = rewards_of(arrays, actions[None])
    _refuse_illegal(problem, actions, result)
    return result, amounts


def replay_at_best(
    arrays: ProblemArrays, actions: Actions, planned: bool
) -> tuple[replay.Replay, Amounts | None]:
    """Replay a plan of the first problem of a stack with its best amounts.

    Parameters
    ----------
    arrays
        The stack.
    actions
        (S', M) joint actions, of as many steps as there may be at most.
    planned
        Whether amounts are planned; otherwise they are those of greedy unloading.

    Returns
    -------
    Replay, Amounts or None
        None stands for the amounts of greedy unloading.
    """
    if not planned:
        return rewards_of(arrays, actions[None]), None
    amounts = best_amounts(arrays, actions)
    result = replay.replay_with(arrays, actions, amounts)
    if not arrays.n_bases or arrays.terms["plans_loading"][0]:
        return result, amounts
    # Where refilling takes from a limited stock what others need, keeping material need not pay.
    greedy = rewards_of(arrays, actions[None])
    worse = greedy.rule[0] != visit.ALLOWED or greedy.reward[0] <= result.reward[0]
    return (result, amounts) if worse and result.rule[0] == visit.ALLOWED else (greedy, None)


def _refuse_illegal(problem: Problem, actions: Actions, result: replay.Replay) -> None:
    rule = int(result.rule[0])
    if rule == visit.ALLOWED:
        return
    step, i = int(result.step[0]), int(result.uav[0])
    uav = problem.uavs[i].id
    raise IllegalPlan(
        f"step {step + 1}, {uav}: action {actions[step, i]} is not allowed: {visit.RULES[rule]}",
        details={"step": step + 1, "uav_id": uav, "rule": visit.RULES[rule]},
    )
