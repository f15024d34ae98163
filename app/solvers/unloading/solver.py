"""Planned unloading around any algorithm (section 3a of the rules, app/simulation/README.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from app.domain.plan import Actions, Plan
from app.domain.problem import Problem
from app.simulation.arrays import ProblemArrays, compile_problem
from app.simulation.evaluation import replay_at_best
from app.simulation.planned_amounts import amounts_are_exact, best_amounts, how_many
from app.simulation.visit import ALLOWED
from app.solvers.bound.enumeration import is_tiny
from app.solvers.floor import nothing_to_fly
from app.solvers.local_search.annealing import actions_of
from app.solvers.local_search.effort import large_moves
from app.solvers.local_search.temperatures import coldest_by_distance, gains, neighbour_leg
from app.solvers.protocol import (
    History,
    Progress,
    Proof,
    Report,
    Solution,
    Solver,
    SolverContext,
    StopCriterion,
)
from app.solvers.seeds import seed_sequence
from app.solvers.stop import a_thread_each, share_of_time
from app.solvers.unloading.all_routes import AllRoutes
from app.solvers.unloading.annealing import (
    MOVES,
    WORK,
    PlannedSearch,
    anneal_planned,
    begin_from,
    new_planned_search,
)

_ALGORITHM_SHARE = 0.6
"""Share of the work, and of a time limit, that the algorithm itself has."""

_ALGORITHM_SHARE_LOADING = 0.3
"""The same where loading is planned: the algorithm knows but one mix of materials."""

_ALGORITHM_SHARE_TINY = 0.2
"""The same for a tiny problem with bases, whose plans are then all looked at."""

_MOVES_A_VISIT = 8_000
"""Moves for each visit there can be."""

_MOST_WORK = 60e6
"""Visits that a search looks at, at most: about a second. Of one thread."""

_LONGEST = 25
"""Times as many of both, at most, for which it goes on under a time limit."""

_MOST_AT_A_GLANCE = 1_000
"""Amounts of a plan up to which a linear program for them takes some milliseconds."""

_PIECE_WORK = 100e3
"""Visits looked at between two looks at the stop criterion: about 2 ms."""

_ROUNDS = 3
_HOT, _COLD = 0.03, 0.001
"""Temperatures of a round at its begin, in largest gains, and at its end, in common ones."""

_PATIENT_MOVES_A_VISIT = 1_000
"""With fewer moves for each visit there can be, a search begins colder: heat would only cost reward."""


class PlannedUnloading:
    """A :class:`~app.solvers.protocol.Solver` that lends planned unloading to another one.

    Where unloading is greedy it only passes the problem on. Where it is planned, the algorithm solves the
    problem under greedy unloading, so that what it learns stays what the library holds; every plan it reports
    is unloaded at best; and from the best of these a search with planned unloading goes on. No plan is worse
    under planned than under greedy unloading, so neither is the answer. Where loading is planned too, the
    algorithm refills UAVs with a mix of materials as the areas need them.

    Parameters
    ----------
    algorithm
        The other one.
    context
        Says how many threads may search.
    """

    def __init__(self, algorithm: Solver, context: SolverContext) -> None:
        self.algorithm = algorithm
        self._context = context

    def solve(self, problem: Problem, seed: int, stop: StopCriterion, report: Report) -> Solution:
        """See :class:`~app.solvers.protocol.Solver`.

        The history's epochs are the algorithm's, with its rewards, which are those of greedy unloading, and
        one more for every round of the search.
        """
        if not problem.plans_unloading or nothing_to_fly(problem):
            return self.algorithm.solve(problem, seed, stop, report)
        greedy = greedily(problem)
        incumbent = _Incumbent(problem)
        if problem.start_plan:
            incumbent.consider(Plan(problem.start_plan))

        tiny = bool(problem.bases) and is_tiny(incumbent.arrays) and amounts_are_exact(incumbent.arrays)
        share = _ALGORITHM_SHARE_LOADING if problem.plans_loading else _ALGORITHM_SHARE
        if tiny:
            share = _ALGORITHM_SHARE_TINY

        def told(progress: Progress) -> None:
            incumbent.glance_at(progress.incumbent)
            report(Progress(share * progress.fraction, progress.epoch, incumbent.reward, incumbent.plan))

        solution = self.algorithm.solve(greedy, seed, share_of_time(stop, share), told)
        incumbent.consider(solution.plan)
        history = History(list(solution.history.epoch), list(solution.history.reward))
        until = share_of_time(stop, 0.5) if tiny else stop
        _improve(incumbent, seed, a_thread_each(until, self._context), report, history, share)
        proof = None
        if tiny and not stop():
            plans = AllRoutes(incumbent.arrays, incumbent.plan.as_array(), incumbent.reward)
            plans.run(stop)
            incumbent.consider_actions(plans.actions)
            history.add(history.epoch[-1] + 1, incumbent.reward)
            proof = Proof(incumbent.reward, True) if plans.complete else None
        return replace(solution, plan=incumbent.plan, history=history, proof=proof)


class _Incumbent:
    """The best plan with planned unloading so far; before any, the one that leaves everybody at home."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.arrays = compile_problem(problem)
        self.plan = Plan.empty(problem.n_uavs, problem.n_targets)
        self.reward = _reward(self.arrays, self.plan.as_array())
        self._last: Plan | None = None

    def consider(self, plan: Plan) -> None:
        """Unload a plan at best, and keep it if it is better."""
        if plan is self._last:
            return
        self._last = plan
        self.consider_actions(plan.as_array())

    def glance_at(self, plan: Plan) -> None:
        """As :meth:`consider`, unless that takes long: of large plans the last one of a search is enough."""
        if how_many(self.arrays, plan.as_array()) <= _MOST_AT_A_GLANCE:
            self.consider(plan)

    def consider_actions(self, actions: Actions) -> None:
        """As :meth:`consider`, for (S, M) joint actions."""
        actions = without_useless(self.arrays, actions)
        reward = _reward(self.arrays, actions)
        if reward > self.reward:
            self.plan, self.reward = Plan.of(actions, self.problem.n_targets), reward


def greedily(problem: Problem) -> Problem:
    """Return the problem with greedy unloading; what was to be loaded as planned is refilled.

    Every flight then begins with the mix of materials that the areas need by weight, as far as any base has
    them.
    """
    objective = replace(problem.objective, unloading="greedy", loading="refill")
    if not problem.plans_loading:
        return replace(problem, objective=objective)
    weights = np.array(problem.weights)
    in_stock = [
        any(base.stock is None or base.stock[k] > 0.0 for base in problem.bases)
        for k in range(problem.n_materials)
    ]
    needed = np.array([target.need for target in problem.targets]).sum(axis=0) * in_stock
    heavy = float(weights @ needed)
    uavs = []
    for uav in problem.uavs:
        share = 1.0
        if uav.capacity is not None and heavy > uav.capacity:
            share = uav.capacity / heavy
        full = np.where(weights > 0.0, share * needed, needed)
        uavs.append(replace(uav, full_load=tuple(full.tolist()), capacity=None))
    return replace(problem, objective=objective, uavs=tuple(uavs))


def without_useless(arrays: ProblemArrays, actions: Actions) -> Actions:
    """Take the stops out of a plan that are of no use when everything is unloaded at best.

    These are visits that unload nothing, and reloads without a visit before the next one that leave nothing
    behind. Mostly the way without a stop is not longer and not later; the deliveries stay possible.
    """
    home = arrays.shape[1]
    while True:
        amounts = best_amounts(arrays, actions)
        useless = (actions < home) & ~(amounts.delivered > 0).any(axis=2)
        leaves = np.asarray((amounts.loaded < 0).any(axis=2))
        shorter = np.full_like(actions, home)
        for i in range(actions.shape[1]):
            kept = np.flatnonzero((actions[:, i] != home) & ~useless[:, i])
            route = actions[kept, i]
            idle = (route > home) & np.append(route[1:] > home, True) & ~leaves[kept, i]
            route = route[~idle]
            shorter[: len(route), i] = route
        if np.array_equal(shorter, actions):
            return actions
        actions = shorter


def _reward(arrays: ProblemArrays, actions: Actions) -> float:
    """Reward of a plan; minus infinity for one that is not legal."""
    result, _ = replay_at_best(arrays, actions, True)
    return float(result.reward[0]) if result.rule[0] == ALLOWED else -np.inf


class _Effort(NamedTuple):
    """What a search takes: moves, work, and time, whichever is over first.

    Attributes
    ----------
    moves, work
        Of one thread; see :class:`~app.solvers.unloading.annealing.PlannedSearch`.
    seconds
        That are left at its begin.
    """

    moves: float
    work: float
    seconds: float

    def done(self, planned: PlannedSearch, stop: StopCriterion) -> float:
        """Return how much of it is over."""
        limited = 0.0 < self.seconds < math.inf
        by_time = 1.0 - stop.seconds_left() / self.seconds if limited else 0.0
        return float(max(planned.tally[MOVES] / self.moves, planned.tally[WORK] / self.work, by_time))


class _Searcher:
    """One thread's search.

    Parameters
    ----------
    planned, rng, stop
        Its plan, its source of randomness, and what ends it.
    effort
        What it may take, in all rounds.
    """

    def __init__(
        self, planned: PlannedSearch, rng: np.random.Generator, stop: StopCriterion, effort: _Effort
    ) -> None:
        self.planned, self._rng, self._stop, self._effort = planned, rng, stop, effort
        arrays, search = planned.search.arrays, planned.search
        self._visits = arrays.shape[0] * int(arrays.max_steps[0])
        self._heat = 0.0
        largest, common = gains(arrays, search.routes)
        leg = neighbour_leg(arrays, search.near)
        self._hottest, self._coldest = _HOT * largest, coldest_by_distance(arrays, leg, _COLD * common)

    def go_through(self, number: int) -> None:
        """Anneal from the highest temperature to the lowest, in pieces of about 2 ms."""
        planned, length = self.planned, max(1, _MOVES_A_VISIT * self._visits // 200)
        step = length * _ROUNDS / (_MOVES_A_VISIT * self._visits)
        while not self._stop():
            share = self._effort.done(planned, self._stop) * _ROUNDS - number
            if share >= 1.0:
                break
            hot, cold = (self._temperature(at) for at in (max(share, 0.0), min(1.0, max(share, 0.0) + step)))
            large, _ = large_moves(planned.search.routes.length)
            anneal_planned(planned, self._rng, hot, cold, length, _PIECE_WORK, large)
            moves = planned.tally[MOVES] / max(self._effort.done(planned, self._stop), 1e-9)
            self._heat = min(1.0, moves / (_PATIENT_MOVES_A_VISIT * self._visits))

    def _temperature(self, share: float) -> float:
        """Return that of a share of a round; without heat it is always the lowest."""
        return self._coldest * (self._hottest / self._coldest) ** (self._heat * (1.0 - share))


def _improve(
    incumbent: _Incumbent,
    seed: int,
    stops: Sequence[StopCriterion],
    report: Report,
    history: History,
    begin: float,
) -> None:
    """Search on from the incumbent, a thread a stop criterion; after each round all go on from the best plan.

    Without time, not even what the search needs is made ready.
    """
    stop = stops[0]
    if stop():
        return
    arrays, actions = incumbent.arrays, incumbent.plan.as_array()
    first = new_planned_search(arrays, actions)
    near, epoch = first.search.near, history.epoch[-1] if history.epoch else 0
    limit = stop.seconds_left()
    longest = _LONGEST if limit < math.inf else 1
    moves = _MOVES_A_VISIT * arrays.shape[0] * int(arrays.max_steps[0])
    effort = _Effort(longest * moves, longest * _MOST_WORK, limit)
    own = seed_sequence(seed, 0, 1)
    searchers = [_Searcher(first, np.random.default_rng(own), stop, effort)]
    if not (len(near.active) and len(near.wanted)):
        stops, searchers = stops[:1], []
    for ends, stream in zip(stops[1:], own.spawn(len(stops) - 1), strict=True):
        planned = new_planned_search(arrays, actions)
        searchers.append(_Searcher(planned, np.random.default_rng(stream), ends, effort))
    known = float(first.search.best[0])
    with ThreadPoolExecutor(max(1, len(stops) - 1)) as threads:
        for number in range(_ROUNDS):
            others = [threads.submit(each.go_through, number) for each in searchers[1:]]
            for each in searchers[:1]:
                each.go_through(number)
            for other in others:
                other.result()
            best = max((each.planned for each in searchers), key=_best_of, default=first)
            # To unload a large plan at best takes a while, also when time is up.
            if best.search.best[0] > known:
                known = float(best.search.best[0])
                actions = actions_of(best.search)
                incumbent.consider_actions(actions)
            if len(searchers) > 1 and not stop():
                for each in searchers:
                    begin_from(each.planned, actions)
            history.add(epoch + number + 1, incumbent.reward)
            fraction = begin + (1 - begin) * (number + 1) / _ROUNDS
            report(Progress(min(fraction, 1.0), epoch + number + 1, incumbent.reward, incumbent.plan))


def _best_of(planned: PlannedSearch) -> float:
    return float(planned.search.best[0])
