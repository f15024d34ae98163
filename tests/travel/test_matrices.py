"""Legs that a client gives as matrices."""

import numpy as np

from app.travel.matrices import MatrixLegs

INF = np.inf
DISTANCE = np.array([[0.0, 4.0, INF], [6.0, 0.0, 8.0], [2.0, 3.0, 0.0]])
DURATION = np.array([[0.0, 1.0, 1.0], [2.0, 0.0, INF], [5.0, 6.0, 0.0]])
PLACES = np.array([2, 0, 1, 1])


def test_times_follow_from_the_speed_where_no_duration_is_given():
    block = MatrixLegs(PLACES, DISTANCE).between(np.arange(2)[:, None], np.arange(4))
    assert block.ground.tolist() == [[0, 2, 3, 3], [INF, 0, 4, 4]]
    air, time = block.flown(4.0)
    assert air.tolist() == block.ground.tolist()
    assert time.tolist() == [[0, 0.5, 0.75, 0.75], [INF, 0, 1, 1]]


def test_a_duration_does_not_depend_on_the_speed():
    block = MatrixLegs(PLACES, DISTANCE, DURATION).between(np.array([0, 1, 3]), np.array([2, 2, 1]))
    assert block.ground.tolist() == [3, 4, 6]
    assert block.flown(4.0).time.tolist() == block.flown(400.0).time.tolist() == [6, 1, 2]


def test_a_leg_needs_both_figures():
    block = MatrixLegs(PLACES, DISTANCE, DURATION).between(np.array([1, 2]), np.array([0, 0]))
    assert (
        block.ground.tolist() == block.flown(1.0).air.tolist() == block.flown(1.0).time.tolist() == [INF, INF]
    )
