"""The algorithm a dispatcher should take: every start that pays, then local search in the time left.

What pays was measured (AUTO.md beside this file). The networks, and torch with them, are loaded only where a
policy's plans are among the starts.
"""

from __future__ import annotations

from app.domain.errors import NoCompatibleSource
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.learning.universal.episodes.effort import roll_out_work
from app.simulation.arrays import Integers, ProblemArrays, compile_problem
from app.simulation.evaluation import rewards_of
from app.simulation.visit import ALLOWED
from app.solvers.local_search.annealing import Search, actions_of, new_search, set_routes
from app.solvers.local_search.solver import how_long, search_on, watching
from app.solvers.parameters import AutoParameters
from app.solvers.protocol import (
    History,
    Progress,
    Report,
    Solution,
    SolverContext,
    SourcePolicy,
    StopCriterion,
)
from app.solvers.start import begin_search
from app.solvers.stop import share_of_time

_WORK_A_SECOND = 2e7
"""Of :func:`~app.learning.universal.episodes.effort.roll_out_work`, one core; a guess, the deadline holds."""

_POLICY_SHARE = 0.03
"""Of the time limit, at most, that goes to the policy's roll-outs."""

_LEAST_S = 3.0
"""Time limit below which no policy is loaded: the search reaches what it flies in tens of milliseconds."""

_MOST_WORK = 6e7
"""Work of a roll-out beyond which the search gets the time: there a second of moves brings more."""

_STARTS_SHARE = 0.1
"""Of the progress, for the starts."""


class Auto:
    """A :class:`~app.solvers.protocol.Solver`; epoch 0 of its history is the best start.

    Parameters
    ----------
    parameters
        What a request may fix instead of leaving it to the algorithm.
    context
        Its library is where policies are looked for; without one there are fewer starts.
    """

    def __init__(self, parameters: AutoParameters, context: SolverContext) -> None:
        self._parameters = parameters
        self._context = context

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`."""
        arrays = compile_problem(problem)
        given = self._parameters
        search, history = new_search(arrays), History()
        begin_search(search, problem, stop)
        moves, restarts = how_long(search, given.moves, given.restarts, stop)
        policy = policy_pays(arrays, stop.seconds_left()) if given.policy is None else given.policy
        source = None
        if policy and self._context.library_url and not stop():
            reward = float(search.best[0])
            report(Progress(0.0, 0, reward, Plan.of(actions_of(search), problem.n_targets)))
            found = self._policy_starts(problem, arrays, seed, share_of_time(stop, _POLICY_SHARE))
            if found is not None:
                plans, source = found
                _start_from_best(search, plans)
        history.add(0, float(search.best[0]))
        watch = watching(search, history, report, _STARTS_SHARE)
        search_on(search, seed, self._context, moves, restarts + 1, stop, watch)
        used = given.model_copy(update={"moves": moves, "restarts": restarts, "policy": policy})
        return Solution(Plan.of(actions_of(search), problem.n_targets), history, used, source)

    def _policy_starts(
        self, problem: Problem, arrays: ProblemArrays, seed: int, stop: StopCriterion
    ) -> tuple[Integers, SourcePolicy] | None:
        """Roll the nearest policy of the library out; None where there is none for every size."""
        from app.learning.universal.request.starts import policy_starts  # noqa: PLC0415 - loads torch

        try:
            return policy_starts(problem, arrays, self._context.library_url, seed, stop)
        except NoCompatibleSource:
            return None


def policy_pays(arrays: ProblemArrays, left: float) -> bool:
    """Whether the policy's plans are worth their time: by size and the seconds left."""
    work = roll_out_work(arrays)
    if work > _MOST_WORK:
        return False
    return left >= _LEAST_S and work / _WORK_A_SECOND <= _POLICY_SHARE * left


def _start_from_best(search: Search, plans: Integers) -> None:
    """Begin from the best of legal plans (B, S, M) if it is better than what the search has."""
    replay = rewards_of(search.arrays, plans)
    legal = [b for b in range(len(plans)) if replay.rule[b] == ALLOWED]
    if legal:
        best = max(legal, key=lambda b: float(replay.reward[b]))
        if replay.reward[best] > search.best[0]:
            set_routes(search, plans[best])
