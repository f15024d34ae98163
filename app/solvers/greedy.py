"""The greedy rule: every UAV in turn takes the visit that earns most at once. The yardstick of the others."""

from __future__ import annotations

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.simulation.arrays import Integers, ProblemArrays, compile_problem
from app.simulation.explain import reward_of
from app.simulation.simulator import ALLOWED, Episodes, act, compiled, end_step, leg_to, new_episodes, verdict
from app.solvers.parameters import GreedyParameters
from app.solvers.protocol import History, Progress, Report, Solution, SolverContext, StopCriterion
from app.solvers.stop import never

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
    """Return the plan of the greedy rule; a UAV for which no visit earns anything flies home.

    Parameters
    ----------
    problem
        The problem.
    stop
        Asked after every few milliseconds of work; once it is true, whoever has not had their turn flies
        home. So the plan is legal however early that is.
    """
    arrays = compile_problem(problem)
    actions = np.full((problem.max_steps, problem.n_uavs), problem.n_targets, np.int64)
    episodes, turn = new_episodes(arrays, 1), np.zeros(2, np.int64)
    turns = max(1, _LOOKS // problem.n_targets)
    while not episodes.done[0]:
        _take_turns(arrays, episodes, actions, turn, turns)
        if stop():
            break
    return Plan.of(actions, problem.n_targets)


@compiled
def _take_turns(
    arrays: ProblemArrays, episodes: Episodes, actions: Integers, turn: Integers, turns: int
) -> None:
    """Play some turns of the greedy rule in episode 0 and write its actions, (S, M), filled with N before.

    `turn` has the step and the UAV whose turn is next.
    """
    for _ in range(turns):
        s, i = turn[0], turn[1]
        best, chosen = 0.0, arrays.level.shape[1]
        for j in range(arrays.level.shape[1]):
            if verdict(arrays, episodes, 0, i, j) == ALLOWED:
                earned = _earning(arrays, episodes, i, j)
                if earned > best:
                    best, chosen = earned, j
        act(arrays, episodes, 0, i, chosen)
        actions[s, i] = chosen
        turn[1] = i + 1
        if turn[1] == actions.shape[1]:
            turn[0], turn[1] = s + 1, 0
            end_step(arrays, episodes, 0)
            if episodes.done[0]:
                return


@compiled
def _earning(arrays: ProblemArrays, episodes: Episodes, i: int, j: int) -> float:
    """What an allowed visit of UAV `i` to target `j` earns now (rule 5 of section 3)."""
    unloaded = 0.0
    for k in range(episodes.load.shape[2]):
        unloaded += min(episodes.load[0, i, k], episodes.need[0, j, k])
    distance = leg_to(arrays, episodes, 0, i, j)
    return arrays.level[0, j] * unloaded / arrays.need_total[0, j] - arrays.weight[0] * distance
