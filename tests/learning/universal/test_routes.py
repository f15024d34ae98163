"""Routes flown without one UAV, and that one after all others."""

import numpy as np
import pytest
from referee import replay
from worlds import some_with_bases

from app.domain.records import problem_to_record
from app.learning.pairwise.rollout import play as play_new
from app.learning.universal.episodes.rollout import play
from app.learning.universal.episodes.routes import NOBODY, fly_last, fly_routes
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
            together = fly_routes(arrays, episodes, routes, place, flown, NOBODY)
            assert together == pytest.approx(replay(record, flown.tolist())["reward"])
            if not set(held[held < 9]) & set(route[route < 9]):
                # Nobody else goes there, so when it does makes no difference.
                assert others + added == pytest.approx(together)
                alone += 1
    assert alone > 0


def test_reloads_of_a_route_are_flown_and_nothing_changes(policy):
    reloads, skipped = 0, 0
    for problem in some_with_bases(12):
        arrays, record = compile_problem(problem), problem_to_record(problem)
        m, home = problem.n_uavs, problem.n_targets
        plans = play_new(policy.agent, arrays, np.zeros(6, np.int64), np.random.default_rng(1)).plans
        episodes, place = new_episodes(arrays, 2), np.empty(m, np.int64)
        loads, needs = np.empty(arrays.shape[2]), np.empty((plans.shape[1], arrays.shape[2]))
        for plan, other in zip(plans, np.roll(plans, 1, axis=0), strict=True):
            for i in range(m):
                held = np.full_like(plan, home)
                fly_routes(arrays, episodes, np.ascontiguousarray(plan.T), place, held, i)
                route = np.ascontiguousarray(other[:, i])
                kept = [column[0].copy() for column in episodes]
                fly_last(arrays, episodes, i, route, loads, needs)
                now = [column[0] for column in episodes]
                assert all(np.array_equal(*pair) for pair in zip(kept, now, strict=True))
                routes, flown = np.ascontiguousarray(held.T), np.empty_like(plan)
                routes[i] = route
                together = fly_routes(arrays, episodes, routes, place, flown, NOBODY)
                assert together == pytest.approx(replay(record, flown.tolist())["reward"])
                reloads += int((flown > home).sum())
                skipped += int((routes > home).sum() - (flown > home).sum())
    assert reloads > 100
    assert skipped > 0
