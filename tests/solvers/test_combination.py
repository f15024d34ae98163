"""Routes of a search, combined: what is collected, and the choice among them, against brute force."""

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from parcels import parcels
from referee import replay

from app.domain.plan import Plan
from app.domain.records import problem_to_record
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of
from app.simulation.generator import FAMILIES, generate
from app.solvers.column_generation.packing import Packing, next_reward, reachable
from app.solvers.column_generation.pool import collect, new_pool, often_whole, pour, thin
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.annealing import (
    Prices,
    actions_of,
    anneal,
    drop_useless,
    new_search,
    set_routes,
)
from app.solvers.local_search.combination import Combination
from app.solvers.local_search.improvement import Cooling, improve
from app.solvers.local_search.solver import LocalSearch
from app.solvers.parameters import LocalSearchParameters
from app.solvers.protocol import SolverContext
from app.solvers.stop import Deadline, never


def collected(problem, seed=1, moves=2000):
    """A search that has filled its pool."""
    arrays = compile_problem(problem)
    search = new_search(arrays)._replace(pool=new_pool(arrays))
    set_routes(search, greedy_plan(problem).as_array())
    anneal(search, np.random.default_rng(seed), moves, 3.0, 0.1, Prices(0.3), True)
    drop_useless(search)
    return search


def routes_of(pool):
    return [
        (int(pool.uav[q]), tuple(pool.target[q, : pool.length[q]].tolist()), float(pool.distance[q]))
        for q in range(int(pool.size[0]))
    ]


def put(arrays, pool, i, targets):
    """Offer a route to a pool."""
    flown, at = [0.0], None
    for j in targets:
        flown.append(
            flown[-1] + (arrays.start_target[0, i, j] if at is None else arrays.between[0, 0, at, j])
        )
        at = j
    collect(arrays, pool, i, np.array(targets), len(targets), np.array(flown) + arrays.uavs["dis"][0, i])


def test_only_whole_routes_are_collected():
    problem = parcels(np.random.default_rng(1))
    problem = replace(problem, uavs=tuple(replace(u, loadlist=(2.0,)) for u in problem.uavs))
    arrays = compile_problem(problem)
    pool = new_pool(arrays)
    put(arrays, pool, 0, [0, 1, 2])
    put(arrays, pool, 0, [3, 3])
    assert not routes_of(pool)
    put(arrays, pool, 0, [0, 1])
    assert [route[:2] for route in routes_of(pool)] == [(0, (0, 1))]


def test_of_the_orders_of_a_set_the_shortest_is_kept_for_each_kind():
    arrays = compile_problem(parcels(np.random.default_rng(2)))
    pool = new_pool(arrays)
    assert pool.kind.tolist() == [0, 1, 0]
    for targets in ([0, 1, 2], [1, 0, 2], [2, 1, 0], [0, 2, 1]):
        for i in range(3):
            put(arrays, pool, i, targets)
    kept = routes_of(pool)
    assert sorted(uav for uav, _, _ in kept) == [0, 1]
    legs = arrays.start_target[0, 0], arrays.between[0, 0]
    lengths = [
        legs[0][a] + legs[1][a, b] + legs[1][b, c] for a, b, c in ([0, 1, 2], [1, 0, 2], [2, 1, 0], [0, 2, 1])
    ]
    np.testing.assert_allclose([distance for _, _, distance in kept], min(lengths))


def test_a_full_pool_takes_no_more_and_routes_can_be_poured_and_dropped():
    arrays = compile_problem(parcels(np.random.default_rng(3)))
    small, large = new_pool(arrays, 2), new_pool(arrays)
    for targets in ([0], [1], [2]):
        put(arrays, small, 0, targets)
    assert [route[1] for route in routes_of(small)] == [(0,), (1,)]
    put(arrays, large, 0, [1])
    pour(small, large)
    assert not routes_of(small)
    assert [route[1] for route in routes_of(large)] == [(1,), (0,)]
    thin(large, np.array([False, True]))
    put(arrays, large, 2, [0])
    assert [route[1] for route in routes_of(large)] == [(0,)]


def test_problems_whose_targets_are_shared_are_left_alone():
    rng = np.random.default_rng(4)
    assert not any(
        often_whole(compile_problem(generate(family, 10, 20, 3, rng))) for family in sorted(FAMILIES)
    )
    assert often_whole(compile_problem(parcels(rng)))
    empty = parcels(rng)
    empty = replace(empty, uavs=tuple(replace(u, ret=True) for u in empty.uavs))
    assert not often_whole(compile_problem(empty))


@pytest.mark.parametrize(
    ("levels", "weight", "reward", "least"),
    [
        ((3, 6, 9), 0.0, 12.0, 15.0),
        ((3, 6, 9), 0.0, 12.5, 15.0),
        ((0.2, 0.6, 1.0), 0.0, 1.2, 1.4),
        ((3, 6, 9), 0.1, 12.0, 12.0),
        ((0.7316241, 0.2211, 1.0), 0.0, 1.2, 1.2),
    ],
)
def test_the_next_reward_follows_from_the_steps_of_the_levels(levels, weight, reward, least):
    problem = parcels(np.random.default_rng(5), n=3, weight=weight)
    targets = tuple(replace(t, level=float(x)) for t, x in zip(problem.targets, levels, strict=True))
    arrays = compile_problem(replace(problem, targets=targets))
    assert next_reward(arrays, reward) == pytest.approx(least, abs=1e-4)
    assert next_reward(arrays, reward) > reward
    assert reachable(arrays, next_reward(arrays, reward) + 1e-3) == pytest.approx(least, abs=1.1e-3)


def best_of_all_choices(arrays, pool):
    """Every choice of at most one route a UAV, and what it earns; and the most that each route is part of."""
    routes = routes_of(pool)
    weight, level = float(arrays.terms["weight"][0]), arrays.areas["level"][0]
    room = np.bincount(pool.kind)
    idle = weight * arrays.uavs["start_home"][0] * arrays.terms["charge_return"][0]
    best, with_route = -idle.sum(), np.full(len(routes), -np.inf)
    for count in range(1, arrays.shape[0] + 1):
        for chosen in combinations(range(len(routes)), count):
            kinds = np.bincount([pool.kind[routes[q][0]] for q in chosen], minlength=len(room))
            if (kinds > room).any():
                continue
            met = {j for q in chosen for j in routes[q][1]}
            cost = sum(weight * routes[q][2] - idle[routes[q][0]] for q in chosen)
            reward = sum(level[j] for j in met) - cost - idle.sum()
            best = max(best, reward)
            for q in chosen:
                with_route[q] = max(with_route[q], reward)
    return best, with_route


@pytest.mark.parametrize("seed", range(6))
def test_the_best_choice_is_that_of_brute_force(seed):
    rng = np.random.default_rng([6, seed])
    problem = parcels(rng, weight=(0.0, 1.5)[seed % 2], charge_return=seed % 3 == 0)
    search = collected(problem, seed)
    arrays, pool = search.arrays, search.pool
    if pool.size[0] > 40:
        thin(pool, rng.permutation(int(pool.size[0])) < 40)
    best, with_route = best_of_all_choices(arrays, pool)
    packing = Packing(arrays, pool)
    relaxed = packing.relax()
    assert relaxed.reward >= best - 1e-9
    assert (with_route <= relaxed.reward - relaxed.loss + 1e-6).all()
    nothing = -1000.0
    chosen = packing.choose(relaxed, nothing)
    other = new_search(arrays)
    set_routes(other, chosen)
    drop_useless(other)
    assert other.best[0] >= best - 1e-6
    assert packing.choose(relaxed, best + 1e-3) is None


@pytest.mark.parametrize(("weight", "charge_return"), [(0.0, False), (0.5, True)])
def test_without_routes_everybody_stays_and_everything_is_worth_its_level(weight, charge_return):
    problem = parcels(np.random.default_rng(7), weight=weight, charge_return=charge_return)
    arrays = compile_problem(problem)
    relaxed = Packing(arrays, new_pool(arrays)).relax()
    assert relaxed.reward == pytest.approx(float(new_search(arrays).best[0]))
    np.testing.assert_allclose(relaxed.price, arrays.areas["level"][0])


@pytest.mark.parametrize("weight", [0.0, 0.3])
def test_a_combined_plan_earns_what_is_said(weight):
    problem = parcels(np.random.default_rng(8), m=6, n=24, weight=weight)
    search = new_search(compile_problem(problem))
    set_routes(search, greedy_plan(problem).as_array())
    improve(search, np.random.default_rng(1), 20_000, 4, Cooling(), never, lambda *_: None)
    plan = actions_of(search)
    assert reward_of(problem, Plan.of(plan, 24)) == pytest.approx(float(search.best[0]), abs=1e-9)
    assert replay(problem_to_record(problem), plan.tolist())["reward"] == pytest.approx(float(search.best[0]))


def test_combining_finds_a_plan_that_no_search_had():
    problem = parcels(np.random.default_rng(9), m=6, n=40, latest=0.6)
    searches = [collected(problem, seed, moves=800) for seed in range(4)]
    before = max(float(search.best[0]) for search in searches)
    combination = Combination(searches, rounds=2, left=math.inf)
    for search, filled in zip(combination.searches, searches, strict=True):
        pour(filled.pool, search.pool)
    assert combination.after_round(2, 2, never) == 2
    after = float(searches[0].best[0])
    assert after > before
    assert replay(problem_to_record(problem), actions_of(searches[0]).tolist())["reward"] == after


def test_rounds_are_longer_where_plans_turn_out_to_have_many_visits():
    problem = parcels(np.random.default_rng(10), m=20, n=80)
    search = new_search(compile_problem(problem))
    combination = Combination([search], rounds=9, left=100.0)
    anneal(combination.searches[0], np.random.default_rng(1), 50_000, 3.0, 0.1, Prices(0.3), True)
    drop_useless(search)
    assert search.best_length.sum() > 60
    assert combination.after_round(1, 9, never) == 2
    assert combination.after_round(2, 2, never) == 2
    assert Combination([search], rounds=9, left=math.inf).after_round(1, 9, never) == 9


def test_the_same_seed_and_threads_give_the_same_combined_plan():
    problem = parcels(np.random.default_rng(11), m=6, n=24, weight=0.1)
    context = SolverContext(threads=2)
    parameters = LocalSearchParameters(moves=8000, restarts=3)
    first, again = (
        LocalSearch(parameters, context).solve(problem, 5, never, lambda _: None) for _ in range(2)
    )
    assert (first.plan, first.history) == (again.plan, again.history)


def test_little_time_is_left_to_the_search_alone():
    searches = [collected(parcels(np.random.default_rng(12)))]
    assert Combination(searches, rounds=5, left=0.05).seconds == 0.0
    assert Combination(searches, rounds=1, left=5.0).seconds == 0.0
    assert 0.0 < Combination(searches, rounds=5, left=1.0).seconds < 0.2
    assert Combination(searches, rounds=5, left=600.0).seconds == 1.0
    solution = LocalSearch(LocalSearchParameters(), SolverContext()).solve(
        parcels(np.random.default_rng(12), m=6, n=24), 1, Deadline(0.3), lambda _: None
    )
    assert max(solution.history.reward) > 0.0
