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


class Greedy:
    """A :class:`~app.solvers.protocol.Solver` without randomness and without search."""

    def __init__(self, parameters: GreedyParameters, context: SolverContext) -> None:  # noqa: ARG002
        self.parameters = parameters

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:  # noqa: ARG002
        """See :class:`~app.solvers.protocol.Solver`; a plan takes microseconds, so `stop` is not asked."""
        plan = greedy_plan(problem)
        reward = reward_of(problem, plan)
        history = History()
        history.add(0, reward)
        report(Progress(1.0, 0, reward, plan))
        return Solution(plan, history, self.parameters)


def greedy_plan(problem: Problem) -> Plan:
    """Return the plan of the greedy rule; a UAV for which no visit earns anything flies home."""
    arrays = compile_problem(problem)
    actions = np.full((problem.max_steps, problem.n_uavs), problem.n_targets, np.int64)
    _roll_out(arrays, new_episodes(arrays, 1), actions)
    return Plan.of(actions, problem.n_targets)


@compiled
def _roll_out(arrays: ProblemArrays, episodes: Episodes, actions: Integers) -> None:
    """Play the greedy rule in episode 0 and write its actions, (S, M), filled with N before."""
    s = 0
    while not episodes.done[0]:
        for i in range(actions.shape[1]):
            best, chosen = 0.0, arrays.level.shape[1]
            for j in range(arrays.level.shape[1]):
                if verdict(arrays, episodes, 0, i, j) == ALLOWED:
                    earned = _earning(arrays, episodes, i, j)
                    if earned > best:
                        best, chosen = earned, j
            act(arrays, episodes, 0, i, chosen)
            actions[s, i] = chosen
        end_step(arrays, episodes, 0)
        s += 1


@compiled
def _earning(arrays: ProblemArrays, episodes: Episodes, i: int, j: int) -> float:
    """What an allowed visit of UAV `i` to target `j` earns now (rule 5 of section 3)."""
    unloaded = 0.0
    for k in range(episodes.load.shape[2]):
        unloaded += min(episodes.load[0, i, k], episodes.need[0, j, k])
    distance = leg_to(arrays, episodes, 0, i, j)
    return arrays.level[0, j] * unloaded / arrays.need_total[0, j] - arrays.weight[0] * distance
