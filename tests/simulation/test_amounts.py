"""What is left by rounding is no need, no load and no reason to fly; answers print clean sums."""

from dataclasses import replace

import numpy as np
import pytest
from cases import problem_of
from problems import random_problem
from referee import Illegal, replay

from app.domain.errors import IllegalPlan
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record
from app.simulation import visit
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of, rewards_of
from app.simulation.explain import explain
from app.solvers.greedy import greedy_plan
from app.solvers.local_search.annealing import new_search, set_routes
from app.solvers.local_search.routes import DISTANCE, SATISFACTION, USELESS
from app.solvers.unloading.solver import without_useless


def delivered(answer):
    return [[stop.delivered for stop in route.stops] for route in answer.routes]


def test_ten_tenths_meet_a_need_of_one():
    problem = problem_of("F3a-ten-tenths")
    answer = explain(problem, greedy_plan(problem))
    assert answer.unmet == ()
    assert delivered(answer) == [[(0.1,)]] * 10
    assert answer.satisfaction == pytest.approx(5.0, rel=1e-12)


def test_three_tenths_are_one_and_two_tenths():
    problem = problem_of("F3c-crumb-two-areas")
    answer = explain(problem, Plan(((0,), (1,))))
    assert delivered(answer) == [[(0.1,), (0.2,)]]
    assert [unmet.target_id for unmet in answer.unmet] == ["far"]
    assert answer.unmet[0].remaining == (5.0,)
    # Nothing is left for the area far away, though 0.3 - 0.1 - 0.2 is not 0 in floating point.
    with pytest.raises(IllegalPlan, match="unload nothing"):
        explain(problem, Plan(((1,), (0,), (2,))))
    assert len(greedy_plan(problem).assignment) <= 2


@pytest.mark.parametrize("unloading", ["greedy", "planned"])
@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9, 1 / 3])
def test_fractions_add_up_under_both_rules(unloading, scale):
    amounts = (0.1, 0.2, 0.7)
    uavs = tuple(UAV(f"u{a}", 0, 0, 0, 0, 1.0, 9.0, (a * scale,)) for a in amounts)
    targets = (Target("a", 1, 0, 2.0, (0.3 * scale,)), Target("b", 2, 0, 1.0, (0.7 * scale,)))
    problem = Problem(uavs, targets, objective=Objective(0.0, unloading=unloading))
    answer = explain(problem, Plan(((0, 0, 1),)))
    assert answer.unmet == ()
    assert answer.reward == pytest.approx(3.0, rel=1e-9)
    for target in targets:
        brought = sum(
            stop.delivered[0]
            for route in answer.routes
            for stop in route.stops
            if stop.target_id == target.id
        )
        assert brought == pytest.approx(target.loadlist[0], rel=1e-12)


def test_a_small_amount_that_is_a_whole_is_no_rounding():
    problem = Problem(
        (UAV("u", 0, 0, 0, 0, 1.0, 9.0, (1e9, 1e-9)),),
        (Target("a", 1, 0, 1.0, (0.0, 1e-9)), Target("b", 1, 0, 1.0, (1e9, 0.0))),
        objective=Objective(0.0),
    )
    answer = explain(problem, Plan(((0,), (1,))))
    assert delivered(answer) == [[(0.0, 1e-9), (1e9, 0.0)]]
    assert answer.reward == 2.0


def test_a_remainder_just_above_the_limit_counts_and_one_below_does_not():
    for left, counts in ((1.1e-9, True), (0.9e-9, False)):
        problem = Problem(
            (UAV("u", 0, 0, 0, 0, 1.0, 9.0, (1.0 - left,)), UAV("v", 0, 0, 0, 0, 1.0, 9.0, (1.0,))),
            (Target("a", 1, 0, 1.0, (1.0,)),),
            objective=Objective(0.0),
        )
        plan = np.array([[[0, 0]]])
        assert (rewards_of(compile_problem(problem), plan).rule[0] == visit.ALLOWED) == counts
        try:
            replay(problem_to_record(problem), plan[0].tolist())
            agreed = True
        except Illegal:
            agreed = False
        assert agreed == counts


def crumbly(rng):
    """A random problem whose amounts are decimal fractions that fit into each other."""
    problem = random_problem(rng, 5, 6)
    tenths = lambda low, high: tuple(  # noqa: E731 - short
        float(each) / 10 for each in rng.integers(low, high, problem.n_materials)
    )
    return replace(
        problem,
        uavs=tuple(replace(u, voyage=1e6, ret=False, loadlist=tenths(0, 8)) for u in problem.uavs),
        targets=tuple(replace(t, loadlist=tenths(0, 8), deadline=None) for t in problem.targets),
    )


def test_the_incremental_evaluation_and_the_referee_see_the_same_remainders():
    rng = np.random.default_rng(2)
    useless = 0
    for _ in range(150):
        problem = crumbly(rng)
        arrays, record = compile_problem(problem), problem_to_record(problem)
        actions = rng.integers(0, problem.n_targets, (problem.max_steps, problem.n_uavs))
        search = new_search(arrays)
        set_routes(search, actions)
        total = search.routes.total
        if total[USELESS] > 0:
            useless += 1
            with pytest.raises(Illegal, match="useless"):
                replay(record, actions.tolist())
            continue
        expected = replay(record, actions.tolist())
        weight = problem.distance_weight
        assert total[SATISFACTION] - weight * total[DISTANCE] == pytest.approx(expected["reward"], abs=1e-9)
        assert reward_of(problem, Plan.of(actions, problem.n_targets)) == pytest.approx(
            expected["reward"], abs=1e-9
        )
    assert 20 < useless < 130


@pytest.mark.parametrize("unloading", ["greedy", "planned"])
def test_printed_amounts_are_short_and_add_up(unloading):
    rng = np.random.default_rng(9)
    for _ in range(100):
        problem = crumbly(rng)
        plan = greedy_plan(problem)
        problem = replace(problem, objective=replace(problem.objective, unloading=unloading))
        useful = without_useless(compile_problem(problem), plan.as_array())
        answer = explain(problem, plan if unloading == "greedy" else Plan.of(useful, problem.n_targets))
        left = {unmet.target_id: np.array(unmet.remaining) for unmet in answer.unmet}
        stops = [stop for route in answer.routes for stop in route.stops]
        for amounts in (*(stop.delivered for stop in stops), *left.values()):
            assert all(amount == round(amount, 1) for amount in amounts)
        for target in problem.targets:
            brought = sum(
                (np.array(stop.delivered) for stop in stops if stop.target_id == target.id),
                start=np.zeros(problem.n_materials),
            )
            rest = left.get(target.id, np.zeros(problem.n_materials))
            np.testing.assert_allclose(brought + rest, target.loadlist, rtol=1e-12, atol=0)


def test_amounts_of_many_digits_are_printed_as_they_are():
    amount = 0.12345678901234567
    problem = Problem(
        (UAV("u", 0, 0, 0, 0, 1.0, 9.0, (amount,)),),
        (Target("a", 1, 0, 1.0, (1.0,)),),
        objective=Objective(0.0),
    )
    answer = explain(problem, Plan(((0,),)))
    assert delivered(answer) == [[(amount,)]]
    assert answer.unmet[0].remaining == (1.0 - amount,)
