"""Routes of several plans put together: better plans, out of nothing but those routes."""

import numpy as np
import pytest
from referee import replay
from stopping import at_once
from worlds import some_with_bases

from app.domain.records import problem_to_record
from app.learning.pairwise.rollout import play
from app.learning.universal.episodes.best_plan import BestPlan
from app.learning.universal.request import recombination
from app.learning.universal.request.recombination import Recombination
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import rewards_of
from app.simulation.generator import FAMILIES, generate
from app.solvers.stop import never


def episodes(policy, arrays, count, seed):
    return play(policy.agent, arrays, np.zeros(count, np.int64), np.random.default_rng(seed)).plans


def visits(plan, uav, home):
    return [int(j) for j in plan[:, uav] if j != home]


def is_part_of(route, other):
    """Whether a route is another one with some visits left out."""
    following = iter(other)
    return all(visit in following for visit in route)


@pytest.mark.parametrize("family", FAMILIES)
def test_no_single_route_of_the_plans_would_earn_more(policy, family):
    problem = generate(family, 4, 7, 3, np.random.default_rng([61, *family.encode()]))
    arrays, record = compile_problem(problem), problem_to_record(problem)
    plans = episodes(policy, arrays, 12, 1)
    best = BestPlan(arrays)
    Recombination(arrays, best).consider(plans, never)
    assert replay(record, best.actions.tolist())["reward"] == pytest.approx(best.reward)
    for uav in range(4):
        route = visits(best.actions, uav, 7)
        assert any(is_part_of(route, visits(plan, uav, 7)) for plan in plans)
        others = np.repeat(best.actions[None], len(plans), axis=0)
        others[:, :, uav] = plans[:, :, uav]
        replayed = rewards_of(arrays, others)
        assert (replayed.reward[replayed.rule == 0] <= best.reward + 1e-9).all()


def test_it_earns_more_than_the_best_of_the_plans(policy):
    gained = []
    for number in range(8):
        problem = generate("uniform", 5, 9, 3, np.random.default_rng([62, number]))
        arrays = compile_problem(problem)
        plans, single, together = episodes(policy, arrays, 16, 2), BestPlan(arrays), BestPlan(arrays)
        single.consider(plans)
        Recombination(arrays, together).consider(plans, never)
        gained.append(together.reward - single.reward)
    assert min(gained) >= 0.0
    assert np.mean(gained) > 0.05


def test_routes_with_reloads_are_put_together_too(policy):
    gained = []
    for problem in some_with_bases(12):
        arrays, record = compile_problem(problem), problem_to_record(problem)
        plans, single, together = episodes(policy, arrays, 12, 2), BestPlan(arrays), BestPlan(arrays)
        single.consider(plans)
        Recombination(arrays, together).consider(plans, never)
        assert replay(record, together.actions.tolist())["reward"] == pytest.approx(together.reward)
        gained.append(together.reward - single.reward)
    assert min(gained) >= 0.0
    assert np.count_nonzero(gained) > 4


def test_routes_of_earlier_plans_are_used(policy):
    gained = 0.0
    for number in range(8):
        problem = generate("uniform", 5, 9, 3, np.random.default_rng([63, number]))
        arrays = compile_problem(problem)
        earlier, later = episodes(policy, arrays, 16, 3), episodes(policy, arrays, 1, 4)
        alone, after = BestPlan(arrays), BestPlan(arrays)
        Recombination(arrays, alone).consider(later, never)
        both = Recombination(arrays, after)
        both.consider(earlier, at_once())
        both.consider(later, never)
        gained += after.reward - alone.reward
    assert gained > 0.05


def test_once_time_is_up_or_the_problem_is_too_large_the_best_plan_is_taken_as_it_is(policy, monkeypatch):
    problem = generate("uniform", 5, 9, 3, np.random.default_rng(64))
    arrays = compile_problem(problem)
    plans, single = episodes(policy, arrays, 16, 5), BestPlan(arrays)
    single.consider(plans)
    stopped, large = BestPlan(arrays), BestPlan(arrays)
    Recombination(arrays, stopped).consider(plans, at_once())
    monkeypatch.setattr(recombination, "_WORK", 1.0)
    Recombination(arrays, large).consider(plans, never)
    for best in (stopped, large):
        assert best.reward == single.reward
        assert np.array_equal(best.actions, single.actions)


def test_plans_that_are_not_allowed_are_left_out(policy):
    problem = generate("uniform", 3, 5, 2, np.random.default_rng(65))
    arrays = compile_problem(problem)
    plans = episodes(policy, arrays, 3, 6)
    broken = plans.copy()
    broken[:, -1, 0] = 0
    broken[:, :-1, 0] = 5
    assert (rewards_of(arrays, broken).rule != 0).all()
    best = BestPlan(arrays)
    Recombination(arrays, best).consider(broken, never)
    assert best.reward == 0.0
    assert (best.actions == 5).all()
