"""Updates that a time limit leaves no time for: foreseen by what the last one took, and not begun."""

import numpy as np
import pytest
import torch

from app.learning.pairwise.architecture import PairwiseConfig
from app.learning.universal.request.fine_tuning import FineTuning
from app.learning.universal.request.update_time import UpdateTime
from app.simulation.arrays import compile_problem
from app.simulation.generator import generate
from app.solvers.greedy import greedy_plan


class Leaves:
    """A time limit that always leaves so many seconds."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds

    def __call__(self) -> bool:
        return self._seconds <= 0

    def seconds_left(self) -> float:
        return self._seconds


@pytest.fixture
def problem():
    return generate("uniform", 4, 6, 2, np.random.default_rng(3))


@pytest.mark.parametrize("bootstrap", [False, True])
def test_the_next_update_is_expected_to_take_what_the_last_one_did(problem, bootstrap):
    times = UpdateTime(compile_problem(problem), PairwiseConfig())
    other = times.expected(50, bootstrap=not bootstrap)
    times.took(50, 0.125, bootstrap=bootstrap)
    assert times.expected(50, bootstrap=bootstrap) == pytest.approx(0.125)
    assert 0.125 < times.expected(100, bootstrap=bootstrap) < 0.25
    assert times.expected(50, bootstrap=not bootstrap) == other


def test_larger_ones_are_expected_to_take_longer():
    rng = np.random.default_rng(1)
    small, large = (compile_problem(generate("uniform", m, n, 3, rng)) for m, n in ((5, 10), (20, 30)))
    config, wide = PairwiseConfig(), PairwiseConfig(width=128)
    expected = [
        UpdateTime(small, config).expected(30, bootstrap=False),
        UpdateTime(small, config).expected(30, bootstrap=True),
        UpdateTime(large, config).expected(30, bootstrap=True),
        UpdateTime(large, wide).expected(30, bootstrap=True),
    ]
    assert expected == sorted(expected)


@pytest.mark.parametrize(("seconds", "learned"), [(0.0, False), (1e-4, False), (1e4, True)])
def test_no_update_is_begun_that_would_end_too_late(make_policy, problem, seconds, learned):
    policy, arrays = make_policy(1), compile_problem(problem)
    rng = np.random.default_rng(0)
    tuning = FineTuning(policy, arrays, batch_size=4, lr=1e-3, gamma=0.99, rng=rng)
    tuning.epoch(greedy_plan(problem).as_array(), Leaves(seconds))
    same = [
        torch.equal(tuned, was)
        for tuned, was in zip(tuning.policy.parameters(), policy.parameters(), strict=True)
    ]
    assert all(same) is not learned
