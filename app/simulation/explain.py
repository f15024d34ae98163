"""From a plan to the answer a dispatcher reads: stops with times and amounts, and what stays unmet."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.domain.allocation import Allocation, Route, Stop
from app.domain.errors import IllegalPlan
from app.domain.plan import Actions, Plan
from app.domain.problem import Problem
from app.simulation import simulator, visit
from app.simulation.amounts import tidy
from app.simulation.arrays import Floats, ProblemArrays, compile_problem
from app.simulation.unloading import best_deliveries
from app.simulation.unmet import unmet_targets


def rewards_of(arrays: ProblemArrays, plans: Actions) -> simulator.Replay:
    """Replay plans of the first problem of a stack, with greedy unloading.

    Parameters
    ----------
    arrays
        The stack.
    plans
        (B, S, M) actions.
    """
    return simulator.replay(arrays, plans, np.zeros(len(plans), np.int64))


def reward_of(problem: Problem, plan: Plan) -> float:
    """Compute the reward of a plan; with planned unloading, that of its best deliveries.

    Raises
    ------
    IllegalPlan
        If one of its actions is not allowed.
    """
    actions = plan.as_array()
    result, _ = _replayed(problem, compile_problem(problem), actions)
    return float(result.reward[0])


def explain(problem: Problem, plan: Plan, hurry: Callable[[], bool] = lambda: False) -> Allocation:
    """Replay a plan and write down everything that follows from it.

    With planned unloading the deliveries are the best ones for the plan's routes.

    Parameters
    ----------
    problem, plan
        The problem and a legal plan of it.
    hurry
        Asked every few milliseconds; once it is true, reasons for unmet needs are found out no further than
        is quick. What the plan does is always complete.

    Raises
    ------
    IllegalPlan
        If one of its actions is not allowed; ``details`` has step (from 1), uav_id and rule.
    """
    arrays = compile_problem(problem)
    actions = plan.as_array()
    result, given = _replayed(problem, arrays, actions)

    # Nobody is sent home in this replay: at its end every UAV is still at its last stop, which is where the
    # leg home begins and where one more visit would begin.
    episodes = simulator.new_episodes(arrays, 1)
    legs, arrivals = np.zeros(actions.shape), np.zeros(actions.shape)
    delivered = np.zeros((*actions.shape, problem.n_materials)) if given is None else given
    return_legs = np.zeros(problem.n_uavs)
    _trace(arrays, episodes, actions, given is not None, legs, arrivals, delivered, return_legs)
    tidy(arrays, actions, delivered, episodes.need[0])
    routes = []
    for i, uav in enumerate(problem.uavs):
        stops = tuple(
            Stop(
                target_id=problem.targets[actions[s, i]].id,
                step=int(s) + 1,
                arrival_time=float(arrivals[s, i]),
                distance=float(legs[s, i]),
                delivered=tuple(delivered[s, i].tolist()),
            )
            for s in np.flatnonzero(actions[:, i] != problem.n_targets)
        )
        back = 0.0 if uav.ret else float(return_legs[i])
        routes.append(Route(uav.id, sum(stop.distance for stop in stops), back, stops))
    return Allocation(
        plan=plan,
        reward=float(result.reward[0]),
        satisfaction=float(result.satisfaction[0]),
        distance=float(result.distance[0]),
        distance_weight=problem.distance_weight,
        routes=tuple(routes),
        unmet=unmet_targets(problem, arrays, actions, delivered, episodes.need[0], hurry),
    )


@simulator.compiled
def _trace(
    arrays: ProblemArrays,
    episodes: simulator.Episodes,
    actions: Actions,
    planned: bool,
    legs: Floats,
    arrivals: Floats,
    delivered: Floats,
    return_legs: Floats,
) -> None:
    """Fly the visits of a legal plan, and write down every leg and arrival, then the legs home.

    Deliveries are written down too, unless they are planned: then `delivered` has them.
    """
    for s in range(actions.shape[0]):
        for i in range(actions.shape[1]):
            j = actions[s, i]
            if j == arrays.level.shape[1]:
                continue
            legs[s, i] = simulator.leg_to(arrays, episodes, 0, i, j)
            arrivals[s, i] = episodes.clock[0, i] + legs[s, i] / arrays.speed[0, i]
            if planned:
                simulator.deliver(arrays, episodes, i, j, delivered, s)
                continue
            for k in range(delivered.shape[2]):
                delivered[s, i, k] = min(episodes.load[0, i, k], episodes.need[0, j, k])
            simulator.act(arrays, episodes, 0, i, j)
    for i in range(actions.shape[1]):
        return_legs[i] = simulator.leg_home(arrays, episodes, 0, i)


def _replayed(
    problem: Problem, arrays: ProblemArrays, actions: Actions
) -> tuple[simulator.Replay, Floats | None]:
    """Replay a plan by the problem's rule of unloading; also return the deliveries if they are planned."""
    if problem.objective.unloading == "greedy":
        result, delivered = rewards_of(arrays, actions[None]), None
    else:
        # Rows and actions are looked at here already, as the deliveries are worked out before the replay.
        sound = len(actions) <= problem.max_steps and 0 <= actions.min() <= actions.max() <= problem.n_targets
        delivered = best_deliveries(arrays, actions) if sound else np.zeros((*actions.shape, arrays.shape[2]))
        result = simulator.replay_delivering(arrays, actions, delivered)
    _refuse_illegal(problem, actions, result)
    return result, delivered


def _refuse_illegal(problem: Problem, actions: Actions, result: simulator.Replay) -> None:
    rule = int(result.rule[0])
    if rule == visit.ALLOWED:
        return
    step, i = int(result.step[0]), int(result.uav[0])
    uav = problem.uavs[i].id
    raise IllegalPlan(
        f"step {step + 1}, {uav}: action {actions[step, i]} is not allowed: {visit.RULES[rule]}",
        details={"step": step + 1, "uav_id": uav, "rule": visit.RULES[rule]},
    )
