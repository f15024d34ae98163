"""What is kept back of a time limit follows what there is to answer and what was measured."""

from dataclasses import replace

import numpy as np
import pytest

from app.allocation.answer_time import AnswerSize, AnswerTime, expected_size
from app.allocation.preparation import Preparations
from app.allocation.time_limit import TimeLimit
from app.jobs.worker import DEADLINE, WorkContext, new_control
from app.simulation.generator import generate

RNG = np.random.default_rng(0)
SMALL, LARGE, LARGER = (generate("uniform", m, n, 2, RNG) for m, n in ((5, 10), (200, 400), (800, 1600)))
MANY_MATERIALS = generate("uniform", 200, 400, 64, RNG)


def planned(problem):
    return replace(problem, objective=replace(problem.objective, unloading="planned"))


def note(of, problem, *, tracing=0.0, looking=None, writing=0.0, finished=True, size=None):
    size = size or expected_size(problem)
    of.traced(problem, size, tracing)
    of.wrote(problem, size, writing)
    if looking is not None:
        of.looked(problem, size, looking, finished)


def way_back(of, problem):
    return of.way_back(problem, expected_size(problem))


def looking(of, problem, left_s):
    return of.looking(problem, expected_size(problem), left_s)


def test_a_larger_answer_and_a_slower_machine_keep_back_more():
    quick, slow = AnswerTime(), AnswerTime()
    note(quick, LARGE, writing=0.010)
    note(slow, LARGE, writing=0.050)
    for of in (quick, slow):
        assert way_back(of, SMALL) < way_back(of, LARGE) < way_back(of, LARGER)
        assert way_back(of, LARGE) < way_back(of, MANY_MATERIALS)
        # Known once there is a plan: fewer stops are written sooner.
        assert of.way_back(LARGE, AnswerSize(100, 10)) < way_back(of, LARGE)
    assert way_back(quick, LARGE) > 0.010
    assert way_back(slow, LARGE) - way_back(slow, SMALL) == pytest.approx(
        5 * (way_back(quick, LARGE) - way_back(quick, SMALL))
    )


def test_one_slow_answer_among_many_changes_nothing_and_many_do():
    of = AnswerTime()
    for _ in range(3):
        note(of, LARGE, writing=0.01, tracing=0.01)
    before = way_back(of, LARGE), of.tracing(LARGE, expected_size(LARGE))
    note(of, LARGE, writing=0.5, tracing=0.5)
    assert (way_back(of, LARGE), of.tracing(LARGE, expected_size(LARGE))) == before
    for _ in range(10):
        note(of, LARGE, writing=0.5)
    assert way_back(of, LARGE) > 10 * before[0]


def test_a_slow_small_answer_does_not_make_large_ones_look_endless():
    of = AnswerTime()
    note(of, SMALL, writing=0.03)
    assert way_back(of, LARGE) < 1.0


def test_planned_unloading_is_traced_at_its_own_pace():
    of = AnswerTime()
    size = expected_size(LARGE)
    of.traced(LARGE, size, 0.01)
    assert of.tracing(planned(LARGE), size) == pytest.approx(0.01)
    of.traced(planned(LARGE), size, 0.10)
    assert of.tracing(LARGE, size) == pytest.approx(0.01)
    assert of.tracing(planned(LARGE), size) == pytest.approx(0.10)
    # What a search does after its time with planned unloading is kept back before any has shown it.
    assert of.late("ga", planned(LARGE)) == pytest.approx(0.20)
    assert of.late("ga", LARGE) == 0.0


def test_reasons_have_a_floor_and_no_more_than_a_share_of_the_time():
    of = AnswerTime()
    assert looking(of, LARGE, 0.5) == pytest.approx(0.025)
    assert looking(of, LARGE, 0.2) == pytest.approx(0.02)
    assert looking(of, LARGE, 100.0) == pytest.approx(0.2)
    assert looking(of, LARGE, 0.04) == pytest.approx(0.01)
    assert looking(of, LARGE, -1.0) == 0.0
    note(of, LARGE, looking=0.5)
    assert looking(of, LARGE, 100.0) == pytest.approx(0.5)
    assert looking(of, LARGE, 1.0) == pytest.approx(0.25)


def test_answers_without_unmet_needs_do_not_lower_what_reasons_get():
    of = AnswerTime()
    for _ in range(3):
        note(of, LARGE, looking=0.5)
    for _ in range(50):
        note(of, LARGE, looking=0.0, size=AnswerSize(300, 0))
    assert looking(of, LARGE, 100.0) == pytest.approx(0.5)


def test_reasons_that_were_not_finished_took_at_least_that_long():
    of = AnswerTime()
    for _ in range(16):
        note(of, LARGE, looking=0.5)
    # Hurried from the beginning, they say nothing; that they are found no sooner is known.
    for _ in range(50):
        note(of, LARGE, looking=0.0, finished=False)
    assert looking(of, LARGE, 100.0) == pytest.approx(0.5)
    for _ in range(2):
        note(of, LARGE, looking=0.6, finished=False)
    assert looking(of, LARGE, 100.0) == pytest.approx(0.9)


def test_an_algorithm_that_would_only_prepare_is_not_begun_and_tried_again_later():
    of = Preparations()
    assert not of.are_too_long("ga", LARGE, 0.001)
    for _ in range(2):
        of.took("ga", LARGE, 0.1)
    assert of.are_too_long("ga", LARGE, 0.05)
    assert not of.are_too_long("ga", LARGE, 0.2)
    # Neither other sizes nor other algorithms are judged by it.
    assert not of.are_too_long("ga", LARGER, 0.05)
    assert not of.are_too_long("greedy", LARGE, 0.05)
    refused = 0
    while of.are_too_long("ga", LARGE, 0.05):
        refused += 1
    assert 0 < refused < 10


def test_an_algorithm_that_was_slow_once_is_begun_again():
    """Code was loaded, or the machine was busy: the next search is not left out for that."""
    of = Preparations()
    for _ in range(5):
        of.took("auto", LARGE, 4.5)
        assert not of.are_too_long("auto", LARGE, 0.9)
        of.ended_in_time("auto", LARGE)
    of.took("auto", LARGE, 4.5)
    of.took("auto", LARGE, 2.0)
    assert of.are_too_long("auto", LARGE, 0.9)
    assert of.expected("auto", LARGE) < 2.0


def test_a_trial_tells_of_other_sizes_and_is_never_forgotten():
    of = Preparations()
    many_uavs, few = (generate("uniform", m, 1, 2, RNG) for m in (800, 100))
    of.tried("qmix", few, 0.05)
    of.tried("qmix", LARGE, 0.3)
    # In proportion to the work of the nearest trial: UAVs count twice, as each looks at all others.
    assert of.expected("qmix", many_uavs) == pytest.approx(0.05 * 800 * 801 / (100 * 101), rel=1e-3)
    for _ in range(100):
        assert of.are_too_long("qmix", many_uavs, 0.5)
    assert not of.are_too_long("qmix", few, 0.5)
    assert of.expected("qmix", planned(few)) == pytest.approx(0.05)


class Clock:
    """A worker's context whose time passes as the test says."""

    def __init__(self, monkeypatch, limit_s):
        self.now = 100.0
        monkeypatch.setattr("app.jobs.worker.time.monotonic", lambda: self.now)
        control = new_control()
        control[DEADLINE] = self.now + limit_s
        self.context = WorkContext(lambda _progress: None, control)


def test_a_search_that_stops_late_is_stopped_sooner_the_next_time(monkeypatch):
    times = AnswerTime()

    def stops_before(limit_s):
        clock = Clock(monkeypatch, limit_s)
        limit = TimeLimit(clock.context, times, SMALL, None)
        assert not limit.leaves_none_for("auto")
        return clock, limit, limit.searching.seconds_left()

    clock, limit, had_s = stops_before(1.0)
    clock.now += had_s + 0.03
    limit.searched("auto")

    _, limit, has_s = stops_before(1.0)
    assert has_s == pytest.approx(had_s - 0.03)
    assert TimeLimit(Clock(monkeypatch, 1.0).context, times, SMALL, None).leaves_none_for("ga") is False


def test_a_search_that_has_only_prepared_is_known_by_all_it_took(monkeypatch):
    times = AnswerTime()
    for _ in range(2):
        clock = Clock(monkeypatch, 1.0)
        limit = TimeLimit(clock.context, times, SMALL, None)
        assert not limit.leaves_none_for("qmix")
        clock.now += 5.0
        limit.searched("qmix")

    assert times.preparations.expected("qmix", SMALL) == pytest.approx(5.0)
    assert TimeLimit(Clock(monkeypatch, 4.0).context, times, SMALL, None).leaves_none_for("qmix")
    assert not TimeLimit(Clock(monkeypatch, 9.0).context, times, SMALL, None).leaves_none_for("qmix")


def test_reasons_stop_before_the_time_of_the_bound_and_a_cancelled_search_has_them_all(monkeypatch):
    clock = Clock(monkeypatch, 6.0)
    limit = TimeLimit(clock.context, AnswerTime(), SMALL, 100.0)
    assert limit.searching.seconds_left() < limit.bounding.seconds_left() - 1.9
    clock.now += limit.searching.seconds_left()
    assert not limit.hurries()
    clock.context._control[0] = 1.0
    assert not limit.hurries()
    assert limit.searching()
    # The bound has a third of what way back, tracing and reasons leave of the six seconds.
    clock.now += 0.21
    assert limit.hurries()
    assert limit.bounding.seconds_left() == pytest.approx(1.92, abs=0.02)


def test_what_stands_in_is_stopped_as_much_earlier_as_it_was_late(monkeypatch):
    times, problem = AnswerTime(), planned(LARGE)

    def begin(limit_s):
        clock = Clock(monkeypatch, limit_s)
        limit = TimeLimit(clock.context, times, problem, None)
        limit.stand_in("greedy")
        return clock, limit, limit.standing_in.seconds_left()

    clock, limit, had_s = begin(1.0)
    clock.now += had_s + 0.2
    limit.stood_in("greedy")
    assert begin(1.0)[2] == pytest.approx(had_s - 0.2)

    # One that has no time from the beginning is late by what it takes itself.
    times = AnswerTime()
    clock, limit, _ = begin(-5.0)
    clock.now += 0.2
    limit.stood_in("greedy")
    assert times.late("greedy", problem) == pytest.approx(0.2)
