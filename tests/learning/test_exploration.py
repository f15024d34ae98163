from dataclasses import replace

import numpy as np
import pytest
from problems import random_problem
from referee import replay

from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record
from app.learning.paper.environment import SwarmEnvironment
from app.learning.paper.exploration import EpsilonSchedule
from app.simulation.arrays import compile_problem
from app.simulation.simulator import allowed_actions, new_episodes

NO_DRAWS = 0.999


def clash(n_uavs: int = 2) -> Problem:
    """Several UAVs at one place, and one need that any of them fills alone."""
    uavs = tuple(UAV(f"u{i}", 0, 0, 0, 0, 1, 10, (5.0,)) for i in range(n_uavs))
    targets = (Target("near", 1, 0, 1, (5.0,)), Target("far", 2, 0, 1, (3.0,)))
    return Problem(uavs, targets, max_steps=2, objective=Objective(1.0))


def step(environment, values, epsilon=0.0, draws=None):
    actions = np.zeros(len(values), np.int64)
    draws = np.full((len(values), 2), NO_DRAWS) if draws is None else draws
    reward = environment.step(np.asarray(values, np.float32), draws, epsilon, actions)
    return actions.tolist(), reward


def test_second_uav_of_a_step_sees_what_the_first_unloaded():
    environment = SwarmEnvironment(clash())
    actions, reward = step(environment, [[3, 2, 1], [3, 2, 1]])
    assert actions == [0, 1]
    assert reward == pytest.approx(1 + 1 - 1 - 2)


def test_uav_with_nothing_left_to_do_in_the_step_returns():
    environment = SwarmEnvironment(clash(n_uavs=3))
    actions, _ = step(environment, [[3, 2, 1]] * 3)
    assert actions == [0, 1, 2]


def test_greedy_takes_the_largest_allowed_value_and_returns_among_equals():
    environment = SwarmEnvironment(clash())
    actions, _ = step(environment, [[1, 1, 1], [0, 5, 4]])
    assert actions == [2, 1]
    environment.reset()
    # UAV 0 has an empty hold: whatever its values are, it can only return.
    problem = clash()
    empty = replace(problem, uavs=(replace(problem.uavs[0], loadlist=(0.0,)), problem.uavs[1]))
    actions, _ = step(SwarmEnvironment(empty), [[9, 9, -9], [9, 0, 0]])
    assert actions == [2, 0]


def test_values_that_are_not_numbers_choose_the_return():
    actions, _ = step(SwarmEnvironment(clash()), [[np.nan, np.nan, np.nan], [np.nan, 1, np.nan]])
    assert actions[0] == 2


def test_random_actions_are_uniform_over_what_is_allowed():
    rng = np.random.default_rng(0)
    environment = SwarmEnvironment(clash())
    first, second_after_near = np.zeros(3), np.zeros(3)
    for _ in range(6000):
        environment.reset()
        actions, _ = step(environment, np.zeros((2, 3)), 1.0, rng.random((2, 2)))
        first[actions[0]] += 1
        if actions[0] == 0:
            second_after_near[actions[1]] += 1
    assert np.allclose(first / first.sum(), 1 / 3, atol=0.03)
    assert second_after_near[0] == 0
    assert np.allclose(second_after_near[1:] / second_after_near.sum(), 1 / 2, atol=0.04)


def test_share_of_random_actions_is_epsilon():
    rng = np.random.default_rng(0)
    environment = SwarmEnvironment(clash())
    greedy = 0
    for _ in range(4000):
        environment.reset()
        actions, _ = step(environment, [[3, 2, 1], [3, 2, 1]], 0.3, rng.random((2, 2)))
        greedy += actions[0] == 0
    assert greedy / 4000 == pytest.approx(0.7 + 0.3 / 3, abs=0.03)


def test_every_episode_is_a_legal_plan_and_earns_what_the_referee_says():
    """Random problems of every option: returning UAVs, deadlines, charged returns, degrees."""
    rng = np.random.default_rng(2)
    played = 0
    for _ in range(150):
        problem = random_problem(rng)
        environment = SwarmEnvironment(problem)
        epsilon = float(rng.choice([0.0, 0.3, 1.0]))
        rows, earned = [], 0.0
        while not environment.done:
            actions, reward = step(
                environment,
                rng.normal(size=(problem.n_uavs, problem.n_targets + 1)),
                epsilon,
                rng.random((problem.n_uavs, 2)),
            )
            rows.append(actions)
            earned += reward
        if rows:
            played += 1
            assert earned == pytest.approx(replay(problem_to_record(problem), rows)["reward"], abs=1e-9)
    assert played > 100


def test_mask_is_that_of_the_beginning_of_the_step():
    problem = clash()
    environment = SwarmEnvironment(problem)
    state, mask = np.zeros(environment.sizes.state_features, np.float32), np.zeros((2, 3), np.bool_)
    environment.observe(state, mask)
    assert mask.all(), "before anybody acts, both may fly to both"
    step(environment, [[3, 2, 1], [3, 2, 1]])
    arrays = compile_problem(problem)
    episodes = new_episodes(arrays, 1)
    expected = np.zeros((1, 2, 3), np.bool_)
    allowed_actions(arrays, episodes, expected)
    assert expected.all()


def test_epsilon_falls_linearly_and_stays():
    schedule = EpsilonSchedule(1.0, 0.05, 1000)
    assert [schedule(0), schedule(500), schedule(1000), schedule(10**9)] == pytest.approx(
        [1.0, 0.525, 0.05, 0.05]
    )
    assert EpsilonSchedule(0.05, 0.05, 1)(0) == 0.05
