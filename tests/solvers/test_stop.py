"""Criteria for stopping: each says truly how long it leaves, alone and put together."""

import math
import threading

import pytest

from app.solvers.stop import Deadline, EarlierOf, Never, Sooner, WhenSet, WhileSpare, never, share_of_time


class Clock:
    """Stands still until it is moved."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def test_never_stops_and_has_no_limit():
    assert isinstance(never, Never)
    assert (never(), never.seconds_left()) == (False, math.inf)


def test_a_deadline_tells_the_time_that_is_left(clock):
    stop = Deadline(5.0, clock)
    assert (stop(), stop.seconds_left()) == (False, 5.0)
    clock.now += 5.0
    assert (stop(), stop.seconds_left()) == (True, 0.0)
    clock.now += 2.0
    assert (stop(), stop.seconds_left()) == (True, -2.0)
    assert Deadline(math.inf, clock).seconds_left() == math.inf


def test_the_earlier_of_several_counts(clock):
    stop = EarlierOf(never, Deadline(5.0, clock), Deadline(3.0, clock))
    assert (stop(), stop.seconds_left()) == (False, 3.0)
    clock.now += 3.0
    assert (stop(), stop.seconds_left()) == (True, 0.0)
    assert EarlierOf(never, never).seconds_left() == math.inf


def test_sooner_is_earlier_by_its_seconds_where_there_is_a_limit(clock):
    stop = Sooner(Deadline(5.0, clock), 2.0)
    assert (stop(), stop.seconds_left()) == (False, 3.0)
    clock.now += 3.0
    assert (stop(), stop.seconds_left()) == (True, 0.0)
    assert (Sooner(never, 2.0)(), Sooner(never, 2.0).seconds_left()) == (False, math.inf)


def test_sooner_stops_when_the_other_is_told_to():
    event = threading.Event()
    stop = Sooner(WhenSet(event), 2.0)
    assert not stop()
    event.set()
    assert stop()


def test_a_share_is_of_the_time_that_is_left_when_it_is_made(clock):
    whole = Deadline(10.0, clock)
    clock.now += 5.0
    first = share_of_time(whole, 0.2)
    assert first.seconds_left() == pytest.approx(1.0)
    clock.now += 1.0
    assert (first(), whole()) == (True, False)
    assert share_of_time(never, 0.2) is never
    clock.now += 100.0
    assert share_of_time(whole, 0.2)()


def test_idle_threads_end_when_they_are_needed_and_know_the_time(clock):
    spare = [2]
    stop = WhileSpare(Deadline(5.0, clock), lambda: spare[0], 2)
    assert (stop(), stop.seconds_left()) == (False, 5.0)
    spare[0] = 1
    assert stop()
    spare[0] = 2
    clock.now += 5.0
    assert (stop(), stop.seconds_left()) == (True, 0.0)


def test_an_event_stops_and_has_no_limit():
    event = threading.Event()
    stop = WhenSet(event)
    assert (stop(), stop.seconds_left()) == (False, math.inf)
    event.set()
    assert stop()
