"""Flights as they are to be flown: altitudes, launches one by one, warnings, and the files that have them."""

import json
import math
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest
from mission_files import TAKEOFF, WAYPOINT, commands

from app.api.plan_formats.briefing import briefing
from app.api.plan_formats.flown_plan import flown_plan
from app.api.plan_formats.launches import Separation, planned_flights
from app.api.plan_formats.map_files import gpx, kml
from app.api.plan_formats.mission import AltitudeReference, Delivery, FlightChoices
from app.api.plan_formats.qgroundcontrol import plan_file, waypoint_file
from app.domain.plan import Plan
from app.domain.problem import UAV, Problem, Target
from app.domain.records import to_record
from app.domain.surroundings import Base, NoFlyZone
from app.simulation.explain import explain

PORT, INLAND = (34.0, -19.0), (34.4, -19.0)
MINUTE = 1 / 60
KML, GPX = "{http://www.opengis.net/kml/2.2}", "{http://www.topografix.com/GPX/1/1}"
PLAIN = FlightChoices(delivery=Delivery.NONE)


def swarm(targets, rows, *, uavs=3, bases=(), zones=(), **fields):
    """A plan of a problem whose UAVs all start at the port."""
    problem = Problem(
        uavs=tuple(UAV(f"u{n}", *PORT, *PORT, 60.0, 300.0, (9.0,), **fields) for n in range(uavs)),
        targets=targets,
        bases=bases,
        no_fly_zones=zones,
        crs="wgs84",
    )
    answer = {**to_record(explain(problem, Plan(rows))), "job_id": "0" * 32, "algorithm": "greedy"}
    return flown_plan(problem, answer)


def area(number, **fields):
    return Target(f"a{number}", 34.0, -19.0 - 0.02 * (number + 1), 1.0, (1.0,), **fields)


def three(**fields):
    return swarm(tuple(area(n, **fields) for n in range(3)), ((0, 1, 2),))


def starts(flights):
    return {each.flight.uav.id: each.flight.take_off_time for each in flights}


def test_uavs_of_one_place_take_off_one_after_the_other_one_above_the_other():
    flights = planned_flights(three(), PLAIN, Separation(altitude_step_m=15, launch_interval_s=120))
    assert starts(flights) == pytest.approx({"u0": 0.0, "u1": 2 * MINUTE, "u2": 4 * MINUTE})
    assert [each.delay for each in flights] == pytest.approx([0, 2 * MINUTE, 4 * MINUTE])
    assert [each.choices.altitude_m for each in flights] == [50, 65, 80]
    for each, planned in zip(flights, three().routes, strict=True):
        (stop,), (before,) = each.flight.stops, planned.stops
        assert stop.arrival_time == pytest.approx(before.arrival_time + each.delay)
        assert each.flight.landing.time == pytest.approx(planned.landing.time + each.delay)
        _, loader = commands(waypoint_file(each.flight, each.choices))
        items = [loader.wp(i) for i in range(1, loader.count())]
        altitudes = {item.z for item in items if item.command in (TAKEOFF, WAYPOINT)}
        assert altitudes == {each.choices.altitude_m}


def test_without_steps_and_intervals_the_plan_stays_as_it_is():
    plan = three()
    flights = planned_flights(plan, PLAIN, Separation(altitude_step_m=0, launch_interval_s=0))
    assert [each.flight for each in flights] == [flight for route in plan.routes for flight in route.flown]
    assert {each.choices.altitude_m for each in flights} == {50.0}


def test_who_waits_on_the_ground_anyway_lets_others_go_first():
    targets = (area(0, earliest=2.0), area(1), area(2))
    flights = planned_flights(swarm(targets, ((0, 1, 2),)), PLAIN, Separation(launch_interval_s=60))
    first = starts(flights)
    assert (first["u1"], first["u2"]) == pytest.approx((0.0, MINUTE))
    assert first["u0"] == pytest.approx(2.0 - flights[0].flight.stops[0].distance / 60)
    assert flights[0].delay == 0


def test_waiting_at_a_stop_makes_up_for_a_late_start():
    targets = (area(0), area(1), area(4, earliest=1.0))
    plan = swarm(targets, ((0, 1, 3), (3, 2, 3)), uavs=3)
    _, late = planned_flights(plan, PLAIN, Separation(launch_interval_s=60))
    planned = plan.routes[1]
    assert late.delay == pytest.approx(MINUTE)
    assert late.flight.stops[0].begin_time == pytest.approx(planned.stops[0].begin_time + MINUTE)
    assert late.flight.stops[1].begin_time == planned.stops[1].begin_time == 1.0
    assert late.flight.landing.time == pytest.approx(planned.landing.time)
    assert late.flight.waiting_in_air(1) == pytest.approx(planned.flown[0].waiting_in_air(1) - MINUTE)


def test_a_later_flight_of_the_same_uav_follows_the_first():
    depot = Base("depot", *INLAND, (9.0,), 0.25)
    targets = (Target("a", 34.2, -19.0, 1.0, (1.0,)), Target("b", 34.5, -19.0, 1.0, (1.0,)), area(2))
    at_depot, home = 4, 3
    rows = ((2, 0, home), (home, at_depot, home), (home, 1, home))
    plan = swarm(targets, rows, bases=(depot,))
    _, first, second = planned_flights(plan, PLAIN, Separation(launch_interval_s=600))
    before = plan.routes[1].flown
    assert [first.delay, second.delay] == pytest.approx([10 * MINUTE] * 2)
    assert second.flight.take_off_time == pytest.approx(before[1].take_off_time + 10 * MINUTE)
    assert first.choices.altitude_m == second.choices.altitude_m == 60
    assert first.flight.landing.departure_time == pytest.approx(
        before[0].landing.departure_time + 10 * MINUTE
    )


def test_who_meets_at_a_base_later_flies_at_another_altitude():
    depot = Base("depot", *INLAND, (9.0,), 0.25)
    problem = Problem(
        uavs=(
            UAV("port", *PORT, *PORT, 60.0, 300.0, (9.0,)),
            UAV("inland", *INLAND, *INLAND, 60.0, 300.0, (9.0,)),
            UAV("away", 30.0, -19.0, 30.0, -19.0, 60.0, 300.0, (9.0,)),
        ),
        targets=(
            Target("a", 34.2, -19.0, 1.0, (1.0,)),
            Target("b", 34.45, -19.0, 1.0, (1.0,)),
            Target("c", 30.1, -19.0, 1.0, (1.0,)),
        ),
        bases=(depot,),
        crs="wgs84",
    )
    rows = ((0, 1, 2), (4, 3, 3), (3, 3, 3))
    answer = {**to_record(explain(problem, Plan(rows))), "job_id": "0" * 32, "algorithm": "greedy"}
    flights = planned_flights(flown_plan(problem, answer), PLAIN, Separation())
    altitudes = {each.flight.uav.id: each.choices.altitude_m for each in flights}
    assert altitudes == {"port": 50, "inland": 60, "away": 50}


def test_altitudes_of_their_own_and_what_they_are_measured_from():
    near = (Target("near", 34.01, -19.0, 1.0, (1.0,)),)
    short = swarm(near, ((0, 1),), uavs=2)
    (only,) = planned_flights(short, PLAIN, Separation(altitude_of={"u0": (130.0, None)}))
    assert (only.choices.altitude_m, only.choices.altitude_reference) == (130.0, AltitudeReference.HOME)
    assert any("130 m is above 120 m" in warning for warning in only.warnings)
    far = swarm((Target("far", 34.5, -19.0, 1.0, (1.0,)),), ((0, 1),), uavs=2)
    (only,) = planned_flights(far, PLAIN, Separation())
    assert only.choices.altitude_reference is AltitudeReference.TERRAIN
    assert any("terrain data" in warning for warning in only.warnings)
    (only,) = planned_flights(far, PLAIN, Separation(reference=AltitudeReference.HOME))
    assert only.choices.altitude_reference is AltitudeReference.HOME
    assert any("it flies 105 km with altitudes above where it starts" in each for each in only.warnings)


def test_what_becomes_too_late_is_warned_of():
    arrives = three().routes[2].stops[0].arrival_time
    lands = three().routes[2].landing.time
    targets = (area(0), area(1), area(2, deadline=arrives + MINUTE))
    plan = swarm(targets, ((0, 1, 2),), available_until=lands + MINUTE)
    in_time = planned_flights(plan, PLAIN, Separation(launch_interval_s=25))
    assert not [warning for each in in_time for warning in each.warnings if "too late" in warning]
    *_, late = planned_flights(plan, PLAIN, Separation(launch_interval_s=60))
    assert any(
        f"it is 60 s too late at 'a2', whose deadline is {targets[2].deadline:g} h" == each
        for each in late.warnings
    )
    assert any(each.startswith("it lands at ") for each in late.warnings)
    assert "it takes off 120 s later than planned, after others at its place" in late.warnings


def test_warnings_are_in_the_notes_of_a_plan_file_and_in_the_briefing():
    plan = three()
    flights = planned_flights(plan, FlightChoices(), Separation())
    text = briefing(plan, flights)
    for each in flights:
        notes = json.loads(plan_file(each.flight, each.choices, each.warnings))["notes"]
        for warning in each.warnings:
            assert f"Warning: {warning}" in notes
            assert f"   ! {warning}" in text
    assert [line[3:] for line in text.splitlines() if line[:1].isdigit()] == ["u0", "u1", "u2"]
    assert text.index("takes off at 0:01") < text.index("takes off at 0:02")
    for each in flights:
        for stop in each.flight.stops:
            amounts = [f"{amount:g}" for amount in stop.delivered if amount]
            assert f": unloads {amounts[0]}" in text


def test_kml_has_flights_at_their_altitudes_areas_bases_and_zones():
    zone = NoFlyZone("z", ((33.99, -19.05), (34.005, -19.05), (34.005, -19.04), (33.99, -19.04)), "A <port>")
    targets = (area(0), area(3))
    plan = swarm(targets, ((1, 0, 2),), bases=(Base("depot", *INLAND, (9.0,)),), zones=(zone,))
    flights = planned_flights(plan, PLAIN, Separation())
    root = ET.fromstring(kml(plan, flights).encode())
    assert root.tag == f"{KML}kml"
    folders = {each.findtext(f"{KML}name"): each for each in root.iter(f"{KML}Folder")}
    assert [len(each.findall(f"{KML}Placemark")) for each in folders.values()] == [2, 2, 1, 1]
    lines = list(folders["Flights"].iter(f"{KML}LineString"))
    for line, each in zip(lines, flights, strict=True):
        assert line.findtext(f"{KML}altitudeMode") == "relativeToGround"
        found = [tuple(map(float, place.split(","))) for place in line.findtext(f"{KML}coordinates").split()]
        way = [each.flight.place, *each.flight.stops[0].path[1:], *each.flight.landing.path[1:]]
        assert found == [(*place, each.choices.altitude_m) for place in way]
    assert len(lines[0].findtext(f"{KML}coordinates").split()) > 3, "it flies round the zone"
    assert any("corners of no-fly zones" in warning for warning in flights[0].warnings)
    ring = next(folders["No-fly zones"].iter(f"{KML}LinearRing")).findtext(f"{KML}coordinates").split()
    assert ring[0] == ring[-1]
    assert len(ring) == 5
    assert folders["No-fly zones"].find(f"{KML}Placemark").findtext(f"{KML}name") == "A <port> (z)"


def test_gpx_keeps_the_order_of_its_schema_and_has_a_route_a_flight():
    plan = three()
    flights = planned_flights(plan, PLAIN, Separation())
    root = ET.fromstring(gpx(plan, flights).encode())
    assert (root.tag, root.get("version")) == (f"{GPX}gpx", "1.1")
    order = [each.tag.removeprefix(GPX) for each in root]
    assert order == ["metadata", *["wpt"] * 3, *["rte"] * 3]
    for route, each in zip(root.findall(f"{GPX}rte"), flights, strict=True):
        assert [part.tag.removeprefix(GPX) for part in route] == ["name", "desc", *["rtept"] * 3]
        points = [(float(p.get("lon")), float(p.get("lat"))) for p in route.findall(f"{GPX}rtept")]
        (stop,) = each.flight.stops
        assert points == [PORT, (stop.target.x, stop.target.y), PORT]
        assert route.findall(f"{GPX}rtept")[1].findtext(f"{GPX}name") == stop.target.id


def test_files_of_one_uav_are_those_it_has_among_the_others():
    plan = three()
    alone = replace(plan, routes=plan.routes[2:])
    among = planned_flights(plan, PLAIN, Separation())[2]
    (single,) = planned_flights(alone, PLAIN, Separation())
    assert among.delay == pytest.approx(2 * MINUTE)
    assert math.isclose(single.delay, 0.0)
    assert among.choices.altitude_m == single.choices.altitude_m + 20
