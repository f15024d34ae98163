"""Several episodes of one problem, of both kinds of policies."""

import numpy as np
import pytest

from app.learning.universal.episodes.turn_order import some_orders
from app.learning.universal.episodes.variety import roll_outs, samples
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate


@pytest.fixture
def arrays():
    return compile_problem(generate("uniform", 5, 10, 3, np.random.default_rng(2)))


def test_where_uavs_take_turns_roll_outs_are_greedy_and_in_several_orders(make_before, arrays):
    policy = make_before(1)
    plans = roll_outs(policy, arrays, 3, np.random.default_rng(3))
    assert plans.shape == (3, int(arrays.max_steps[0]), 5)
    assert np.array_equal(plans[:1], policy.play(arrays, np.zeros(1, np.int64)).plans)
    assert not all(np.array_equal(plans[0], other) for other in plans[1:])
    # What differs is the order alone: another generator that draws the same orders brings the same plans.
    assert np.array_equal(plans, roll_outs(policy, arrays, 3, np.random.default_rng(3)))


def test_where_the_policy_decides_one_is_greedy_and_the_others_are_sampled(make_policy, arrays):
    policy = make_policy(1)
    plans = roll_outs(policy, arrays, 8, np.random.default_rng(3))
    assert len(plans) == 8
    assert np.array_equal(plans[:1], policy.play(arrays, np.zeros(1, np.int64)).plans)
    assert len(np.unique(plans, axis=0)) > 1
    assert np.array_equal(roll_outs(policy, arrays, 1, np.random.default_rng(3)), plans[:1])


def test_samples_of_turns_come_order_by_order(make_before, arrays):
    policy = make_before(1)
    plans = samples(policy, arrays, 7, 3, np.random.default_rng(4))
    assert len(plans) == 7
    assert len(some_orders(3, 5, np.random.default_rng(4))) == 3
    assert len(np.unique(plans, axis=0)) > 1


def test_samples_are_as_many_as_asked_for(make_policy, arrays):
    assert len(samples(make_policy(1), arrays, 7, 3, np.random.default_rng(4))) == 7
