"""What legs take in wind, by hand and against fifty digits; and ways that do not depend on it."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import star_scene

from app.domain.geometry import EARTH_RADIUS_KM
from app.travel.choice import legs_between
from app.travel.wind import Wind

ONE = np.array(1.0)
SPEED = st.floats(1e-3, 1e3)


def leg(a, b, speed, wind, crs="local", zones=()):
    """Length over ground, air length and time of one leg."""
    legs = legs_between(crs, np.array([a, b], dtype=float), [np.array(z, dtype=float) for z in zones], wind)
    block = legs.between(np.array([0]), np.array([1]))
    air, time = block.flown(speed)
    return block.ground[0], air[0], time[0]


@pytest.mark.parametrize(
    ("b", "speed", "wind", "time"),
    [
        ((100, 0), 50, Wind(30, 90), 100 / 80),
        ((-100, 0), 50, Wind(30, 90), 100 / 20),
        ((0, 100), 50, Wind(30, 90), 100 / 40),
        ((0, -100), 50, Wind(30, 270), 100 / 40),
        ((100, 0), 10, Wind(12, 90), 100 / 22),
        ((-100, 0), 10, Wind(12, 90), math.inf),
        ((0, 100), 10, Wind(12, 90), math.inf),
        ((0, 100), 12, Wind(12, 90), math.inf),
        ((-100, 0), 12, Wind(12, 90), math.inf),
        ((30, 40), 5, Wind(3, 90), 50 / (1.8 + math.sqrt(25 - 2.4**2))),
        ((30, 40), 5, Wind(3, 180), 50 / (-2.4 + math.sqrt(25 - 1.8**2))),
        ((0, 0), 10, Wind(12, 90), 0),
    ],
)
def test_one_leg_by_hand(b, speed, wind, time):
    ground, air, found = leg((0, 0), b, speed, wind)
    assert ground == math.hypot(*b)
    assert found == pytest.approx(time, rel=1e-12)
    assert air == pytest.approx(time * speed, rel=1e-12)


def test_round_a_zone_each_piece_has_its_own_wind():
    zone = [(0, -4), (8, -4), (8, 5), (0, 5)]
    slant = 5 / (1.8 + math.sqrt(25 - 2.4**2))
    ground, air, time = leg((-3, 0), (11, 0), 5, Wind(3, 90), zones=[zone])
    assert ground == pytest.approx(18, rel=1e-12)
    assert time == pytest.approx(2 * slant + 8 / 8, rel=1e-12)
    assert air == pytest.approx(5 * time, rel=1e-12)


def test_a_way_that_the_wind_forbids_is_not_flown_another_way():
    # Round the near end of the wall it is against the wind for a while; round the far end it would not be.
    wall = [(0, -1), (1, -1), (1, 30), (0, 30)]
    places = [(-1, 1), (2, 1)]
    assert leg(*places, 10, Wind(12, 0), zones=[wall])[0] == pytest.approx(2 * math.sqrt(5) + 1, rel=1e-12)
    assert leg(*places, 10, Wind(12, 0), zones=[wall])[1:] == (math.inf, math.inf)
    assert leg(*places, 13, Wind(12, 0), zones=[wall])[2] < math.inf


def test_on_the_globe_the_initial_bearing_counts():
    ground, _, time = leg((0, 0), (10, 0), 60, Wind(20, 90), "wgs84")
    assert time == pytest.approx(ground / 80, rel=1e-12)
    # A quarter of the globe that sets out to the north-east.
    ground, _, time = leg((0, 0), (90, 45), 60, Wind(20, 0), "wgs84")
    assert ground == pytest.approx(EARTH_RADIUS_KM * math.pi / 2, rel=1e-12)
    assert time == pytest.approx(ground / (math.sqrt(200) + math.sqrt(3600 - 200)), rel=1e-12)


@given(SPEED, st.floats(0, 0.999), st.floats(0, 360), st.floats(0, math.tau))
def test_there_and_back(speed, share, towards, angle):
    wind, east, north = Wind(speed * share, towards), np.array(math.sin(angle)), np.array(math.cos(angle))
    both = wind.time(speed, ONE, east, north) + wind.time(speed, ONE, -east, -north)
    across = wind.speed * math.sin(math.radians(towards) - angle)
    expected = 2 * math.sqrt(speed**2 - across**2) / (speed**2 - wind.speed**2)
    assert float(both) == pytest.approx(expected, rel=1e-9)
    assert float(both) >= 2 / speed * (1 - 1e-12)


@given(SPEED, st.integers(1, 52))
def test_a_wind_nearly_as_fast_as_the_uav_loses_no_digits(speed, digits):
    wind = Wind(speed * (1 - 2.0**-digits), 0.0)
    with localcontext(prec=50):
        fast, slow = Decimal(speed), Decimal(wind.speed)
        across, against = float(1 / (fast**2 - slow**2).sqrt()), float(1 / (fast - slow))
    assert float(wind.time(speed, ONE, ONE, 0 * ONE)) == pytest.approx(across, rel=1e-14)
    assert float(wind.time(speed, ONE, 0 * ONE, -ONE)) == pytest.approx(against, rel=1e-14)


@pytest.mark.parametrize("crs", ["local", "wgs84"])
def test_a_wind_of_0_is_none(crs):
    places, zones = star_scene(np.random.default_rng(2), places=20, zones=4, corners=6)
    every = np.arange(20)
    for around in (zones, []):
        still, calm = (
            legs_between(crs, places, around, wind).between(every[:, None], every)
            for wind in (None, Wind(0.0, 77.0))
        )
        assert np.array_equal(still.ground, calm.ground)
        assert np.array_equal(still.flown(7.0).air, calm.ground)
        assert np.array_equal(still.flown(7.0).time, calm.ground / 7.0)
        assert np.array_equal(calm.flown(7.0).time, still.flown(7.0).time)


@settings(max_examples=25)
@given(
    st.integers(0, 2**32),
    st.sampled_from(["local", "wgs84"]),
    st.floats(0, 360),
    st.sampled_from([8.0, 15.0]),
)
def test_blocks_say_what_ways_say(seed, crs, towards, speed):
    rng = np.random.default_rng(seed)
    places, zones = star_scene(rng, places=10, zones=5, corners=7)
    # A place at a corner and one on a side: pieces of no length, and pieces along a side.
    places[:2] = zones[0][0], (zones[1][0] + zones[1][1]) / 2
    legs = legs_between(crs, places, zones, Wind(10.0, towards))
    every = rng.permutation(10)
    block = legs.between(every[:, None], every)
    air, time = block.flown(speed)
    for row, a in enumerate(every):
        for column, b in enumerate(every):
            way = legs.way(a, b, speed)
            if way is None:
                assert air[row, column] == time[row, column] == np.inf
                continue
            assert way.ground.sum() == pytest.approx(block.ground[row, column], rel=1e-12)
            assert way.time.sum() == pytest.approx(time[row, column], rel=1e-12)
            assert way.air.sum() == pytest.approx(air[row, column], rel=1e-12)
            assert len(way.points) == len(way.ground) + 1
            assert (way.ground > 0).all() or len(way.ground) == 1
    some, others = every[:6], every[4:]
    part = legs.between(some[:, None], others).flown(speed)
    assert np.array_equal(part.time, time[:6, 4:])
    assert np.array_equal(
        legs.between(some, every[::-1][:6]).flown(speed).time, np.diagonal(time[:6, ::-1][:, :6])
    )
