"""Episodes that repeat what is known make the policy play more adventurously, others less, never below 1."""

import itertools

import numpy as np
import pytest

from app.learning.universal.episodes.temperature import Temperature
from app.simulation.arrays import compile_problem
from app.simulation.evaluation import rewards_of
from app.simulation.generator import generate
from app.solvers.greedy import greedy_plan


@pytest.fixture
def situation():
    """A compiled problem, a plan (S, M), its reward, and one that stays at home."""
    problem = generate("uniform", 3, 6, 2, np.random.default_rng(5))
    arrays = compile_problem(problem)
    home = np.full((problem.max_steps, 3), 6, np.int64)
    plan = home.copy()
    rows = greedy_plan(problem).as_array()
    plan[: len(rows)] = rows
    return arrays, plan, float(rewards_of(arrays, plan[None]).reward[0]), home


def test_it_rises_while_what_is_known_is_repeated_and_falls_while_it_is_not(situation):
    arrays, plan, reward, home = situation
    temperature, seen = Temperature(arrays), [1.0]
    for _ in range(3):
        temperature.follow(np.stack([plan, home, home]), reward)
        seen.append(temperature.value)
    assert all(later > earlier for earlier, later in itertools.pairwise(seen))
    for expected in (seen[2], seen[1], 1.0, 1.0):
        temperature.follow(np.stack([home, home]), reward)
        assert temperature.value == pytest.approx(expected)


def test_it_stays_while_few_episodes_repeat_what_is_known_and_has_an_upper_end(situation):
    arrays, plan, reward, home = situation
    temperature = Temperature(arrays)
    temperature.follow(plan[None], reward)
    value = temperature.value
    temperature.follow(np.stack([plan] + [home] * 9), reward)
    assert temperature.value == value > 1.0
    for _ in range(60):
        temperature.follow(plan[None], reward)
    assert temperature.value == 50.0
