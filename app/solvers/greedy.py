"""The greedy rule: every UAV in turn takes the visit that earns most at once. The yardstick of the others.

A UAV for which no visit earns anything reloads, if the visit after it earns more than both legs cost. Where
the leg home costs reward, a visit is charged with what it makes that leg longer, or paid for what it
makes it shorter. So no visit loses, and the plan never earns less than staying at home.
"""

from __future__ import annotations

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.simulation.arrays import Floats, Integers, ProblemArrays, compile_problem
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.evaluation import reward_of
from app.simulation.simulator import act, earned_now, end_step, leg_home, leg_to, new_episodes, verdict
from app.simulation.visit import ALLOWED, way_home
from app.simulation.worth import cost_of, most_earned_by
from app.solvers.parameters import GreedyParameters
from app.solvers.protocol import History, Progress, Report, Solution, SolverContext, StopCriterion
from app.solvers.stop import never

_ROUNDING = 1e-12
"""Relative error that sums of amounts and earnings may have, and more."""

_LOOKS = 400_000
"""Visits that are looked at between two looks at the stop criterion: a few milliseconds."""


class Greedy:
    """A :class:`~app.solvers.protocol.Solver` without randomness and without search."""

    def __init__(self, parameters: GreedyParameters, context: SolverContext) -> None:  # noqa: ARG002 - as the protocol has it
        self.parameters = parameters

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:  # noqa: ARG002 - as the protocol has it
        """See :class:`~app.solvers.protocol.Solver`."""
        plan = greedy_plan(problem, stop)
        reward = reward_of(problem, plan)
        history = History()
        history.add(0, reward)
        report(Progress(1.0, 0, reward, plan))
        return Solution(plan, history, self.parameters)


def greedy_plan(problem: Problem, stop: StopCriterion = never) -> Plan:
    """Return the plan of the greedy rule; a UAV for which nothing earns anything flies home.

    Parameters
    ----------
    problem
        The problem.
    stop
        Asked after every few milliseconds of work; once it is true, a UAV that has not had its turn flies
        home. So the plan is legal however early that is.
    """
    arrays = compile_problem(problem)
    actions = np.full((problem.max_steps, problem.n_uavs), problem.n_targets, np.int64)
    episodes, turn = new_episodes(arrays, 1), np.zeros(2, np.int64)
    spare, worth = np.zeros((2, problem.n_materials)), np.zeros(1)
    left = arrays.need[0].sum(axis=1)
    turns = max(1, _LOOKS // (problem.n_targets + 8 * problem.n_materials))
    while not episodes.done[0]:
        _take_turns(arrays, episodes, actions, turn, left, turns, spare, worth)
        if stop():
            break
    return Plan.of(actions, problem.n_targets)


@compiled
def _take_turns(
    arrays: ProblemArrays,
    episodes: Episodes,
    actions: Integers,
    turn: Integers,
    left: Floats,
    turns: int,
    spare: Floats,
    worth: Floats,
) -> None:
    """Play some turns of the greedy rule in episode 0 and write its actions, (S, M), filled with N before.

    `turn` has the step and the UAV whose turn is next, `left` the sum of what each target still needs, (N,);
    `spare`, (2, K), and `worth`, (1,), are scratch space.
    """
    home = arrays.need.shape[1]
    for _ in range(turns):
        s, i = turn[0], turn[1]
        chosen = _best_visit(arrays, episodes, left, i, worth)
        if chosen == home and s + 1 < actions.shape[0]:
            chosen = _best_reload(arrays, episodes, left, i, spare, worth)
        act(arrays, episodes, 0, i, chosen)
        actions[s, i] = chosen
        if chosen < home:
            left[chosen] = episodes.need[0, chosen].sum()
        turn[1] = i + 1
        if turn[1] == actions.shape[1]:
            turn[0], turn[1] = s + 1, 0
            end_step(arrays, episodes, 0)
            if episodes.done[0]:
                return


@compiled
def _best_visit(arrays: ProblemArrays, episodes: Episodes, left: Floats, i: int, worth: Floats) -> int:
    """Return the target whose visit earns most for UAV `i` now, and what in `worth`; N where none does."""
    best, chosen = 0.0, arrays.need.shape[1]
    worth[0] = 0.0
    if episodes.ret[0, i]:
        return chosen
    carried = episodes.load[0, i].sum()
    back = leg_home(arrays, episodes, 0, i) if arrays.terms[0].charge_return else 0.0
    for j in range(arrays.need.shape[1]):
        # What it earns at most is known at once, and mostly too little; the margin is for rounding errors.
        most = min(carried, left[j]) * (1.0 + _ROUNDING)
        if most <= 0.0:
            continue
        way = leg_to(arrays, episodes, 0, i, j)
        if arrays.terms[0].charge_return:
            way += way_home(arrays, 0, i, j) - back
        cost = cost_of(arrays, 0, way)
        if most_earned_by(arrays, 0, j, most) - cost <= best:
            continue
        if verdict(arrays, episodes, 0, i, j) != ALLOWED:
            continue
        unloaded = 0.0
        for k in range(episodes.load.shape[2]):
            unloaded += min(episodes.load[0, i, k], episodes.need[0, j, k])
        gain = earned_now(arrays, episodes, 0, i, j, unloaded)
        earned = gain - cost
        # Of equals the first, whatever rounding makes of them.
        if earned > best + _ROUNDING * gain:
            best, chosen = earned, j
    worth[0] = best
    return chosen


@compiled
def _best_reload(
    arrays: ProblemArrays, episodes: Episodes, left: Floats, i: int, spare: Floats, worth: Floats
) -> int:
    """Return the base where UAV `i` best reloads for a visit; N where both together earn nothing."""
    best, chosen = 0.0, arrays.need.shape[1]
    at, flown, clock, aloft = (
        episodes.at[0, i], episodes.flown[0, i], episodes.clock[0, i], episodes.aloft[0, i],
    )  # fmt: skip
    distance = episodes.distance[0]
    back = leg_home(arrays, episodes, 0, i) if arrays.terms[0].charge_return else 0.0
    for d in range(arrays.stock.shape[1]):
        base = arrays.need.shape[1] + 1 + d
        if verdict(arrays, episodes, 0, i, base) != ALLOWED:
            continue
        for k in range(spare.shape[1]):
            spare[0, k], spare[1, k] = episodes.load[0, i, k], episodes.stock[0, d, k]
        earned = act(arrays, episodes, 0, i, base) + cost_of(arrays, 0, back)
        _best_visit(arrays, episodes, left, i, worth)
        earned += worth[0]
        if worth[0] > 0.0 and earned > best:
            best, chosen = earned, base
        episodes.at[0, i], episodes.flown[0, i] = at, flown
        episodes.clock[0, i], episodes.aloft[0, i] = clock, aloft
        episodes.visits[0, i] -= 1
        episodes.distance[0] = distance
        for k in range(spare.shape[1]):
            episodes.load[0, i, k], episodes.stock[0, d, k] = spare[0, k], spare[1, k]
    return chosen
