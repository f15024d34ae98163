"""From a plan to the answer a dispatcher reads: stops with times and amounts, and what stays unmet."""

from __future__ import annotations

import numpy as np

from app.domain.allocation import Allocation, Route, Stop
from app.domain.errors import IllegalPlan
from app.domain.plan import Actions, Plan
from app.domain.problem import Problem
from app.simulation import simulator
from app.simulation.arrays import ProblemArrays, compile_problem
from app.simulation.unmet import unmet_targets


def rewards_of(arrays: ProblemArrays, plans: Actions) -> simulator.Replay:
    """Replay plans of the first problem of a stack.

    Parameters
    ----------
    arrays
        The stack.
    plans
        (B, S, M) actions.
    """
    return simulator.replay(arrays, plans, np.zeros(len(plans), np.int64))


def reward_of(problem: Problem, plan: Plan) -> float:
    """Compute the reward of a plan.

    Raises
    ------
    IllegalPlan
        If one of its actions is not allowed.
    """
    actions = plan.as_array()
    result = rewards_of(compile_problem(problem), actions[None])
    _refuse_illegal(problem, actions, result)
    return float(result.reward[0])


def explain(problem: Problem, plan: Plan) -> Allocation:
    """Replay a plan and write down everything that follows from it.

    Raises
    ------
    IllegalPlan
        If one of its actions is not allowed; ``details`` has step (from 1), uav_id and rule.
    """
    arrays = compile_problem(problem)
    actions = plan.as_array()
    result = rewards_of(arrays, actions[None])
    _refuse_illegal(problem, actions, result)

    # Nobody is sent home in this replay: at its end every UAV is still at its last stop, which is where the
    # leg home begins and where one more visit would begin.
    episodes = simulator.new_episodes(arrays, 1)
    stops: list[list[Stop]] = [[] for _ in problem.uavs]
    for s, joint in enumerate(actions):
        for i, action in enumerate(joint):
            if action != problem.n_targets:
                stops[i].append(_visit(problem, arrays, episodes, i, int(action), s + 1))
    routes = tuple(
        Route(
            uav_id=uav.id,
            distance=sum(stop.distance for stop in stops[i]),
            return_distance=0.0 if uav.ret else float(simulator.leg_home(arrays, episodes, 0, i)),
            stops=tuple(stops[i]),
        )
        for i, uav in enumerate(problem.uavs)
    )
    return Allocation(
        plan=plan,
        reward=float(result.reward[0]),
        satisfaction=float(result.satisfaction[0]),
        distance=float(result.distance[0]),
        distance_weight=problem.distance_weight,
        routes=routes,
        unmet=unmet_targets(problem, arrays, episodes, [len(route.stops) for route in routes]),
    )


def _visit(
    problem: Problem, arrays: ProblemArrays, episodes: simulator.Episodes, i: int, j: int, step: int
) -> Stop:
    leg = simulator.leg_to(arrays, episodes, 0, i, j)
    arrival = episodes.clock[0, i] + leg / arrays.speed[0, i]
    before = episodes.load[0, i].copy()
    simulator.act(arrays, episodes, 0, i, j)
    delivered = before - episodes.load[0, i]
    return Stop(
        target_id=problem.targets[j].id,
        step=step,
        arrival_time=float(arrival),
        distance=float(leg),
        delivered=tuple(float(amount) for amount in delivered),
    )


def _refuse_illegal(problem: Problem, actions: Actions, result: simulator.Replay) -> None:
    rule = int(result.rule[0])
    if rule == simulator.ALLOWED:
        return
    step, i = int(result.step[0]), int(result.uav[0])
    uav = problem.uavs[i].id
    raise IllegalPlan(
        f"step {step + 1}, {uav}: action {actions[step, i]} is not allowed: {simulator.RULES[rule]}",
        details={"step": step + 1, "uav_id": uav, "rule": simulator.RULES[rule]},
    )
