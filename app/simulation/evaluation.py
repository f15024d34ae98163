"""What a plan earns, by the problem's own rule of unloading; an illegal one is refused by name."""

from __future__ import annotations

import numpy as np

from app.domain.errors import IllegalPlan
from app.domain.plan import Actions, Plan
from app.domain.problem import Problem
from app.simulation import replay, visit
from app.simulation.arrays import Floats, ProblemArrays, compile_problem
from app.simulation.deliveries import best_deliveries


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
    """Compute the reward of a plan; with planned unloading, that of its best deliveries.

    Raises
    ------
    IllegalPlan
        If one of its actions is not allowed.
    """
    actions = plan.as_array()
    result, _ = replayed(problem, compile_problem(problem), actions)
    return float(result.reward[0])


def replayed(
    problem: Problem, arrays: ProblemArrays, actions: Actions
) -> tuple[replay.Replay, Floats | None]:
    """Replay a plan by the problem's rule of unloading; also return the deliveries if they are planned.

    Raises
    ------
    IllegalPlan
        If one of its actions is not allowed; ``details`` has step (from 1), uav_id and rule.
    """
    if not problem.plans_unloading:
        result, delivered = rewards_of(arrays, actions[None]), None
    else:
        # Rows and actions are looked at here already, as the deliveries are worked out before the replay.
        sound = len(actions) <= problem.max_steps and 0 <= actions.min() <= actions.max() <= problem.n_targets
        delivered = best_deliveries(arrays, actions) if sound else np.zeros((*actions.shape, arrays.shape[2]))
        result = replay.replay_delivering(arrays, actions, delivered)
    _refuse_illegal(problem, actions, result)
    return result, delivered


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
