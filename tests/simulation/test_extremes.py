"""Numbers at the ends of their range, and levels in any unit: finite answers, legal plans, the same plans."""

from dataclasses import replace

import numpy as np
import pytest
from cases import problem_of
from problems import random_problem
from referee import replay

from app.domain.fields import MAX_MAGNITUDE, MIN_MAGNITUDE
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record
from app.learning.universal.episodes.observation import look, new_gains, observe
from app.learning.universal.network.architecture import OWN_FEATURES, PAIR_FEATURES, RIVAL_FEATURES
from app.library.description import task_description
from app.library.summary import task_summary
from app.simulation.arrays import compile_problem
from app.simulation.explain import explain
from app.simulation.simulator import act, new_episodes
from app.solvers.greedy import greedy_plan
from app.solvers.unloading.solver import _Incumbent

SIZES = (0.0, 5e-324, 1e-320, 1e-160, MIN_MAGNITUDE, 1e-50, 1e-12, 0.677, 1.0, 1e3, MAX_MAGNITUDE)


def extreme(rng):
    """A problem of any sizes beside each other."""
    k = int(rng.integers(1, 4))
    unit = float(rng.choice(SIZES[2:]))

    def size():
        return float(rng.choice(SIZES))

    def place():
        return float(rng.choice((0.0, 0.5, 1.0)) * unit if rng.random() < 0.7 else size())

    def amounts():
        return tuple(size() for _ in range(k))

    uavs = []
    for i in range(int(rng.integers(1, 5))):
        x, y = place(), place()
        speed = float(rng.choice(SIZES[4:]))
        uavs.append(
            UAV(
                f"u{i}",
                x,
                y,
                x,
                y,
                speed,
                size() if rng.random() < 0.5 else min(9 * unit, MAX_MAGNITUDE),
                amounts(),
            )
        )
    targets = [
        Target(
            f"t{j}",
            place(),
            place(),
            size(),
            amounts(),
            deadline=None if rng.random() < 0.6 else size(),
            service_time=size() if rng.random() < 0.3 else 0.0,
        )
        for j in range(int(rng.integers(1, 5)))
    ]
    objective = Objective(
        None if rng.random() < 0.5 else size(),
        return_to_base=bool(rng.random() < 0.5),
        charge_return=bool(rng.random() < 0.3),
        unloading="planned" if rng.random() < 0.5 else "greedy",
    )
    return Problem(tuple(uavs), tuple(targets), int(rng.integers(1, 5)), objective=objective)


def observed(problem, moves=()):
    """All that the first UAV that has not returned sees at its turn, after some moves of the greedy plan."""
    arrays = compile_problem(problem)
    m, n, _ = arrays.shape
    episodes, gains = new_episodes(arrays, 1), new_gains(arrays, 1)
    for i, action in enumerate(moves):
        act(arrays, episodes, 0, i, action)
    look(arrays, episodes, gains)
    seen = (
        np.empty((n, PAIR_FEATURES), np.float32),
        np.empty(OWN_FEATURES, np.float32),
        np.empty((n, m, RIVAL_FEATURES), np.float32),
    )
    out = np.flatnonzero(~episodes.ret[0])
    if not len(out):
        return np.zeros(1)
    observe(arrays, episodes, gains, 0, int(out[-1]), *seen)
    return np.concatenate([each.ravel() for each in seen])


def test_everything_that_is_worked_out_of_a_problem_is_finite():
    rng = np.random.default_rng(1)
    flown = 0
    for _ in range(300):
        problem = extreme(rng)
        assert np.isfinite(problem.distance_weight)
        for numbers in (task_summary(problem), task_description(problem), observed(problem)):
            assert np.isfinite(numbers).all()
            assert np.isfinite(numbers.astype(np.float32)).all()
        greedy = replace(problem, objective=replace(problem.objective, unloading="greedy"))
        plan = greedy_plan(greedy)
        answer, expected = explain(greedy, plan), replay(problem_to_record(greedy), plan.assignment)
        assert np.isfinite([answer.reward, answer.satisfaction, answer.distance]).all()
        assert answer.reward == pytest.approx(expected["reward"], rel=1e-9, abs=1e-200)
        for route in answer.routes:
            for stop in route.stops:
                assert np.isfinite([stop.arrival_time, stop.distance, *stop.delivered]).all()
                assert max(stop.delivered) > 0
                flown += 1
    assert flown > 100


def test_planned_unloading_of_any_amounts_is_legal():
    rng = np.random.default_rng(2)
    for _ in range(200):
        problem = extreme(rng)
        problem = replace(problem, objective=replace(problem.objective, unloading="planned"))
        incumbent = _Incumbent(problem)
        incumbent.consider(
            greedy_plan(replace(problem, objective=replace(problem.objective, unloading="greedy")))
        )
        answer = explain(problem, incumbent.plan)
        assert np.isfinite(answer.reward)
        assert answer.reward == pytest.approx(incumbent.reward, rel=1e-9, abs=1e-200)


def test_numbers_too_small_to_count_are_none():
    problem = problem_of("extreme-bound-index-error")
    assert [target.need for target in problem.targets] == [(0.0, 0.0)]
    assert problem.targets[0].level == 0.0
    assert problem.uavs[3].loadlist == (0.0, 0.0)
    tiny = replace(
        problem,
        objective=Objective(1e-200),
        targets=(replace(problem.targets[0], x=-1e-150, deadline=-5e-324, service_time=1e-101),),
    )
    assert (tiny.distance_weight, tiny.targets[0].x, tiny.targets[0].deadline) == (0.0, 0.0, 0.0)
    assert tiny.targets[0].service_time == 0.0


@pytest.mark.parametrize("factor", [2.0**-40, 2.0**36])
def test_levels_in_any_unit_give_the_same_plan_and_the_same_observations(factor):
    """By powers of two, so that every reward is exactly the same number in another unit: 1e-12 and 7e10."""
    rng = np.random.default_rng(3)
    for _ in range(100):
        problem = random_problem(rng)
        if not any(any(t.need) for t in problem.targets):
            continue
        scaled = replace(
            problem,
            targets=tuple(replace(t, level=t.level * factor) for t in problem.targets),
            objective=replace(problem.objective, distance_weight=problem.distance_weight * factor),
        )
        plan = greedy_plan(problem)
        assert greedy_plan(scaled) == plan
        assert explain(scaled, plan).reward == explain(problem, plan).reward * factor
        for moves in ((), plan.assignment[0][: problem.n_uavs // 2]):
            np.testing.assert_array_equal(observed(scaled, moves), observed(problem, moves))
        np.testing.assert_allclose(task_summary(scaled), task_summary(problem), atol=1e-12)
        np.testing.assert_allclose(task_description(scaled), task_description(problem), atol=1e-12)


def test_the_observation_and_the_summary_allow_what_the_simulator_allows():
    def flown(voyage, deadline):
        return Problem(
            (UAV("u", 0, 0, 0, 0, 1.0, voyage, (2.0,)),),
            (Target("a", 1, 0, 1.0, (1.0,)), Target("b", 2, 0, 1.0, (1.0,), deadline=deadline)),
            objective=Objective(0.1),
        )

    exact, nearly = flown(4.0, 2.0), flown(4.0 * (1 - 5e-7), 2.0 * (1 - 5e-7))
    assert len(greedy_plan(nearly).assignment) == 2
    follow_up, allowed = 21, 0
    seen = observed(nearly)[:PAIR_FEATURES]
    assert seen[allowed] == 1.0
    assert seen[follow_up] > 0.4
    np.testing.assert_allclose(observed(nearly), observed(exact), atol=1e-5)
    np.testing.assert_allclose(task_summary(nearly), task_summary(exact), atol=1e-5)
