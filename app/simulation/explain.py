"""From a plan to the answer a dispatcher reads: stops with times and amounts, and what stays unmet."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.domain.allocation import Allocation, Route, Stop
from app.domain.plan import Actions, Plan
from app.domain.problem import Problem
from app.simulation import simulator, visit
from app.simulation.amounts import tidy
from app.simulation.arrays import Floats, ProblemArrays, compile_problem
from app.simulation.evaluation import replayed
from app.simulation.unmet import unmet_targets


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
    result, given = replayed(problem, arrays, actions)

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
            if j == arrays.need.shape[1]:
                continue
            legs[s, i] = simulator.leg_to(arrays, episodes, 0, i, j)
            time = visit.leg_time(arrays, 0, i, episodes.at[0, i], j, legs[s, i])
            arrivals[s, i] = episodes.clock[0, i] + time
            if planned:
                simulator.deliver(arrays, episodes, i, j, delivered, s)
                continue
            for k in range(delivered.shape[2]):
                delivered[s, i, k] = min(episodes.load[0, i, k], episodes.need[0, j, k])
            simulator.act(arrays, episodes, 0, i, j)
    for i in range(actions.shape[1]):
        return_legs[i] = simulator.leg_home(arrays, episodes, 0, i)
