"""Path relinking: plans between two plans, and searches that go on from them."""

import numpy as np
import pytest
from problems import random_problem
from referee import replay
from searches import Clock, assert_evaluated

from app.domain.records import problem_to_record
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.annealing import (
    Prices,
    actions_of,
    anneal,
    drop_useless,
    new_search,
    replica,
    set_routes,
    worth,
)
from app.solvers.local_search.improvement import _PARENTS, Cooling, improve
from app.solvers.local_search.relinking import LEAST_UAVS, Elite
from app.solvers.local_search.routes import USELESS
from app.solvers.stop import Deadline, never

USELESS_COSTS = 0.05


def route_of(search, i):
    return tuple(map(int, search.routes.target[i, : search.routes.length[i]]))


def routes_of(search):
    return [route_of(search, i) for i in range(len(search.routes.length))]


def annealed(search, seed, moves=400):
    """Another search of the same problem, with a legal plan of its own."""
    other = replica(search)
    anneal(other, np.random.default_rng(seed), moves, 0.5, 0.01, Prices(USELESS_COSTS))
    drop_useless(other)
    return other


def pairs(count):
    """Two plans each of random problems with every option, and of some with many UAVs."""
    rng, found = np.random.default_rng(41), []
    while len(found) < count:
        small = len(found) % 3
        problem = (
            random_problem(rng, max_uavs=9, max_targets=12) if small else generate("uniform", 8, 16, 2, rng)
        )
        search = new_search(compile_problem(problem))
        if len(search.near.active) < LEAST_UAVS or not len(search.near.wanted):
            continue
        set_routes(search, greedy_plan(problem).as_array())
        found.append((annealed(search, 1), annealed(search, 2)))
    return found


def test_a_plan_between_two_has_the_routes_of_both():
    between = 0
    for number, (one, other) in enumerate(pairs(60)):
        elite = Elite()
        elite.add(one)
        elite.add(other)
        plans = routes_of(one), routes_of(other)
        search = replica(one)
        before = float(search.best[0])
        relinked = elite.relink(search, np.random.default_rng(number), USELESS_COSTS, never)
        now = routes_of(search)
        assert_evaluated(search)
        assert search.best[0] >= before
        if not relinked:
            assert now in plans
            continue
        between += 1
        assert all(route in both for route, *both in zip(now, *plans, strict=True))
        for plan in plans:
            assert sum(route != theirs for route, theirs in zip(now, plan, strict=True)) >= 2
    assert between > 20


def test_of_one_plan_alone_nothing_lies_between():
    (one, _), *_ = pairs(1)
    elite = Elite()
    assert not elite.relink(one, np.random.default_rng(0), USELESS_COSTS, never)
    elite.add(one)
    elite.add(one)
    search = replica(one)
    assert not elite.relink(search, np.random.default_rng(0), USELESS_COSTS, never)
    assert routes_of(search) == routes_of(one)


def test_a_way_that_is_stopped_ends_at_one_of_the_two_plans():
    problem = generate("uniform", 60, 120, 2, np.random.default_rng(6))
    search = new_search(compile_problem(problem))
    set_routes(search, greedy_plan(problem).as_array())
    plans = [annealed(search, seed, moves=20_000) for seed in (1, 2)]
    elite, asked = Elite(), []
    for plan in plans:
        elite.add(plan)

    def stop():
        asked.append(True)
        return len(asked) > 1

    assert not elite.relink(search, np.random.default_rng(1), USELESS_COSTS, stop)
    assert len(asked) == 2
    assert routes_of(search) in [routes_of(plan) for plan in plans]
    assert elite.relink(search, np.random.default_rng(1), USELESS_COSTS, never)


def test_the_best_plans_are_kept_and_none_twice():
    problem = generate("uniform", 8, 16, 2, np.random.default_rng(5))
    search = new_search(compile_problem(problem))
    set_routes(search, greedy_plan(problem).as_array())
    elite, rewards = Elite(), set()
    for seed in range(30):
        found = annealed(search, seed, moves=50)
        assert found.routes.total[USELESS] == 0
        elite.add(found)
        rewards.add(round(worth(found, 0.0), 9))
    kept = sorted(round(reward, 9) for reward, _ in elite._plans)
    assert kept == sorted(rewards)[-len(kept) :]
    assert len(kept) == min(8, len(rewards)) > 4


@pytest.mark.parametrize("uavs", [LEAST_UAVS, 12])
def test_a_search_with_time_for_many_rounds_goes_on_from_plans_between(monkeypatch, uavs):
    problem = generate("deadline", uavs, 2 * uavs, 2, np.random.default_rng(8))
    search = new_search(compile_problem(problem))
    set_routes(search, greedy_plan(problem).as_array())
    clock, ended, shares, relinked = Clock(0.0002), [], [], []
    monkeypatch.setattr("app.solvers.local_search.improvement.time.monotonic", clock)
    relink = Elite.relink

    def note(*given):
        relinked.append(relink(*given))
        return relinked[-1]

    monkeypatch.setattr(Elite, "relink", note)

    def watch(share, rounds):
        shares.append(share)
        ended.append(rounds)

    improve(search, np.random.default_rng(1), 10**9, 4, Cooling(), Deadline(1.0, clock), watch)
    assert ended[-1] > 2 * _PARENTS
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert any(relinked)
    plan = [list(map(int, row)) for row in actions_of(search)]
    assert replay(problem_to_record(problem), plan)["reward"] == pytest.approx(
        float(search.best[0]), abs=1e-9
    )
