"""Playing and unfolding: two ways through the same episode, with the same observations and rewards."""

import numpy as np
import pytest
from problems import random_problem
from referee import replay
from stopping import After

from app.domain.records import problem_to_record
from app.learning.universal.episodes.best_plan import BestPlan
from app.learning.universal.episodes.rollout import play
from app.learning.universal.episodes.turns import replay_turns
from app.learning.universal.network.architecture import OWN_FEATURES, PAIR_FEATURES
from app.learning.universal.request.fine_tuning import FineTuning
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate
from app.solvers.stop import never


def test_played_plans_are_legal_and_earn_what_was_said(make_before):
    rng = np.random.default_rng(4)
    for number in range(60):
        problem = random_problem(rng)
        arrays = compile_problem(problem)
        played = play(make_before(number % 5).agent, arrays, np.zeros(3, np.int64), rng)
        for plan, reward in zip(played.plans, played.rewards, strict=True):
            judged = replay(problem_to_record(problem), plan.tolist())
            assert reward == pytest.approx(judged["reward"], abs=1e-9)


def test_exploring_turns_are_any_that_is_allowed_and_others_the_policys(make_before):
    rng, count = np.random.default_rng(8), 4000
    arrays = compile_problem(generate("uniform", 3, 4, 2, rng))
    epsilon = np.where(np.arange(count) % 2, 1.0, 0.0)
    problem = np.zeros(count, np.int64)
    plans = play(make_before().agent, arrays, problem, rng, 1e-6, epsilon=epsilon).plans

    assert len(np.unique(plans[::2], axis=0)) == 1
    _, firsts = np.unique(plans[1::2, 0, 0], return_counts=True)
    assert len(firsts) == arrays.shape[1] + 1  # every area, and home
    expected = count / 2 / len(firsts)
    assert np.abs(firsts - expected).max() < 5 * np.sqrt(expected)


def test_fine_tuning_explores_in_every_other_episode(make_policy):
    rng = np.random.default_rng(9)
    arrays = compile_problem(generate("uniform", 3, 4, 2, rng))
    tuning = FineTuning(make_policy(), arrays, batch_size=4, lr=1e-4, gamma=0.99, rng=rng)
    plans = tuning.epoch(BestPlan(arrays).actions, never, temperature=1e-6)
    assert (tuning.learned, len(plans)) == (4, 64)
    assert len(np.unique(plans[::2], axis=0)) == 1
    assert len(np.unique(plans[1::2], axis=0)) > 8


def test_rewards_of_the_steps_add_up(make_before):
    rng = np.random.default_rng(6)
    for number in range(30):
        problem = random_problem(rng)
        arrays = compile_problem(problem)
        played = play(make_before(number % 5).agent, arrays, np.zeros(2, np.int64), rng)
        turns = replay_turns(arrays, np.zeros(2, np.int64), played.plans)
        charged = replay(problem_to_record(problem), [[problem.n_targets] * problem.n_uavs])["reward"]
        # An episode in which nobody may fly has no step in which the way home could be charged.
        expected = played.rewards if len(turns.action) else played.rewards - charged
        np.testing.assert_allclose(turns.reward.sum(axis=1), expected, atol=1e-9)


def test_observations_are_bounded_and_finite():
    rng = np.random.default_rng(7)
    for _ in range(60):
        problem = random_problem(rng)
        arrays = compile_problem(problem)
        plans = np.full((1, problem.max_steps, problem.n_uavs), problem.n_targets)
        turns = replay_turns(arrays, np.zeros(1, np.int64), plans)
        assert turns.pair.shape[2] == PAIR_FEATURES
        assert turns.own.shape[1] == OWN_FEATURES
        for rows in (turns.pair, turns.own, turns.rivals):
            assert np.isfinite(rows).all()
            assert np.abs(rows).max(initial=0) <= 6


def test_sampling_is_by_the_generator_alone(before, family_problems):
    arrays = compile_problem(family_problems[0])
    first, again, other = (
        play(before.agent, arrays, np.zeros(8, np.int64), np.random.default_rng(seed)).plans
        for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert len(np.unique(first, axis=0)) > 1
    cold = play(before.agent, arrays, np.zeros(8, np.int64), np.random.default_rng(1), temperature=1e-6)
    greedy = play(before.agent, arrays, np.zeros(1, np.int64)).plans
    assert np.array_equal(cold.plans, np.repeat(greedy, 8, axis=0))


def test_stopped_episodes_end_at_home(before, family_problems):
    problem = family_problems[0]
    arrays, whole = compile_problem(problem), None
    for allowed in (0, 1, 3, 8, 1000):
        stop = After(allowed)
        played = play(before.agent, arrays, np.zeros(1, np.int64), stop=stop)
        judged = replay(problem_to_record(problem), played.plans[0].tolist())
        assert played.rewards[0] == pytest.approx(judged["reward"])
        whole = played.plans
    assert np.array_equal(whole, play(before.agent, arrays, np.zeros(1, np.int64)).plans)
    assert stop.left > 0
