"""The compiled distances are the plain ones; a problem is compiled once."""

import gc
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.domain.geometry import distance
from app.simulation import arrays
from app.simulation.arrays import compile_problem
from app.simulation.distances import between_points
from app.simulation.generator import generate

TINY = st.sampled_from([0.0, 1e-300, -1e-200, 1e-160, 3e-9, 1e-6])
PLANE = st.one_of(TINY, st.floats(-1e12, 1e12))
LONGITUDE, LATITUDE = (st.one_of(TINY, st.floats(-limit, limit)) for limit in (180.0, 90.0))


def points(x, y):
    return st.lists(st.tuples(x, y), min_size=1, max_size=6)


def check(crs, a, b):
    one, other = np.array(a), np.array(b)
    for left, right in ((one, other), (one, one)):
        found = between_points(crs, left, right)
        expected = [[distance(crs, *p, *q) for q in right.tolist()] for p in left.tolist()]
        # Haversines near the antipode, and chords of a few metres, are good for as many digits.
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=0)


@given(points(PLANE, PLANE), points(PLANE, PLANE))
def test_planar_distances(a, b):
    check("local", a, b)


@given(points(LONGITUDE, LATITUDE), points(LONGITUDE, LATITUDE))
def test_great_circles(a, b):
    check("wgs84", a, b)


@pytest.mark.parametrize("crs", ["local", "wgs84"])
def test_distances_of_a_point_to_itself_are_zero(crs):
    here = np.array([[12.3456789, -45.6789], [179.99, 89.99], [0.0, 0.0]])
    assert between_points(crs, here, here.copy()).diagonal().tolist() == [0.0] * 3


def test_a_quarter_of_the_earth():
    found = between_points("wgs84", np.array([[0.0, 0.0]]), np.array([[90.0, 0.0], [0.0, 90.0]]))
    assert found[0] == pytest.approx([6371.0088 * math.pi / 2] * 2, rel=1e-14)


def test_a_problem_is_compiled_once_and_its_arrays_go_with_it():
    rng = np.random.default_rng(3)
    problem, equal = (generate("mid_mission", 3, 4, 2, rng) for _ in range(2))
    first = compile_problem(problem)
    assert compile_problem(problem) is first
    assert compile_problem(equal) is not first
    assert arrays._newest[0]() is equal
    del equal
    gc.collect()
    assert arrays._newest is None
