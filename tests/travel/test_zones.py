"""Ways round zones on a plane: by hand, against exact arithmetic, and what holds for all of them."""

import math

import numpy as np
import pytest
from exact_ways import ExactWays
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import square, star_scene
from shapely import LineString, MultiPoint, Polygon, union_all

from app.travel.choice import legs_between

STEP = st.integers(0, 7)


def lengths(places, zones):
    """Lengths of all legs between some places."""
    every = np.arange(len(places))
    return (
        legs_between("local", array(places), [array(zone) for zone in zones])
        .between(every[:, None], every)
        .ground
    )


def array(points):
    return np.array(points, dtype=np.float64)


def length(a, b, *zones):
    return lengths([a, b], zones)[0, 1]


@st.composite
def zone(draw):
    """Corners of a polygon whose sides do not cross."""
    corners = draw(st.lists(st.tuples(STEP, STEP), min_size=3, max_size=6, unique=True))
    x, y = np.mean(corners, axis=0) + np.array([0.01, 0.013])
    corners.sort(key=lambda c: math.atan2(c[1] - y, c[0] - x))
    polygon = Polygon(corners)
    return corners if polygon.is_valid and polygon.area > 0 else [(0, 0), (3, 1), (1, 4)]


ZONES = st.lists(zone(), min_size=1, max_size=3)
PLACES = st.lists(st.tuples(*[st.integers(-2, 16).map(lambda n: n / 2)] * 2), min_size=2, max_size=3)


@settings(max_examples=80)
@given(ZONES, PLACES)
def test_lengths_are_those_of_exact_arithmetic(zones, places):
    exact = ExactWays(zones)
    expected = [[exact.length(a, b) for b in places] for a in places]
    np.testing.assert_allclose(lengths(places, zones), expected, rtol=1e-9)


@settings(max_examples=60)
@given(ZONES, PLACES, st.floats(0, math.tau), st.floats(-9, 11), STEP, STEP)
def test_what_touches_exactly_touches_after_rounding_too(zones, places, angle, exponent, x, y):
    scale, turned = (
        10.0**exponent,
        array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]]),
    )

    def moved(points):
        return (array(points) @ turned + (10 * x, -10 * y)) * scale

    expected = lengths(places, zones)
    found = lengths(moved(places), [moved(corners) for corners in zones])
    np.testing.assert_allclose(found / scale, expected, rtol=1e-7, atol=1e-7)


@settings(max_examples=40)
@given(st.integers(0, 2**32))
def test_lengths_are_a_metric_and_ways_stay_outside(seed):
    places, zones = star_scene(np.random.default_rng(seed), places=12, zones=5, corners=7)
    every = np.arange(len(places))
    legs = legs_between("local", places, zones)
    ground = legs.between(every[:, None], every).ground
    straight = legs_between("local", places).between(every[:, None], every).ground
    assert np.array_equal(ground, ground.T)
    assert (ground >= straight * (1 - 1e-12)).all()
    over_a_third = (ground[:, :, None] + ground[None]).min(axis=1)
    assert (ground <= over_a_third * (1 + 1e-9)).all()

    inside = union_all([Polygon(corners) for corners in zones]).buffer(-1e-6)
    corners = MultiPoint(np.concatenate(zones))
    for a in every:
        for b in every:
            way = legs.way(a, b, 2.0)
            if way is None:
                assert ground[a, b] == np.inf
                continue
            assert way.ground.sum() == pytest.approx(ground[a, b], rel=1e-12)
            assert np.array_equal(way.points[[0, -1]], places[[a, b]])
            assert LineString(way.points).disjoint(inside)
            assert all(corners.distance(turn) == 0 for turn in MultiPoint(way.points[1:-1]).geoms)
            assert np.array_equal(way.points, legs.way(b, a, 2.0).points[::-1])


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ((-1, 2), (5, 2), 2 * math.sqrt(5) + 4),
        ((-1, 4), (5, 4), 6),
        ((0, 1), (0, 3), 2),
        ((0, 0), (4, 0), 4),
        ((0, 0), (4, 4), 8),
        ((-1, -1), (0, 0), math.sqrt(2)),
        ((-2, 2), (2, 6), 4 * math.sqrt(2)),
        ((1, 0), (4, 1), 4),
        ((2, 2), (9, 9), math.inf),
        ((2, 2), (2, 2), math.inf),
        ((0, 2), (0, 2), 0),
    ],
    ids=[
        "past it",
        "along a side and past both ends",
        "on one side",
        "corner to corner",
        "across",
        "to a corner",
        "touching a corner",
        "round a corner from the border",
        "out of it",
        "within",
        "on the border",
    ],
)
def test_one_square(a, b, expected):
    assert length(a, b, square(0, 0, 4)) == pytest.approx(expected, rel=1e-12)


def test_there_is_no_way_between_zones_that_share_a_corner():
    left, right = square(0, 0, 4), square(4, 4, 4)
    # From the notch above to the notch below: round the upper square, or the lower one.
    assert length((2, 6), (6, 2), left, right) == pytest.approx(2 * math.dist((2, 6), (4, 8)) + 8, rel=1e-12)
    # To the corner itself there is a way from both.
    assert length((2, 6), (4, 4), left, right) == pytest.approx(math.sqrt(8), rel=1e-12)
    assert length((6, 2), (4, 4), left, right) == pytest.approx(math.sqrt(8), rel=1e-12)


def test_there_is_no_way_between_zones_that_share_a_side_or_part_of_one():
    assert length((4, -1), (4, 5), square(0, 0, 4), square(4, 0, 4)) == pytest.approx(
        2 * math.sqrt(17) + 4, rel=1e-12
    )
    assert length((4, -1), (4, 7), square(0, 0, 4), square(4, 2, 4)) == pytest.approx(
        math.sqrt(17) + 4 + 5, rel=1e-12
    )


def test_there_is_no_way_past_a_corner_that_touches_a_side():
    needle = [(4, 2), (8, 1), (8, 3)]
    along_the_side = length((4, 0), (4, 4), square(0, 0, 4), needle)
    assert along_the_side == pytest.approx(2 * math.sqrt(17) + 2, rel=1e-12)


def test_a_gap_between_zones_is_a_way():
    gap = 1e-4
    through = length((4 + gap / 2, -1), (4 + gap / 2, 5), square(0, 0, 4), square(4 + gap, 0, 4))
    assert through == pytest.approx(6, rel=1e-12)


def test_nothing_leaves_a_hole():
    ring = [
        [(0, 0), (10, 0), (10, 2), (0, 2)],
        [(0, 8), (10, 8), (10, 10), (0, 10)],
        [(0, 0), (2, 0), (2, 10), (0, 10)],
        [(8, 0), (10, 0), (10, 10), (8, 10)],
    ]
    post = square(4, 4, 2)
    found = lengths([(3, 5), (7, 5), (12, 5), (2, 2)], [*ring, post])
    assert found[0, 1] == pytest.approx(2 * math.sqrt(2) + 2, rel=1e-12)
    assert np.isinf(found[:2, 2]).all()
    assert found[0, 3] == pytest.approx(math.dist((3, 5), (2, 2)), rel=1e-12)


def test_a_zone_within_a_zone_changes_nothing():
    assert length((-1, 2), (5, 2), square(0, 0, 4), square(1, 1, 2)) == length(
        (-1, 2), (5, 2), square(0, 0, 4)
    )


def test_out_of_a_bay():
    bay = [(0, 0), (6, 0), (6, 4), (4, 4), (4, 1), (2, 1), (2, 4), (0, 4)]
    expected = math.dist((3, 2), (4, 4)) + 2 + math.dist((6, 4), (8, 2))
    assert length((3, 2), (8, 2), bay) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "shape",
    [
        [(0, 0), (2, 0), (4, 0), (4, 4), (0, 4)],
        [(0, 0), (4, 0), (4, 0), (4, 4), (0, 4), (0, 0)],
        [(0, 4), (4, 4), (4, 0), (0, 0)],
    ],
    ids=["a corner within a side", "corners twice", "clockwise"],
)
def test_one_square_in_other_words(shape):
    assert length((-1, 2), (5, 2), shape) == pytest.approx(2 * math.sqrt(5) + 4, rel=1e-12)


def test_a_zone_without_area_is_in_nobodys_way():
    assert length((1, -1), (1, 1), [(0, 0), (2, 0), (4, 0)]) == 2


@pytest.mark.parametrize("scale", [1e-100, 1e-9, 1e9, 1e12])
def test_tiny_and_huge_scenes(scale):
    place, shape = array([(-1, 2), (5, 2)]) * scale, array(square(0, 0, 4)) * scale
    assert lengths(place, [shape])[0, 1] / scale == pytest.approx(2 * math.sqrt(5) + 4, rel=1e-12)


def test_a_small_scene_far_from_the_origin():
    offset = array([1e12, -1e12])
    place, shape = array([(-1, 2), (5, 2)]) + offset, array(square(0, 0, 4)) + offset
    assert lengths(place, [shape])[0, 1] == pytest.approx(2 * math.sqrt(5) + 4, rel=1e-12)


def test_all_in_one_place():
    assert lengths([(1, 1), (1, 1)], [[(1, 1), (1, 1), (1, 1)]]).tolist() == [[0, 0], [0, 0]]


def test_blocks_of_any_shape_agree():
    rng = np.random.default_rng(5)
    places, zones = star_scene(rng, places=40, zones=6, corners=8)
    legs = legs_between("local", places, zones)
    every = np.arange(40)
    whole = legs.between(every[:, None], every).ground
    some, others = rng.permutation(40)[:15], rng.permutation(40)[:15]
    assert np.array_equal(legs.between(some[:, None], others).ground, whole[np.ix_(some, others)])
    np.testing.assert_array_equal(legs.between(some, others).ground, whole[some, others])
    assert (whole > legs_between("local", places).between(every[:, None], every).ground).any()
