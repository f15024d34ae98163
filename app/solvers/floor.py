"""What no answer is worse than: staying at home, the request's own plan, and the greedy rule."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.simulation.amounts import Amounts
from app.simulation.arrays import NONE, ProblemArrays, compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.flown_plan import record_plan
from app.simulation.from_start import look_from_start
from app.simulation.simulator import new_episodes
from app.solvers.greedy import greedy_plan
from app.solvers.protocol import (
    History,
    Parameters,
    Progress,
    Proof,
    Report,
    Solution,
    Solver,
    StopCriterion,
)
from app.solvers.start import own_plan


def nothing_to_fly(problem: Problem) -> bool:
    """Say whether no plan earns more than staying at home, because no UAV has an allowed visit in any.

    A first visit begins where a UAV is, or at a base that it reloads at before. Where a reload is allowed and
    the way home costs reward, that is never said: the reload may shorten it.
    """
    arrays = compile_problem(problem)
    if new_episodes(arrays, 1).done[0]:
        return True
    reloads_alone = arrays.n_bases > 0 and not arrays.terms["charge_return"][0]
    return reloads_alone and not _any_served(problem, arrays)


def _any_served(problem: Problem, arrays: ProblemArrays) -> bool:
    """Whether a UAV can come to a target with something that it needs, whatever it is committed to."""
    stays = Plan.empty(problem.n_uavs, problem.n_targets).as_array()
    nothing = np.zeros((*stays.shape, problem.n_materials))
    if arrays.terms["plans_loading"][0]:
        # What one UAV leaves at a base another one may take.
        arrays = arrays._replace(stock=np.full_like(arrays.stock, np.inf))
    plan = record_plan(arrays, stays, Amounts(nothing, nothing), planned=False)
    wanted = np.flatnonzero(arrays.areas["need_total"][0] > 0.0)
    # Mostly one of the first targets is served: twice as many each time.
    first, count = 0, 1
    while first < len(wanted):
        some = wanted[first : first + count]
        if (look_from_start(arrays, plan, some).able[some] != NONE).any():
            return True
        first, count = first + count, 2 * count
    return False


class Floor:
    """A :class:`~app.solvers.protocol.Solver` whose answers, and what it tells, never fall below a floor.

    Where the algorithm's own plan earns less, the plan of the floor is the answer, and ``answered_by`` says
    so if it is the greedy rule's, or the ``start_plan`` of the problem. The history stays the algorithm's.

    Parameters
    ----------
    algorithm
        The one that solves.
    parameters
        What it was built with.
    greedy
        Whether the floor is the greedy rule's plan, as far as there is time for it; if not, it is staying at
        home.
    learns
        Whether what it learns is asked for, even where nothing can be flown. Otherwise it is not run there.
    """

    def __init__(self, algorithm: Solver, parameters: Parameters, *, greedy: bool, learns: bool) -> None:
        self._algorithm, self._parameters, self._greedy, self._learns = algorithm, parameters, greedy, learns

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`; its own ``solve`` gets the same."""
        plan = Plan.empty(problem.n_uavs, problem.n_targets)
        reward = reward_of(problem, plan)
        if not self._learns and nothing_to_fly(problem):
            report(Progress(1.0, 0, reward, plan))
            return Solution(plan, History([0], [reward]), self._parameters, proof=Proof(reward, True))
        answered_by = None
        own = own_plan(problem)
        if own is not None and own[1] > reward:
            plan, reward, answered_by = *own, "start_plan"
        if self._greedy:
            by_rule = greedy_plan(problem, stop)
            earned = reward_of(problem, by_rule)
            if earned > reward:
                plan, reward, answered_by = by_rule, earned, "greedy"

        def told(progress: Progress) -> None:
            if progress.best_reward < reward:
                progress = replace(progress, best_reward=reward, incumbent=plan)
            report(progress)

        solution = self._algorithm.solve(problem, seed, stop, told)
        if reward_of(problem, solution.plan) >= reward:
            return solution
        proof = solution.proof and replace(solution.proof, bound=max(solution.proof.bound, reward))
        return replace(solution, plan=plan, proof=proof, answered_by=answered_by)
