"""A sequential auction by brute force, for tests: no messages, no consensus, routes flown by the referee.

Round by round every UAV names the area that adds most to its route, at whatever place of it, and bids that
much, but never more than it bid before; the highest bid wins the area for good.
"""

import numpy as np
from referee import Illegal, replay

from app.domain.plan import Plan
from app.domain.records import problem_to_record


def sequential_auction(problem):
    """Return for each UAV the set of areas that it wins, each area once, and its route."""
    record = problem_to_record(problem)
    m, n, steps = problem.n_uavs, problem.n_targets, problem.max_steps
    routes = [[] for _ in range(m)]
    most = [np.inf] * m
    known = {}

    def worth(i, route):
        key = i, tuple(route)
        if key not in known:
            known[key] = _alone(record, m, n, i, route)
        return known[key]

    open_areas = set(range(n))
    while True:
        best = None
        for i, route in enumerate(routes):
            if len(route) == steps:
                continue
            gains = [
                (worth(i, [*route[:place], j, *route[place:]]) - worth(i, route), -j, -place)
                for j in open_areas
                for place in range(len(route) + 1)
            ]
            if not gains:
                continue
            gain, area, place = max(gains)
            offer = min(gain, most[i])
            if offer > 0 and (best is None or offer > best[0]):
                best = offer, i, -area, -place
        if best is None:
            return [set(route) for route in routes], routes
        offer, i, j, place = best
        routes[i].insert(place, j)
        most[i] = offer
        open_areas.remove(j)


def _alone(record, m, n, i, route):
    plan = [[n] * m for _ in route] or [[n] * m]
    for s, j in enumerate(route):
        plan[s][i] = j
    try:
        return replay(record, plan)["reward"]
    except Illegal:
        return -np.inf


def best_reward(problem):
    """Return what the best plan earns in which every area is visited once at most, by dynamic programming.

    Routes earn what they earn alone, so this is the optimum where needs are not shared.
    """
    record = problem_to_record(problem)
    m, n, steps = problem.n_uavs, problem.n_targets, problem.max_steps
    best = {0: 0.0}
    for i in range(m):
        alone = {0: 0.0}
        frontier = [()]
        for _ in range(min(steps, n)):
            frontier = [(*route, j) for route in frontier for j in range(n) if j not in route]
            frontier = [route for route in frontier if _alone(record, m, n, i, route) > -np.inf]
            for route in frontier:
                areas = sum(1 << j for j in route)
                alone[areas] = max(alone.get(areas, -np.inf), _alone(record, m, n, i, route))
        joined = {}
        for taken, earned in best.items():
            for areas, more in alone.items():
                if not taken & areas:
                    both = taken | areas
                    joined[both] = max(joined.get(both, -np.inf), earned + more)
        best = joined
    return max(best.values())


def plan_of(problem, routes):
    """Return the plan of routes."""
    rows = [[problem.n_targets] * problem.n_uavs for _ in range(max(1, *map(len, routes)))]
    for i, route in enumerate(routes):
        for s, j in enumerate(route):
            rows[s][i] = j
    return Plan(tuple(map(tuple, rows)))
