"""Bounds against the best there is: by brute force, under both unloading rules, whenever they are stopped."""

from dataclasses import replace

import highspy
import numpy as np
import pytest
from brute_force import best_reward
from brute_force_unloading import best_planned_reward
from cases import problem_of
from problems import random_problem
from stopping import After

from app.domain.problem import Objective, Problem, Target
from app.domain.records import problem_to_record
from app.simulation.evaluation import reward_of
from app.simulation.generator import FAMILIES, generate
from app.solvers.bound.instance import new_instance
from app.solvers.bound.upper_bound import gap, upper_bound
from app.solvers.bound.visits import visit_bound
from app.solvers.greedy import greedy_plan
from app.solvers.stop import never


def small_problems(seed, count):
    """Random problems with every option, small enough for brute force."""
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        problem = random_problem(rng, max_uavs=3, max_targets=3)
        if (problem.n_targets + 1) ** (problem.n_uavs * problem.max_steps) <= 4**6:
            found.append(problem)
    return found


@pytest.mark.parametrize("seed", range(4))
def test_no_plan_with_greedy_unloading_earns_more(seed):
    for problem in small_problems(seed, 15):
        best = best_reward(problem_to_record(problem))
        for given in (None, reward_of(problem, greedy_plan(problem))):
            for looks in (0, 2, 10**9):
                bound = upper_bound(problem, given, After(looks))
                assert bound.value >= best - 1e-12 * abs(best)


@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_best_that_planned_unloading_reaches(seed):
    for problem in small_problems(100 + seed, 8):
        best = best_planned_reward(problem_to_record(problem))
        bound = upper_bound(problem, None, never)
        assert bound.tight
        assert bound.value >= best - 1e-12 * abs(best)
        assert bound.value == pytest.approx(best, abs=1e-6, rel=1e-6)


def test_another_user_of_the_solver_in_the_process_does_not_loosen_it():
    # HiGHS has one set of threads a process; whoever runs first decides how many, and others got an error.
    problem = generate("uniform", 3, 3, 2, np.random.default_rng(5))
    alone = upper_bound(problem, None, never)
    highspy.Highs.resetGlobalScheduler(True)
    other = highspy.Highs()
    other.setOptionValue("output_flag", False)
    other.setOptionValue("threads", 2)
    other.addVar(0.0, 1.0)
    other.run()
    after = upper_bound(problem, None, never)
    assert after == alone
    assert after.tight


def test_the_bound_for_large_problems_holds_for_small_ones():
    for problem in small_problems(7, 40):
        instance = new_instance(problem)
        exact = upper_bound(problem, None, never).value
        lower = reward_of(problem, greedy_plan(problem)) / instance.scale
        for looks in (0, 1, 5, 10**9):
            assert visit_bound(instance, lower, After(looks)) * instance.scale >= exact - 1e-7 * abs(exact)


@pytest.mark.parametrize("family", FAMILIES)
def test_it_falls_for_as_long_as_it_is_let_and_never_below_the_reward(family):
    problem = generate(family, 5, 6, 3, np.random.default_rng(3))
    reward = reward_of(problem, greedy_plan(problem))
    values = [upper_bound(problem, reward, After(looks)).value for looks in (0, 3, 10, 100, 10**9)]
    assert values[-1] >= reward
    assert values == sorted(values, reverse=True)


def test_large_problems_have_a_bound_too():
    problem = generate("uniform", 40, 80, 3, np.random.default_rng(3))
    reward = reward_of(problem, greedy_plan(problem))
    total = sum(target.level for target in problem.targets)
    assert reward <= upper_bound(problem, reward, never).value < total


def test_units_do_not_matter():
    problem = generate("uniform", 3, 4, 2, np.random.default_rng(5))
    bound = upper_bound(problem, None, never).value
    for factor in (1e-9, 1e9):
        targets = tuple(
            Target(t.id, t.x, t.y, t.level * factor, tuple(a / factor for a in t.loadlist))
            for t in problem.targets
        )
        uavs = tuple(
            type(u)(
                u.id, u.x_s, u.y_s, u.x_c, u.y_c, u.speed, u.voyage, tuple(a / factor for a in u.loadlist)
            )
            for u in problem.uavs
        )
        other = Problem(uavs, targets, problem.max_steps, objective=Objective(distance_weight=factor))
        assert upper_bound(other, None, never).value == pytest.approx(bound * factor, rel=1e-6)


def test_where_nothing_can_be_done_the_bound_is_what_staying_at_home_earns():
    problem = generate("mid_mission", 3, 3, 2, np.random.default_rng(1))
    uavs = tuple(replace(uav, voyage=0.0, ret=False) for uav in problem.uavs)
    for charged in (False, True):
        stuck = Problem(uavs, problem.targets, objective=Objective(1.0, charge_return=charged))
        reward = reward_of(stuck, greedy_plan(stuck))
        bound = upper_bound(stuck, reward, never)
        assert bound.value == pytest.approx(reward, abs=1e-7)
        assert bound.tight


@pytest.mark.parametrize(
    ("bound", "reward", "expected"), [(4.0, 3.0, 0.25), (4.0, 4.0, 0.0), (0.0, 0.0, None), (-1.0, -2.0, None)]
)
def test_gap(bound, reward, expected):
    assert gap(bound, reward) == expected


def test_a_bound_of_nothing_is_nothing():
    """Not the margin for rounding errors, of which the gap would be the whole."""
    bound = upper_bound(problem_of("F4a-gap-one-all-returned"), 0.0, never)
    assert bound == (0.0, True)
    assert gap(bound.value, 0.0) is None
    for m, n in ((4, 5), (40, 70)):
        # Every visit costs more than it earns.
        problem = generate("uniform", m, n, 3, np.random.default_rng(1))
        problem = replace(problem, objective=Objective(distance_weight=1e6))
        assert upper_bound(problem, 0.0, never).value == 0.0


def test_it_can_be_stopped_anywhere():
    problem = generate("uniform", 4, 9, 3, np.random.default_rng(4))
    best = upper_bound(problem, None, never).value
    bounds = [upper_bound(problem, None, After(looks)).value for looks in (0, 1, 4, 8, 12, 20, 40, 80, 10**6)]
    assert all(bound >= best for bound in bounds)
    assert bounds[-1] == best
    assert max(bounds) > best
