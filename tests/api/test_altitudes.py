"""Altitudes of legs: those that come near each other are apart, and change over stops only."""

import json
from itertools import combinations, pairwise

import numpy as np
import pytest
from mission_files import LAND, PLACE, RETURN, TAKEOFF, WAYPOINT, check_as_qgroundcontrol, commands

from app.api.plan_formats.altitudes import AltitudeBy, LegOf, Separation
from app.api.plan_formats.briefing import briefing
from app.api.plan_formats.errors import OutOfRange
from app.api.plan_formats.flown_plan import flown_plan
from app.api.plan_formats.launches import planned_flights
from app.api.plan_formats.map_files import gpx, kml
from app.api.plan_formats.mission import Altitude, AltitudeReference, Delivery, Ending, FlightChoices
from app.api.plan_formats.qgroundcontrol import plan_file, waypoint_file
from app.domain.plan import Plan
from app.domain.problem import UAV, Problem, Target
from app.domain.records import to_record
from app.domain.surroundings import Base, NoFlyZone
from app.simulation.explain import explain

HOME, TERRAIN = AltitudeReference.HOME, AltitudeReference.TERRAIN
BY_LEG = Separation(altitude_by=AltitudeBy.LEG)
PLAIN = FlightChoices(delivery=Delivery.NONE)
EARTH_M = 6_371_008.8


def flown(starts, targets, rows, *, bases=(), zones=()):
    problem = Problem(
        uavs=tuple(
            UAV(f"u{n}", *at, *at, 60.0, 3000.0, (9.0,), full_load=(9.0,)) for n, at in enumerate(starts)
        ),
        targets=tuple(Target(f"a{n}", x, y, 1.0, (1.0,)) for n, (x, y) in enumerate(targets)),
        bases=bases,
        no_fly_zones=zones,
        crs="wgs84",
    )
    answer = {**to_record(explain(problem, Plan(rows))), "job_id": "0" * 32, "algorithm": "greedy"}
    return flown_plan(problem, answer)


def crossing(**fields):
    """Two UAVs from two places whose ways cross half-way; each goes back where it came from."""
    starts, targets = ((34.0, -19.0), (34.0, -18.9)), ((34.1, -18.9), (34.1, -19.0))
    return flown(starts, targets, ((0, 1),), **fields)


def drawn(seed):
    """A plan of UAVs of several places that visit areas all over the same land."""
    rng = np.random.default_rng(seed)
    places = rng.uniform((34.0, -19.5), (34.8, -19.0), (3, 2))
    starts = [tuple(places[n % 3]) for n in range(6)]
    targets = [tuple(at) for at in rng.uniform((34.0, -19.5), (34.8, -19.0), (18, 2))]
    depot = Base("depot", *places[0], (99.0,))
    order = rng.permutation(18).reshape(3, 6)
    rows = [tuple(map(int, row)) for row in order]
    # The first UAV reloads under way.
    rows[1] = (19, *rows[1][1:])
    return flown(starts, targets, rows, bases=(depot,))


def unit(place):
    x, y = np.radians(place)
    return np.array([np.cos(y) * np.cos(x), np.cos(y) * np.sin(x), np.sin(y)])


def on_arc(point, a, b):
    """Whether a point of the great circle through two others is between them."""
    normal = np.cross(a, b)
    return np.cross(a, point) @ normal >= 0 and np.cross(point, b) @ normal >= 0


def from_arc_m(point, a, b):
    """How far a point is from an arc, by spherical trigonometry."""
    normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    foot = point - (point @ normal) * normal
    if on_arc(foot / np.linalg.norm(foot), a, b):
        return EARTH_M * abs(np.arcsin(point @ normal))
    return EARTH_M * min(2 * np.arcsin(np.linalg.norm(point - end) / 2) for end in (a, b))


def arcs_apart_m(a, b, c, d):
    meeting = np.cross(np.cross(a, b), np.cross(c, d))
    if (length := np.linalg.norm(meeting)) > 0:
        for point in (meeting / length, -meeting / length):
            if on_arc(point, a, b) and on_arc(point, c, d):
                return 0.0
    ends = ((a, c, d), (b, c, d), (c, a, b), (d, a, b))
    return min(from_arc_m(*each) for each in ends)


def apart_m(way, other):
    """The least distance between two ways of arcs."""
    one, two = ([unit(place) for place in each] for each in (way, other))
    return min(arcs_apart_m(*arc, *its_arc) for arc in pairwise(one) for its_arc in pairwise(two))


def legs_of(planned):
    flight = planned.flight
    ways = [*(stop.path for stop in flight.stops), flight.landing.path]
    return [(flight.uav.id, way, planned.choices.altitude(n)) for n, way in enumerate(ways)]


@pytest.mark.parametrize("seed", range(4))
def test_legs_that_come_near_each_other_are_at_different_altitudes(seed):
    flights = planned_flights(drawn(seed), PLAIN, BY_LEG)
    legs = [leg for each in flights for leg in legs_of(each)]
    near = 0
    for (one, way, high), (other, its_way, its_high) in combinations(legs, 2):
        if one != other and apart_m(way, its_way) < 99.0:
            near += 1
            assert abs(high.metres - its_high.metres) >= 10.0
            assert high.reference is its_high.reference is TERRAIN
    assert near > 10
    assert min(high.metres for _, _, high in legs) == 50.0


def test_ways_that_cross_from_two_places_are_apart_with_an_altitude_a_leg():
    """With one a UAV they are not: each is alone at its place."""
    together, apart = (planned_flights(crossing(), PLAIN, each) for each in (Separation(), BY_LEG))
    assert apart_m(*(each.flight.stops[0].path for each in together)) == 0.0
    assert [[high.metres for high in each.choices.legs] for each in together] == [[50, 50], [50, 50]]
    assert [[high.metres for high in each.choices.legs] for each in apart] == [[50, 50], [60, 60]]


def test_the_clearance_says_how_near_is_near():
    """Two ways side by side, 0.001 degrees of latitude or 111 m apart."""
    starts, targets = ((34.0, 0.0), (34.0, 0.001)), ((34.1, 0.0), (34.1, 0.001))
    plan = flown(starts, targets, ((0, 1),))
    for clearance, expected in ((100.0, [50, 50]), (120.0, [50, 60]), (0.0, [50, 50])):
        separation = Separation(altitude_by=AltitudeBy.LEG, clearance_m=clearance)
        assert [each.choices.altitude_m for each in planned_flights(plan, PLAIN, separation)] == expected
    level = Separation(altitude_by=AltitudeBy.LEG, clearance_m=120.0, altitude_step_m=0.0)
    assert {each.choices.altitude_m for each in planned_flights(plan, PLAIN, level)} == {50.0}


def moves(items):
    """Pairs of places in turn that are not one above the other, with how high the mission has them."""
    high = [item for item in items if item.command in (TAKEOFF, WAYPOINT, 19)]
    return [(one, other) for one, other in pairwise(high) if (one.x, one.y) != (other.x, other.y)]


@pytest.mark.parametrize("delivery", Delivery)
@pytest.mark.parametrize("end", Ending)
def test_no_leg_climbs_on_its_way(delivery, end):
    """Altitudes change over a stop: no two places in turn of a mission have different ones."""
    plan = drawn(1)
    if end is Ending.LAND:
        plan = drawn(2)
    changed = 0
    for each in planned_flights(plan, FlightChoices(delivery=delivery, end=end), BY_LEG):
        codes, loader = commands(waypoint_file(each.flight, each.choices))
        items = [loader.wp(i) for i in range(1, loader.count())]
        for one, other in moves(items):
            assert (one.z, one.frame) == (other.z, other.frame)
        content = json.loads(plan_file(each.flight, each.choices))
        check_as_qgroundcontrol(content)
        assert [item["command"] for item in content["mission"]["items"]] == codes[1:]
        flown_at = [item.z for item in items if item.command in (TAKEOFF, WAYPOINT)]
        wanted = [high.metres for high in each.choices.legs]
        if end is Ending.LAND and codes[-1] == LAND:
            wanted = wanted[:-1]
        assert list(dict.fromkeys(flown_at)) == list(dict.fromkeys(wanted))
        changed += len(set(wanted)) > 1
        if codes[-1] == RETURN and len(each.choices.altitudes) > 1:
            # It climbs or descends to the way home before it is on it.
            assert items[-2].z in (wanted[-1], 0.0)
            assert any(f"flown at {wanted[-1]:g} m only if" in warning for warning in each.warnings)
        assert codes.count(PLACE) == (len(each.flight.stops) if delivery is Delivery.PAYLOAD_PLACE else 0)
    assert changed > 2


def test_what_altitudes_are_measured_from_is_the_same_for_all():
    one_place = flown(((34.0, -19.0),) * 2, ((34.01, -19.0), (34.0, -19.01)), ((0, 1),))
    assert {high for each in planned_flights(one_place, PLAIN, BY_LEG) for high in each.choices.legs} == {
        Altitude(50.0, HOME),
        Altitude(60.0, HOME),
    }
    for each in planned_flights(crossing(), PLAIN, BY_LEG):
        assert {high.reference for high in each.choices.legs} == {TERRAIN}
    asked = Separation(altitude_by=AltitudeBy.LEG, reference=HOME)
    for each in planned_flights(crossing(), PLAIN, asked):
        assert {high.reference for high in each.choices.legs} == {HOME}


@pytest.mark.parametrize("by", AltitudeBy)
def test_a_leg_gets_the_altitude_that_is_asked_for_it(by):
    own = {LegOf("u1", 2): (95.0, None), LegOf("u0", 1): (50.0, HOME)}
    separation = Separation(altitude_by=by, altitude_of={"u1": (70.0, None)}, altitude_of_leg=own)
    first, second = planned_flights(crossing(), PLAIN, separation)
    assert second.choices.legs == (Altitude(70.0, TERRAIN), Altitude(95.0, TERRAIN))
    assert first.choices.legs[0] == Altitude(50.0, HOME)
    assert first.choices.legs[1].reference is TERRAIN
    content = json.loads(plan_file(first.flight, first.choices))
    assert content["mission"]["globalPlanAltitudeMode"] == 0, "mixed"
    frames = [
        (item["frame"], item["AltitudeMode"]) for item in content["mission"]["items"] if "Altitude" in item
    ]
    assert frames == [(3, 1), (3, 1), (10, 4)]
    with pytest.raises(OutOfRange, match="'u1' has 2 legs in this plan, none of number 3"):
        planned_flights(crossing(), PLAIN, Separation(altitude_of_leg={LegOf("u1", 3): (60.0, None)}))
    with pytest.raises(OutOfRange, match=r"'u1' would fly at 0\.5 m"):
        planned_flights(crossing(), PLAIN, Separation(altitude_of_leg={LegOf("u1", 1): (0.5, None)}))


def test_legs_are_numbered_through_all_flights_with_reloads_as_stops():
    depot = Base("depot", 34.0, -19.0, (99.0,))
    zone = NoFlyZone("z", ((34.04, -19.01), (34.06, -19.01), (34.06, -18.99), (34.04, -18.99)))
    targets = ((34.1, -19.0), (34.1, -19.1))
    # It reloads before it has moved, which is its first stop.
    plan = flown(((34.0, -19.0),), targets, ((3,), (0,), (3,), (1,)), bases=(depot,), zones=(zone,))
    own = {LegOf("u0", n): (50.0 + n, None) for n in range(1, 6)}
    flights = planned_flights(plan, PLAIN, Separation(altitude_of_leg=own))
    assert [[high.metres for high in each.choices.legs] for each in flights] == [[52, 53], [54, 55]]
    _, loader = commands(waypoint_file(flights[0].flight, flights[0].choices))
    out = [loader.wp(i) for i in range(1, loader.count())]
    # Out over two corners of the zone, up over the area, and back over two corners.
    assert [item.z for item in out if item.command == WAYPOINT] == [52] * 3 + [53] * 3


def test_maps_and_the_briefing_say_how_high_each_leg_is():
    plan = crossing()
    own = Separation(altitude_of_leg={LegOf("u0", 2): (80.0, None)})
    flights = planned_flights(plan, PLAIN, own)
    text = briefing(plan, flights)
    assert "50 to 80 m above the ground below" in text
    assert text.count(", flown to at 50 m above the ground below") == 1
    assert text.count(", flown to at 80 m above the ground below") == 1
    assert "it changes its altitude over its stops" in text
    assert "takes off at 0:00 h, 50 to 80 m above the ground below; " in gpx(plan, flights)
    start, area = "34.0,-19.0", "34.1,-18.9"
    assert f">{start},50 {area},50 {area},80 {start},80<" in kml(plan, flights)


def test_legs_over_more_than_a_part_of_the_globe_are_refused():
    plan = flown(((0.0, 0.0), (150.0, 0.0)), ((1.0, 0.0), (151.0, 0.0)), ((0, 1),))
    with pytest.raises(OutOfRange) as caught:
        planned_flights(plan, PLAIN, BY_LEG)
    (error,) = caught.value.errors
    assert error.parameter == "altitude_by"
    assert "75" in error.detail


def test_where_nobody_flies_no_leg_needs_an_altitude():
    plan = flown([(34.0, -19.0)], [(34.1, -19.0)], ((1,),))
    assert not planned_flights(plan, PLAIN, BY_LEG)
