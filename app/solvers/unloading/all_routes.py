"""Every plan of a tiny problem with reloads whose amounts are planned: what the best one is.

Which routes a UAV can fly does not depend on amounts, so they are listed for each UAV alone. What a plan
earns follows from its routes together; no plan earns more than its routes earn apart from each other, nor
more at a target than is needed there, and its makespan is not below the end of any route. Plans that could be
better by that are evaluated, the most promising first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.domain.plan import Actions
from app.simulation.arrays import Floats, ProblemArrays
from app.simulation.evaluation import replay_at_best
from app.simulation.planned_amounts import best_amounts
from app.simulation.visit import ALLOWED
from app.simulation.worth import closing_cost, satisfaction_of
from app.solvers.local_search.annealing import ROUNDING
from app.solvers.local_search.routes import changes_in, charged_distance, lay
from app.solvers.protocol import StopCriterion

_MOST_ROUTES = 3_000
"""Routes of a UAV; with more of them the plans are not listed."""

_MOST_PLANS = 2_000
"""Plans that are evaluated at most, each in some milliseconds, where there is no time limit."""


class _Routes(NamedTuple):
    """What each of R routes of a UAV would do if it were alone.

    Attributes
    ----------
    stops
        R tuples of actions.
    cost
        (R,) reward that its distance, and what it leaves out of ``start_plan``, cost.
    end
        (R,) when its last stop ends; 0 without one.
    alone
        (R,) satisfaction.
    most
        (R, N) satisfaction at each target at most.
    """

    stops: list[tuple[int, ...]]
    cost: Floats
    end: Floats
    alone: Floats
    most: Floats


class AllRoutes:
    """All plans of the first problem of a stack.

    Parameters
    ----------
    arrays
        The stack; amounts are planned, and the best ones are found exactly.
    actions, reward
        (S, M) a plan that is known, and what it earns.

    Attributes
    ----------
    complete
        Whether no plan is better.
    """

    def __init__(self, arrays: ProblemArrays, actions: Actions, reward: float) -> None:
        self.complete = False
        self.actions, self.reward = actions, reward
        self._arrays, self._evaluated = arrays, 0
        self._needed = np.where(arrays.areas["need_total"][0] > 0.0, arrays.areas["level"][0], 0.0)

    def run(self, stop: StopCriterion) -> None:
        """Look at all plans, as far as there is time."""
        listed = []
        for i in range(self._arrays.shape[0]):
            routes = self._routes_of(i, stop)
            if routes is None:
                return
            listed.append(routes)
        # The longest list is worked through as one array.
        order = sorted(range(len(listed)), key=lambda i: len(listed[i].stops))
        self.complete = self._combine(order, listed, [], stop)

    def _routes_of(self, i: int, stop: StopCriterion) -> _Routes | None:
        """List what UAV `i` can fly; of routes whose flights have the same visits the shortest."""
        arrays = self._arrays
        n, steps = arrays.shape[1], int(arrays.max_steps[0])
        useful = [j for j in range(n) if arrays.need[0, j].any()]
        choices = [*useful, *range(n + 1, n + 1 + arrays.n_bases)]
        flown, clock, aloft = (np.zeros(steps + 1) for _ in range(3))
        clock[0], aloft[0] = arrays.uavs["ready"][0, i], arrays.uavs["airborne"][0, i]
        weight = float(arrays.terms["weight"][0])
        timed = bool(arrays.terms["makespan"][0])
        found: dict[object, tuple[float, float, tuple[int, ...]]] = {}
        ends: list[tuple[int, ...]] = [()]
        count = 0
        while ends:
            if stop() or count > _MOST_ROUTES:
                return None
            route = ends.pop()
            targets = np.array([*route, *[n] * (steps - len(route))], np.int64)
            if route and not lay(arrays, i, targets, len(route), 0, flown, clock, aloft):
                continue
            count += 1
            changes = float(changes_in(arrays, i, targets, len(route)))
            cost = weight * float(charged_distance(arrays, i, targets, len(route), flown))
            cost += float(closing_cost(arrays, 0, 0.0, changes))
            kind: object = route if timed else _flights(route, n)
            if kind not in found or cost < found[kind][0]:
                found[kind] = cost, float(clock[len(route)]) if route else 0.0, route
            if len(route) < steps and not arrays.ret[0, i]:
                ends += [(*route, j) for j in choices]
        stops = [route for _, _, route in found.values()]
        alone, most = np.zeros(len(stops)), np.zeros((len(stops), n))
        others = arrays._replace(
            stock=arrays.stock + np.delete(arrays.load[0], i, axis=0).sum(axis=0)[None, None, :]
        )
        for r, route in enumerate(stops):
            if stop():
                return None
            alone[r], most[r] = self._alone(others, i, route)
        cost_and_end = np.array([each[:2] for each in found.values()])
        return _Routes(stops, cost_and_end[:, 0], cost_and_end[:, 1], alone, most)

    def _alone(self, arrays: ProblemArrays, i: int, route: tuple[int, ...]) -> tuple[float, Floats]:
        """Return what a route earns at most if no other UAV flies: in all, and at each target."""
        m, n, _ = arrays.shape
        most = np.zeros(n)
        visited = [j for j in route if j < n]
        if not visited:
            return 0.0, most
        most[visited] = self._needed[visited]
        actions = np.full((len(route), m), n, np.int64)
        actions[:, i] = route
        delivered = best_amounts(arrays, actions).delivered
        met = np.zeros((n, delivered.shape[2]))
        np.add.at(met, np.array(route)[np.array(route) < n], delivered[np.array(route) < n, i])
        return satisfaction_of(arrays, met), most

    def _combine(
        self, order: list[int], listed: list[_Routes], chosen: list[int], stop: StopCriterion
    ) -> bool:
        """Choose routes for the UAVs one after the other; whether all plans were looked at."""
        at = len(chosen)
        routes = listed[order[at]]
        cost = sum(float(listed[order[q]].cost[r]) for q, r in enumerate(chosen))
        alone = sum(float(listed[order[q]].alone[r]) for q, r in enumerate(chosen))
        end = max((float(listed[order[q]].end[r]) for q, r in enumerate(chosen)), default=0.0)
        most = sum((listed[order[q]].most[r] for q, r in enumerate(chosen)), np.zeros(len(self._needed)))
        rest = [listed[i] for i in order[at + 1 :]]
        met = np.minimum(most + routes.most + sum(each.most.max(axis=0) for each in rest), self._needed)
        bound = np.minimum(alone + routes.alone + sum(each.alone.max() for each in rest), met.sum(axis=1))
        bound = bound - cost - routes.cost - sum(each.cost.min() for each in rest)
        # The last one lands no sooner than that.
        bound -= float(self._arrays.terms["makespan"][0]) * np.maximum(end, routes.end)
        for r in np.argsort(-bound, kind="stable").tolist():
            if bound[r] <= self.reward + 10 * ROUNDING * max(1.0, abs(self.reward)):
                break
            if stop() or self._evaluated >= _MOST_PLANS:
                return False
            if rest:
                if not self._combine(order, listed, [*chosen, r], stop):
                    return False
            else:
                self._evaluate(order, listed, [*chosen, r])
        return True

    def _evaluate(self, order: list[int], listed: list[_Routes], chosen: list[int]) -> None:
        m, n, _ = self._arrays.shape
        actions = np.full((int(self._arrays.max_steps[0]), m), n, np.int64)
        for i, r in zip(order, chosen, strict=True):
            route = listed[i].stops[r]
            actions[: len(route), i] = route
        self._evaluated += 1
        result, _ = replay_at_best(self._arrays, actions, True)
        if result.rule[0] == ALLOWED and result.reward[0] > self.reward:
            self.actions, self.reward = actions, float(result.reward[0])


def _flights(route: tuple[int, ...], n: int) -> tuple[object, ...]:
    """Return reloads in their order and, between them, visits in any order."""
    flights: list[object] = []
    visits: list[int] = []
    for j in route:
        if j > n:
            flights += [tuple(sorted(visits)), j]
            visits = []
        else:
            visits.append(j)
    return (*flights, tuple(sorted(visits)))
