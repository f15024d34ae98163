"""Routes flown without one UAV, and that one after all others."""

import numpy as np
import pytest
from referee import replay

from app.domain.records import problem_to_record
from app.learning.universal.episodes.rollout import play
from app.learning.universal.episodes.routes import fly_last, fly_routes
from app.simulation.arrays import compile_problem
from app.simulation.generator import FAMILIES, generate
from app.simulation.simulator import new_episodes


@pytest.mark.parametrize("family", FAMILIES)
def test_flying_last_adds_what_the_route_earns_and_changes_nothing(before, family):
    problem = generate(family, 5, 9, 3, np.random.default_rng([91, *family.encode()]))
    arrays, record = compile_problem(problem), problem_to_record(problem)
    plans = play(before.agent, arrays, np.zeros(8, np.int64), np.random.default_rng(1)).plans
    episodes, place = new_episodes(arrays, 1), np.empty(5, np.int64)
    steps, alone = plans.shape[1], 0
    loads, needs = np.empty(3), np.empty((steps, 3))
    for plan, other in zip(plans, np.roll(plans, 1, axis=0), strict=True):
        for i in range(5):
            held = np.full_like(plan, 9)
            others = fly_routes(arrays, episodes, np.ascontiguousarray(plan.T), place, held, i)
            assert (held[:, i] == 9).all()
            route = np.ascontiguousarray(other[:, i])
            kept = [column.copy() for column in episodes]
            added = fly_last(arrays, episodes, i, route, loads, needs)
            assert all(np.array_equal(*pair) for pair in zip(kept, episodes, strict=True))
            routes, flown = np.ascontiguousarray(held.T), np.empty_like(plan)
            routes[i] = route
            together = fly_routes(arrays, episodes, routes, place, flown)
            assert together == pytest.approx(replay(record, flown.tolist())["reward"])
            if not set(held[held < 9]) & set(route[route < 9]):
                # Nobody else goes there, so when it does makes no difference.
                assert others + added == pytest.approx(together)
                alone += 1
    assert alone > 0
