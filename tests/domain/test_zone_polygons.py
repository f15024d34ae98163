"""Polygons of no-fly zones: which are none, and which are, on the plane and on the globe."""

import math
import re
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from problem_changes import BASE, SQUARE, violations, with_zone

from app.domain.errors import InvalidProblem
from app.domain.surroundings import NoFlyZone


def crosses(polygon):
    """Whether a polygon is refused for that, and for nothing else."""
    try:
        replace(BASE, **with_zone(*polygon))
    except InvalidProblem as error:
        return all("crosses" in each.detail for each in error.violations)
    return False


@pytest.mark.parametrize(
    ("polygon", "said"),
    [
        (SQUARE[:2], "2 corners; at least 3 are needed"),
        ((*SQUARE[:2], SQUARE[0]), "2 corners; at least 3 are needed"),
        ((SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]), "crosses"),
        (((0.0, 0.0), (1.0, 1.0), (3.0, 3.0)), "has no area"),
        (((0.0, 0.0), (0.1, 0.1), (0.3, 0.3), (0.2, 0.2)), "has no area"),
        (((1.0, 1.0),) * 4, "2 corners|has no area"),
        # There and back again, with a bend.
        (((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (1.0, 0.0)), "has no area"),
        # Two loops of opposite direction, whose areas cancel.
        (((0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (2.0, 0.0), (1.0, 1.0), (0.0, 2.0)), "has no area"),
        (
            ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (4.0, -1.0), (0.0, 9.0)),
            r"from \(0, 0\) to \(9, 0\) crosses that",
        ),
    ],
)
def test_a_polygon_that_is_none_is_refused(polygon, said):
    found = violations(**with_zone(*polygon))
    assert found
    for pointer, detail in found:
        assert pointer.startswith("/no_fly_zones/1/polygon")
        assert re.search(said, detail)


@pytest.mark.parametrize(
    "polygon",
    [
        SQUARE,
        SQUARE[::-1],
        # Closed as in GeoJSON.
        (*SQUARE, SQUARE[0]),
        # A corner on a side, a corner that is there twice, a side along another one.
        ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 0.0), (0.0, 4.0)),
        (SQUARE[0], *SQUARE),
        ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (3.0, 0.0), (1.0, 0.0), (0.0, 4.0)),
        # Thin, and small.
        ((0.0, 0.0), (4.0, 1e-6), (4.0, 2e-6)),
        ((1.0, 1.0), (1.0 + 1e-7, 1.0), (1.0, 1.0 + 1e-7)),
    ],
)
def test_a_polygon_that_only_touches_itself_is_taken(polygon):
    zones = replace(BASE, **with_zone(*polygon)).no_fly_zones
    assert zones[0].polygon == SQUARE
    assert zones[1].polygon == (polygon[:-1] if polygon[0] == polygon[-1] else polygon)


@given(
    angles=st.lists(st.floats(0, 2 * math.pi), min_size=3, max_size=12, unique=True),
    radii=st.lists(st.floats(1, 5), min_size=12, max_size=12),
    data=st.data(),
)
def test_star_shaped_polygons_are_taken_and_exchanged_corners_are_judged_as_exact_arithmetic_does(
    angles, radii, data
):
    angles = sorted(angles)
    gaps = [b - a for a, b in zip(angles, [*angles[1:], angles[0] + 2 * math.pi], strict=True)]
    if min(gaps) < 0.01 or max(gaps) > 3.1:
        return
    star = [(r * math.cos(a), r * math.sin(a)) for a, r in zip(angles, radii, strict=False)]
    replace(BASE, **with_zone(*star))
    a, b = data.draw(st.tuples(*[st.integers(0, len(star) - 1)] * 2))
    star[a], star[b] = star[b], star[a]

    def left(p, q, r):
        (px, py), (qx, qy), (rx, ry) = ((Fraction(x), Fraction(y)) for x, y in (p, q, r))
        area = (qx - px) * (ry - py) - (qy - py) * (rx - px)
        # What goes beyond a side by rounding only touches it.
        assume(r in (p, q) or abs(area) > 1e-6)
        return (area > 0) - (area < 0)

    sides = list(zip(star, [*star[1:], star[0]], strict=True))
    crossing = any(
        left(*one, other[0]) * left(*one, other[1]) < 0 and left(*other, one[0]) * left(*other, one[1]) < 0
        for k, one in enumerate(sides)
        for other in sides[k + 1 :]
    )
    assert crossing == crosses(star)


def globe(*polygon, far=(0.0, 4.0)):
    target = replace(BASE.targets[0], x=far[0], y=far[1])
    return replace(
        BASE, crs="wgs84", targets=(target, BASE.targets[1]), no_fly_zones=(NoFlyZone("z", polygon),)
    )


def test_on_the_globe_sides_are_great_circles():
    # In the middle between the first two the great circle is at 60.38 degrees north.
    ends = ((0.0, 60.0), (20.0, 60.0))
    far = (1.0, 50.0)
    globe(*ends, (10.0, 60.2), far=far)
    globe(*ends, (10.0, 60.6), far=far)
    with pytest.raises(InvalidProblem, match="crosses"):
        globe(*ends, (12.0, 60.2), (10.0, 60.6), far=far)
    globe(*ends, (12.0, 60.5), (10.0, 60.6), far=far)


def test_on_the_globe_a_zone_may_lie_across_the_antimeridian():
    places = {"x_s": 179.0, "x_c": 179.0, "y_s": 0.0, "y_c": 0.0}
    problem = replace(
        BASE,
        crs="wgs84",
        uavs=tuple(replace(uav, **places) for uav in BASE.uavs),
        targets=tuple(replace(target, x=-179.0) for target in BASE.targets),
        no_fly_zones=(NoFlyZone("z", ((179.5, 1.0), (-179.5, 1.0), (-179.5, 2.0), (179.5, 2.0))),),
    )
    assert problem.extent < 600.0


@pytest.mark.parametrize(
    ("polygon", "far", "pointer"),
    [
        (SQUARE, (125.0, 0.0), "/targets/0/x"),
        (((125.0, 0.0), (124.0, 0.0), (124.0, 1.0)), (1.0, 0.0), "/no_fly_zones/0/polygon/0"),
    ],
)
def test_on_the_globe_all_lies_within_60_degrees_of_the_middle(polygon, far, pointer):
    with pytest.raises(InvalidProblem) as caught:
        globe(*polygon, far=far)
    (violation,) = caught.value.violations
    assert violation.pointer == pointer or violation.pointer.startswith("/uavs/")
    assert "within 60 degrees" in violation.detail
    assert (
        replace(BASE, crs="wgs84", targets=(replace(BASE.targets[0], x=125.0), BASE.targets[1])).n_targets
        == 2
    )


def test_a_zone_of_very_many_corners_is_looked_at_in_parts():
    around = [(math.cos(a), math.sin(a)) for a in np.linspace(0, 2 * math.pi, 700, endpoint=False)]
    replace(BASE, **with_zone(*around))
    around[400], around[600] = around[600], around[400]
    assert "crosses" in violations(**with_zone(*around))[0][1]
