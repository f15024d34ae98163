"""The simulator against the independent referee, against rewards computed by hand, and its edges."""

import math
from dataclasses import replace

import numpy as np
import pytest
from problems import random_problem
from referee import Illegal
from referee import replay as slow_replay

from app.domain.errors import IllegalPlan
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record
from app.simulation import simulator, visit
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import reward_of, rewards_of
from app.simulation.explain import explain
from app.simulation.stacks import stack

RULES = {
    "returning": visit.RETURNING,
    "range": visit.OUT_OF_RANGE,
    "late": visit.TOO_LATE,
    "useless": visit.UNLOADS_NOTHING,
    "action": visit.NO_SUCH_ACTION,
    "steps": visit.TOO_MANY_STEPS,
}


def random_plan(problem, arrays, rng, legal):
    """A random plan; with `legal`, each action is drawn from the mask of its moment."""
    steps = int(rng.integers(1, problem.max_steps + 1))
    home = problem.n_targets
    plan = rng.integers(0, home + 1, (steps, problem.n_uavs))
    if not legal:
        return plan
    episodes = simulator.new_episodes(arrays, 1)
    mask = np.empty((1, problem.n_uavs, home + 1), np.bool_)
    for s in range(steps):
        for i in range(problem.n_uavs):
            simulator.allowed_actions(arrays, episodes, mask)
            choices = np.flatnonzero(mask[0, i])
            stay_out = len(choices) > 1 and rng.random() < 0.8
            plan[s, i] = rng.choice(choices[:-1] if stay_out else choices)
            simulator.act(arrays, episodes, 0, i, plan[s, i])
    return plan


def judged(record, plan):
    """The referee's figures and None, or None and the rule that is broken with its place."""
    try:
        return slow_replay(record, plan.tolist()), None
    except Illegal as error:
        return None, error.args


def test_agrees_with_the_referee_on_ten_thousand_plans():
    rng = np.random.default_rng(20220818)
    legal = illegal = 0
    for _ in range(250):
        problem = random_problem(rng)
        arrays, record = compile_problem(problem), problem_to_record(problem)
        for number in range(40):
            plan = random_plan(problem, arrays, rng, legal=number % 2 == 0)
            if number % 2 == 1 and rng.random() < 0.05:
                plan = np.resize(plan, (problem.max_steps + 1, problem.n_uavs))
            result = rewards_of(arrays, plan[None])
            expected, broken = judged(record, plan)
            if broken is None:
                legal += 1
                assert result.rule[0] == visit.ALLOWED
                assert result.reward[0] == pytest.approx(expected["reward"], abs=1e-9, rel=1e-9)
                assert result.satisfaction[0] == pytest.approx(expected["satisfaction"], abs=1e-9)
                assert result.distance[0] == pytest.approx(expected["distance"], abs=1e-9, rel=1e-9)
            else:
                illegal += 1
                step, uav, rule = broken
                assert result.rule[0] == RULES[rule]
                assert (result.step[0], result.uav[0]) == (step, uav)
    assert legal >= 5000
    assert illegal >= 3000


def triangle(**objective):
    """One UAV at the origin with 4 and 1 of two materials; areas at (3, 0) and (3, 4), λ = 0.1."""
    return Problem(
        uavs=(UAV("u", 0, 0, 0, 0, speed=2.0, voyage=12.0, loadlist=(4.0, 1.0)),),
        targets=(
            Target("a", 3, 0, level=2.0, loadlist=(3.0, 2.0), service_time=0.5),
            Target("b", 3, 4, level=5.0, loadlist=(4.0, 0.0), deadline=4.0),
        ),
        objective=Objective(**{"distance_weight": 0.1, **objective}),
    )


def test_reward_computed_by_hand():
    # a: 3 of 3 and 1 of 2 unloaded: 2 * 4/5 = 1.6 for 3 flown; b: the last 1 of 4: 5/4 for 4 more.
    assert reward_of(triangle(), Plan(((0,), (1,)))) == pytest.approx(1.6 + 1.25 - 0.1 * 7)
    # b first gets all 4 (5.0) for 5 flown; then a gets the 1 of material 2: 2 * 1/5 for 4 more.
    assert reward_of(triangle(), Plan(((1,), (0,)))) == pytest.approx(5.0 + 0.4 - 0.1 * 9)


def test_the_leg_home_costs_only_where_it_is_charged():
    there_and_back = Plan(((0,), (2,)))
    assert reward_of(triangle(), there_and_back) == pytest.approx(1.6 - 0.3)
    assert reward_of(triangle(charge_return=True), there_and_back) == pytest.approx(1.6 - 0.6)
    assert reward_of(triangle(charge_return=True), Plan(((0,),))) == pytest.approx(1.6 - 0.6)


def test_default_weight_is_one_over_the_extent():
    problem = triangle(distance_weight=None)
    assert problem.distance_weight == pytest.approx(1 / 5)
    one_place = Problem(
        uavs=(UAV("u", 1, 1, 1, 1, speed=1.0, voyage=0.0, loadlist=(1.0,)),),
        targets=(Target("a", 1, 1, level=1.0, loadlist=(2.0,)),),
    )
    assert one_place.distance_weight == 1.0
    assert reward_of(one_place, Plan(((0,),))) == pytest.approx(0.5)


def test_a_degree_of_latitude_is_111_km():
    problem = Problem(
        uavs=(UAV("u", 30, 10, 30, 10, speed=1.0, voyage=1e4, loadlist=(1.0,)),),
        targets=(Target("a", 30, 11, level=1.0, loadlist=(1.0,)),),
        crs="wgs84",
    )
    distance = explain(problem, Plan(((0,),))).distance
    assert distance == pytest.approx(math.pi * 6371.0088 / 180)


@pytest.mark.parametrize(
    ("change", "legal"),
    [({"voyage": 12.0}, True), ({"voyage": 11.99}, False), ({"voyage": 12.0 * (1 - 5e-7)}, True)],
)
def test_range_counts_the_way_home_with_a_relative_tolerance(change, legal):
    problem = triangle()  # a then b: 3 + 4 out, 5 home
    problem = replace(problem, uavs=(replace(problem.uavs[0], **change),))
    result = rewards_of(compile_problem(problem), np.array([[[0], [1]]]))
    assert (result.rule[0] == visit.ALLOWED) == legal
    one_way = replace(problem, objective=Objective(0.1, return_to_base=False))
    assert rewards_of(compile_problem(one_way), np.array([[[0], [1]]])).rule[0] == visit.ALLOWED


def test_service_time_delays_the_next_arrival():
    # Arrival at b: 3/2 + 0.5 + 4/2 = 4.0, exactly its deadline; the smallest real delay is too late.
    assert reward_of(triangle(), Plan(((0,), (1,)))) > 0
    late = triangle()
    late = replace(late, targets=(replace(late.targets[0], service_time=0.51), late.targets[1]))
    with pytest.raises(IllegalPlan, match=r"step 2, u: action 1 .* deadline") as caught:
        reward_of(late, Plan(((0,), (1,))))
    assert caught.value.details["step"] == 2


def test_uavs_of_one_step_act_in_index_order():
    first, second = (
        UAV(name, 0, 0, 0, 0, speed=1.0, voyage=10.0, loadlist=(load,))
        for name, load in (("p", 2.0), ("q", 5.0))
    )
    problem = Problem(
        uavs=(first, second), targets=(Target("a", 0, 1, level=1.0, loadlist=(4.0,)),), max_steps=1
    )
    stops = [route.stops[0].delivered for route in explain(problem, Plan(((0, 0),))).routes]
    assert stops == [(2.0,), (2.0,)]


def test_explanation_adds_up():
    rng = np.random.default_rng(5)
    for _ in range(100):
        problem = random_problem(rng)
        arrays, record = compile_problem(problem), problem_to_record(problem)
        plan = Plan.of(random_plan(problem, arrays, rng, legal=True), problem.n_targets)
        answer = explain(problem, plan)
        expected = slow_replay(record, plan.assignment)
        assert answer.reward == pytest.approx(answer.satisfaction - answer.distance_weight * answer.distance)
        assert answer.reward == pytest.approx(expected["reward"], abs=1e-9)
        delivered = np.zeros((problem.n_targets, problem.n_materials))
        index = {t.id: j for j, t in enumerate(problem.targets)}
        for route in answer.routes:
            for stop in route.stops:
                delivered[index[stop.target_id]] += stop.delivered
        need = np.array([t.loadlist for t in problem.targets])
        np.testing.assert_allclose(need - delivered, expected["remaining"], atol=1e-9)
        unmet = {u.target_id: u.remaining for u in answer.unmet}
        for j, target in enumerate(problem.targets):
            left = expected["remaining"][j]
            assert (target.id in unmet) == (max(left) > 0)
            if max(left) > 0:
                assert unmet[target.id] == pytest.approx(left)
        flown = sum(r.distance for r in answer.routes)
        if problem.objective.charge_return:
            flown += sum(r.return_distance for r in answer.routes)
        assert flown == pytest.approx(answer.distance)


def test_episodes_in_lock_step_earn_what_a_replay_says():
    """Padded, stacked problems, a random policy: rewards of the steps add up to the replayed reward."""
    rng = np.random.default_rng(11)
    problems = [random_problem(rng) for _ in range(40)]
    arrays = stack([compile_problem(p) for p in problems])
    m, n, _ = arrays.shape
    episodes = simulator.new_episodes(arrays, len(problems), np.arange(len(problems)))
    mask = np.empty((len(problems), m, n + 1), np.bool_)
    earned = np.zeros(len(problems))
    plans = [[] for _ in problems]
    while not episodes.done.all():
        for b in np.flatnonzero(~episodes.done):
            row = []
            for i in range(m):
                simulator.allowed_actions(arrays, episodes, mask)
                row.append(int(rng.choice(np.flatnonzero(mask[b, i]))))
                earned[b] += simulator.act(arrays, episodes, b, i, row[-1])
            plans[b].append(row)
            earned[b] += simulator.end_step(arrays, episodes, b)
    for b, problem in enumerate(problems):
        m_b, n_b = problem.n_uavs, problem.n_targets
        rows = [[a if a < n else n_b for a in row[:m_b]] for row in plans[b]] or [[n_b] * m_b]
        expected = slow_replay(problem_to_record(problem), rows)
        assert earned[b] == pytest.approx(expected["reward"], abs=1e-9)
        simulator.reset_one(arrays, episodes, b)
        assert not episodes.satisfaction[b]


def test_an_episode_ends_when_nothing_can_be_delivered_any_more():
    problem = triangle()
    arrays = compile_problem(problem)
    episodes = simulator.new_episodes(arrays, 1)
    simulator.act(arrays, episodes, 0, 0, 1)
    simulator.end_step(arrays, episodes, 0)
    assert episodes.done[0] == np.False_
    simulator.act(arrays, episodes, 0, 0, 0)
    simulator.end_step(arrays, episodes, 0)
    assert episodes.done[0]
    nothing_aboard = replace(problem, uavs=(replace(problem.uavs[0], loadlist=(0.0, 0.0)),))
    assert simulator.new_episodes(compile_problem(nothing_aboard), 1).done[0]
