"""Orders of UAVs: the same problem and the same plan under other indices."""

import numpy as np
from referee import replay

from app.domain.records import problem_to_record
from app.learning.universal.episodes.rollout import play
from app.learning.universal.episodes.turn_order import (
    draw_orders,
    reorder,
    reorder_plans,
    restore_plans,
    some_orders,
)
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate
from app.simulation.replay import replay as replayed
from app.simulation.stacks import stack


def test_a_plan_earns_the_same_under_other_indices(make_before):
    rng = np.random.default_rng(0)
    for number in range(20):
        problem = generate("deadline", 4, 8, 2, rng)
        arrays = compile_problem(problem)
        orders = draw_orders(3, 4, rng)
        several = reorder(stack([arrays] * 3), orders)
        played = play(make_before(number % 3).agent, several, np.arange(3))
        plans = restore_plans(played.plans, orders)
        again = replayed(several, reorder_plans(plans, orders), np.arange(3))
        assert np.array_equal(played.plans, reorder_plans(plans, orders))
        assert np.abs(again.reward - played.rewards).max() < 1e-9
        for plan, reward in zip(plans, played.rewards, strict=True):
            together = [
                len(set(row)) == len(row) for row in (plan + np.arange(4) * 100 * (plan == 8)).tolist()
            ]
            if all(together):  # nobody shares a target in a step, so the order within a step is nothing
                judged = replay(problem_to_record(problem), plan[: problem.max_steps].tolist())["reward"]
                assert abs(judged - reward) < 1e-9


def test_the_first_order_is_that_of_the_indices():
    rng = np.random.default_rng(1)
    orders = some_orders(8, 5, rng)
    assert orders.shape == (8, 5)
    assert orders[0].tolist() == [0, 1, 2, 3, 4]
    assert (np.sort(orders, axis=1) == np.arange(5)).all()
    assert len(np.unique(orders, axis=0)) > 4
    assert some_orders(8, 1, rng).tolist() == [[0]]
