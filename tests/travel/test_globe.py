"""Ways round zones on the globe."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import square, star_scene

from app.domain.geometry import EARTH_RADIUS_KM
from app.domain.plane import BeyondProjection
from app.travel.choice import legs_between
from app.travel.headings import heading


def arc(a, b):
    """Length of a great circle's arc, by the cosine rule."""
    (x_a, y_a), (x_b, y_b) = (map(math.radians, point) for point in (a, b))
    cosine = math.sin(y_a) * math.sin(y_b) + math.cos(y_a) * math.cos(y_b) * math.cos(x_b - x_a)
    return EARTH_RADIUS_KM * math.acos(cosine)


def lengths(places, zones):
    every = np.arange(len(places))
    places, zones = np.array(places, dtype=float), [np.array(zone, dtype=float) for zone in zones]
    return legs_between("wgs84", places, zones).between(every[:, None], every).ground


def test_along_the_equator_round_a_zone_on_it():
    zone = [(4, -1), (6, -1), (6, 1.5), (4, 1.5)]
    expected = arc((0, 0), (4, -1)) + arc((4, -1), (6, -1)) + arc((6, -1), (10, 0))
    assert lengths([(0, 0), (10, 0)], [zone])[0, 1] == pytest.approx(expected, rel=1e-12)


def test_a_side_is_an_arc_of_a_great_circle():
    # The arc from (-20, 50) to (20, 50) reaches 51.74 degrees north, where a line of the map stays at 50.
    summit = math.degrees(math.atan(math.tan(math.radians(50)) / math.cos(math.radians(20))))
    zone = [(-20, 50), (20, 50), (20, 40), (-20, 40)]
    places = [(-25, summit - 0.01), (25, summit - 0.01), (0, summit - 0.01), (0, summit + 0.01)]
    found = lengths(places, [zone])
    assert np.isinf(found[2]).all()
    assert np.isfinite(found[3, [0, 1]]).all()
    assert found[0, 1] == pytest.approx(arc(places[0], places[1]), rel=1e-9)


@pytest.mark.parametrize("east", [0.0, 85.0, 174.0, 179.0])
def test_a_scene_is_the_same_at_every_longitude(east):
    def moved(points):
        return [((x + east + 180.0) % 360.0 - 180.0, y) for x, y in points]

    places, zone = [(0, 20), (10, 21), (3, 24)], [(4, 19), (6, 19), (6, 22.5), (4, 22.5)]
    np.testing.assert_allclose(lengths(moved(places), [moved(zone)]), lengths(places, [zone]), rtol=1e-12)


def test_over_the_pole_round_a_zone_on_it():
    zone = [(0, 89), (90, 89), (180, 89), (-90, 89)]
    places = [(45, 85), (-135, 85)]
    expected = arc((45, 85), (90, 89)) + arc((90, 89), (180, 89)) + arc((180, 89), (-135, 85))
    assert lengths(places, [zone])[0, 1] == pytest.approx(expected, rel=1e-9)


def test_a_scene_of_some_metres_is_that_of_a_plane():
    degree = EARTH_RADIUS_KM * math.pi / 180
    metre = 0.001 / degree

    def on_globe(points):
        return [(139.7 + x * metre / math.cos(math.radians(35.6)), 35.6 + y * metre) for x, y in points]

    found = lengths(on_globe([(-1, 2), (5, 2)]), [on_globe(square(0, 0, 4))])[0, 1]
    assert found * 1000 == pytest.approx(2 * math.sqrt(5) + 4, rel=1e-5)


@settings(max_examples=25)
@given(st.integers(0, 2**32), st.sampled_from([(85.0, 27.0), (179.5, -40.0), (0.0, 80.0)]))
def test_lengths_are_a_metric(seed, place):
    places, zones = star_scene(np.random.default_rng(seed), places=12, zones=5, corners=7)
    every = np.arange(12)
    places, zones = places + place, [zone + place for zone in zones]
    legs = legs_between("wgs84", places, zones)
    ground = legs.between(every[:, None], every).ground
    straight = legs_between("wgs84", places).between(every[:, None], every).ground
    assert np.array_equal(ground, ground.T)
    assert (ground >= straight * (1 - 1e-12)).all()
    assert (ground <= (ground[:, :, None] + ground[None]).min(axis=1) * (1 + 1e-9)).all()
    for a, b in pairwise(every):
        way = legs.way(a, b, 60.0)
        assert (way is None) == np.isinf(ground[a, b])
        assert way is None or way.ground.sum() == pytest.approx(ground[a, b], rel=1e-12)


def test_what_is_too_far_from_the_middle_is_said():
    zone = np.array([(59.0, -1.0), (61.0, -1.0), (60.0, 1.0)])
    legs_between("wgs84", np.array([(0.0, 0.0), (120.0, 0.0)]), [zone])
    with pytest.raises(BeyondProjection, match=r"60\.5.* degrees from the middle.* within 60 degrees"):
        legs_between("wgs84", np.array([(0.0, 0.0), (121.0, 0.0)]), [zone])
    with pytest.raises(BeyondProjection):
        legs_between("wgs84", np.array([(0.0, 0.0), (120.0, 0.0)]), [zone + np.array([119.0, 0.0])])


@pytest.mark.parametrize(
    ("a", "b", "bearing"),
    [
        ((0, 0), (0, 1), 0),
        ((0, 0), (1, 0), 90),
        ((0, 1), (0, 0), 180),
        ((-179, 0), (179, 0), 270),
        ((0, 45), (90, 45), math.degrees(math.atan2(1, math.sin(math.radians(45))))),
        ((7, 90), (7, 0), 180),
        ((5, 5), (5, 5), 0),
    ],
)
def test_initial_bearings(a, b, bearing):
    east, north = heading("wgs84", np.array(a, dtype=float), np.array(b, dtype=float))
    assert float(east) == pytest.approx(math.sin(math.radians(bearing)), abs=1e-15)
    assert float(north) == pytest.approx(math.cos(math.radians(bearing)), abs=1e-15)
