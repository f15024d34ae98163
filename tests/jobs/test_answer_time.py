"""What is kept back of a time limit follows the problem's size and what was measured."""

import numpy as np
import pytest

from app.jobs.answer_time import AnswerTime
from app.simulation.generator import generate

RNG = np.random.default_rng(0)
SMALL, LARGE, LARGER = (generate("uniform", m, n, 2, RNG) for m, n in ((5, 10), (200, 400), (800, 1600)))


def test_a_larger_problem_and_a_slower_machine_keep_back_more():
    quick, slow = AnswerTime(), AnswerTime()
    quick.wrote(LARGE, 0.010)
    slow.wrote(LARGE, 0.050)
    for of in (quick, slow):
        assert of.way_back(SMALL) < of.way_back(LARGE)
    assert quick.way_back(LARGE) > 0.010
    assert slow.way_back(LARGE) - slow.way_back(SMALL) == pytest.approx(
        5 * (quick.way_back(LARGE) - quick.way_back(SMALL))
    )


def test_one_slow_answer_among_many_changes_nothing_and_many_do():
    of = AnswerTime()
    for _ in range(3):
        of.wrote(LARGE, 0.01)
    before = of.way_back(LARGE)
    of.wrote(LARGE, 0.5)
    assert of.way_back(LARGE) == before
    for _ in range(10):
        of.wrote(LARGE, 0.5)
    assert of.way_back(LARGE) > 10 * before


def test_a_slow_small_answer_does_not_make_large_ones_look_endless():
    of = AnswerTime()
    of.wrote(SMALL, 0.03)
    assert of.way_back(LARGE) < 1.0


def test_reasons_get_a_share_of_a_short_time_and_none_of_what_has_passed():
    of = AnswerTime()
    of.wrote(LARGE, 0.01)
    of.explained(LARGE, 0.5)
    assert of.kept_back(LARGE, 0.1) == pytest.approx(of.way_back(LARGE) + 0.025)
    assert of.kept_back(LARGE, 100.0) == pytest.approx(of.way_back(LARGE) + 0.5)
    assert of.kept_back(LARGE, -1.0) == of.way_back(LARGE)


def test_what_cannot_be_left_out_of_an_explanation_is_kept_whole():
    of = AnswerTime()
    of.wrote(LARGE, 0.01)
    before = of.way_back(LARGE)
    of.explained(LARGE, 0.5)
    of.traced(LARGE, 0.2)
    assert of.way_back(LARGE) == pytest.approx(before + 0.2)
    assert of.kept_back(LARGE, 0.1) == pytest.approx(before + 0.2 + 0.025)
    assert of.kept_back(LARGE, 100.0) == pytest.approx(before + 0.5)


def test_an_algorithm_that_would_only_prepare_is_not_begun_and_tried_again_later():
    of = AnswerTime()
    assert not of.is_too_short("ga", LARGE, 0.001)
    of.overran("ga", LARGE, 0.1)
    assert of.is_too_short("ga", LARGE, 0.05)
    assert not of.is_too_short("ga", LARGE, 0.2)
    # Neither other sizes nor other algorithms are judged by it.
    assert not of.is_too_short("ga", LARGER, 0.05)
    assert not of.is_too_short("greedy", LARGE, 0.05)
    refused = 0
    while of.is_too_short("ga", LARGE, 0.05):
        refused += 1
    assert 0 < refused < 10
