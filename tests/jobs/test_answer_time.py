"""What is kept back of a time limit follows the problem's size and what was measured."""

import numpy as np
import pytest

from app.jobs.answer_time import AnswerTime
from app.simulation.generator import generate

RNG = np.random.default_rng(0)
SMALL, LARGE = (generate("uniform", m, n, 2, RNG) for m, n in ((5, 10), (200, 400)))


def test_a_larger_problem_and_a_slower_machine_keep_back_more():
    quick, slow = AnswerTime(), AnswerTime()
    quick.took(LARGE, 0.010)
    slow.took(LARGE, 0.050)
    for of in (quick, slow):
        assert of.expected(SMALL) < of.expected(LARGE)
    assert quick.expected(LARGE) > 0.010
    assert slow.expected(LARGE) - slow.expected(SMALL) == pytest.approx(
        5 * (quick.expected(LARGE) - quick.expected(SMALL))
    )


def test_the_slowest_of_the_last_counts():
    of = AnswerTime()
    of.took(LARGE, 0.5)
    before = of.expected(LARGE)
    of.took(LARGE, 0.01)
    assert of.expected(LARGE) == before
    for _ in range(100):
        of.took(LARGE, 0.01)
    assert of.expected(LARGE) < before / 3


def test_a_slow_small_answer_does_not_make_large_ones_look_endless():
    of = AnswerTime()
    of.took(SMALL, 0.03)
    assert of.expected(LARGE) < 0.5


def test_the_search_keeps_most_of_a_short_time_and_none_of_what_has_passed():
    of = AnswerTime()
    of.took(LARGE, 0.5)
    assert of.kept_back(LARGE, 0.1) == pytest.approx(0.025)
    assert of.kept_back(LARGE, 100.0) == of.expected(LARGE)
    assert of.kept_back(LARGE, -1.0) == 0.0
