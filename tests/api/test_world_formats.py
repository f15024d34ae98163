"""Plans with waiting, detours, zones and wind, taken away: every file says them by its format's rules."""

import csv
import io
import json
import math
import re
from dataclasses import replace
from itertools import pairwise

import pytest
from pymavlink import mavwp

from app.api.plan_formats.csv_table import csv_table
from app.api.plan_formats.errors import OutOfRange
from app.api.plan_formats.flown_plan import flown_plan
from app.api.plan_formats.geojson import geojson
from app.api.plan_formats.mission import Delivery, Ending, FlightChoices
from app.api.plan_formats.printed_page import printed_page
from app.api.plan_formats.qgroundcontrol import plan_file, waypoint_file
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import to_record
from app.domain.surroundings import NoFlyZone, Wind
from app.simulation.explain import explain

WAYPOINT, LOITER, RETURN, TAKEOFF, SPEED = 16, 19, 20, 22, 178
CORNERS = ((34.2, -19.4), (34.3, -19.4), (34.3, -18.9), (34.2, -18.9))
PROBLEM = Problem(
    uavs=(
        UAV("u", 34.0, -19.0, 34.0, -19.0, 72.0, 500.0, (9.0,), available_from=0.5, name="Kestrel"),
        UAV("idle", 34.0, -19.0, 34.0, -19.0, 72.0, 500.0, (0.0,)),
    ),
    targets=(
        Target("a", 34.5, -19.0, 1.0, (3.0,), earliest=2.5, service_time=0.1, name="Village <1>"),
        Target("b", 34.6, -19.0, 1.0, (3.0,), earliest=4.0),
    ),
    crs="wgs84",
    no_fly_zones=(NoFlyZone("airport", CORNERS, name="Airport"),),
)


def flown(problem=PROBLEM, rows=((0, 2), (1, 2))):
    """A plan in which the first UAV flies to both areas, and the answer."""
    record = to_record(explain(problem, Plan(rows)))
    answer = {**record, "job_id": "0" * 32, "algorithm": "greedy"}
    return flown_plan(problem, answer), answer


def items_of(text):
    loader = mavwp.MAVWPLoader()
    loader._read_waypoints_v110(text.splitlines()[1:])
    return [loader.wp(i) for i in range(loader.count())]


def test_a_mission_flies_over_the_corners_and_loiters_until_the_visit_begins():
    plan, answer = flown()
    (first, second), home = answer["routes"][0]["stops"], answer["routes"][0]["landing"]
    items = items_of(
        waypoint_file(plan.routes[0].flights[0], FlightChoices(delivery=Delivery.NONE, altitude_m=80))
    )

    places = [[item.y, item.x] for item in items if item.command == WAYPOINT][1:]
    ways = [*first["path"][1:], [34.6, -19.0], *home["path"][1:-1]]
    assert places == [pytest.approx(place, abs=1e-6) for place in ways]
    assert len(first["path"]) == len(home["path"]) == 4
    # The wait for the first visit is on the ground.
    (loiter,) = [item for item in items if item.command == LOITER]
    assert loiter.param1 == pytest.approx(3600 * (second["begin_time"] - second["arrival_time"]))
    assert (loiter.y, loiter.x, loiter.z) == pytest.approx((34.6, -19.0, 80))
    assert items[-1].command == RETURN
    assert [item.param2 for item in items if item.command == SPEED] == [20.0]


def test_a_plan_file_has_zones_as_fences_and_says_when_to_take_off():
    plan, answer = flown()
    content = json.loads(plan_file(plan.routes[0].flights[0], FlightChoices()))
    assert content["geoFence"]["polygons"] == [
        {"version": 1, "inclusion": False, "polygon": [[y, x] for x, y in CORNERS]}
    ]
    stop = answer["routes"][0]["stops"][0]
    takes_off = 0.5 + stop["begin_time"] - stop["arrival_time"]
    (note,) = content["notes"]
    assert f"takes off {takes_off:g} h" in note
    assert "on the ground" in note
    still = replace(PROBLEM, uavs=(replace(PROBLEM.uavs[0], available_from=0.0), PROBLEM.uavs[1]))
    still = replace(still, targets=tuple(replace(target, earliest=0.0) for target in still.targets))
    assert "notes" not in json.loads(plan_file(flown(still)[0].routes[0].flights[0], FlightChoices()))


def test_in_wind_every_leg_has_its_speed_over_ground():
    problem = replace(PROBLEM, no_fly_zones=(), wind=Wind(30.0, 90.0))
    plan, answer = flown(problem)
    items = items_of(waypoint_file(plan.routes[0].flights[0], FlightChoices(delivery=Delivery.NONE)))
    told = [item.param2 for item in items if item.command == SPEED]
    first, _ = answer["routes"][0]["stops"]
    assert told == [20.0, pytest.approx(first["distance"] / (first["arrival_time"] - 0.5) / 3.6, rel=1e-6)]
    assert told[1] == pytest.approx((72 + 30) / 3.6, rel=1e-3)
    # Against the wind on the way home the air length is longer than the way.
    route = plan.routes[0]
    assert route.landing.range_left < route.stops[-1].range_left - 1.5 * route.landing.distance
    assert route.landing.time == answer["routes"][0]["landing"]["time"]


def test_who_need_not_return_has_no_way_home_round_zones():
    plan, _ = flown(replace(PROBLEM, objective=Objective(return_to_base=False)))
    route = plan.routes[0]
    assert route.landing.time is None
    with pytest.raises(OutOfRange, match="no way home"):
        plan_file(route.flights[0], FlightChoices())
    landed = FlightChoices(end=Ending.LAND, delivery=Delivery.NONE)
    assert [item["command"] for item in json.loads(plan_file(route.flights[0], landed))["mission"]["items"]][
        -1
    ] == 21
    rows = list(csv.DictReader(io.StringIO(csv_table(plan))))
    assert [(row["event"], row["time"] == "") for row in rows if row["uav_id"] == "u"] == [
        ("start", False),
        ("visit", False),
        ("visit", False),
        ("return", True),
    ]


def test_a_wait_that_is_too_long_to_be_told_is_named():
    far = replace(PROBLEM, targets=(PROBLEM.targets[0], replace(PROBLEM.targets[1], earliest=30.0)))
    with pytest.raises(OutOfRange, match=r"would stay .* s at 'b'"):
        waypoint_file(flown(far)[0].routes[0].flights[0], FlightChoices())


def test_csv_has_times_and_ways():
    plan, answer = flown()
    rows = [row for row in csv.DictReader(io.StringIO(csv_table(plan))) if row["uav_id"] == "u"]
    start, *visits, home = rows
    assert float(start["time"]) == 0.5
    route = answer["routes"][0]
    for row, stop in zip(visits, route["stops"], strict=True):
        for name in ("begin_time", "departure_time", "range_left"):
            assert float(row[name]) == stop[name]
        assert float(row["time"]) == stop["arrival_time"]
        assert float(row["waiting"]) == stop["begin_time"] - stop["arrival_time"]
        assert row["endurance_left"] == ""
    assert [row["waits_on_ground"] for row in visits] == ["1", "0"]
    points = re.fullmatch(r"LINESTRING \((.*)\)", visits[0]["path"]).group(1).split(", ")
    assert [[float(number) for number in point.split()] for point in points] == route["stops"][0]["path"]
    assert visits[1]["path"] == "LINESTRING (34.5 -19.0, 34.6 -19.0)"
    assert float(home["time"]) == route["landing"]["time"]
    assert home["path"].count(",") == 3


def test_geojson_has_ways_times_and_zones():
    plan, answer = flown()
    features = json.loads(geojson(plan))["features"]
    (zone,) = [each for each in features if each["properties"]["kind"] == "zone"]
    assert zone["geometry"]["coordinates"] == [[list(corner) for corner in (*CORNERS, CORNERS[0])]]
    assert zone["properties"] == {"kind": "zone", "zone_id": "airport", "name": "Airport"}
    (line,) = [each for each in features if each["properties"]["kind"] == "route"]
    route = answer["routes"][0]
    (first, second) = route["stops"]
    whole = [*first["path"], [34.6, -19.0], *route["landing"]["path"][1:]]
    assert line["geometry"]["coordinates"] == whole
    assert line["properties"]["return_time"] == route["landing"]["time"]
    assert line["properties"]["waits_on_ground"] == first["begin_time"] - first["arrival_time"]
    told = line["properties"]["stops"][1]
    assert {name: told[name] for name in told} == {name: second[name] for name in told}
    assert {"begin_time", "departure_time", "endurance_left"} <= set(told)


def test_a_zone_across_the_antimeridian_is_cut_in_two_and_is_as_large():
    corners = ((179.0, -10.0), (-179.5, -10.0), (-179.5, -9.0), (179.0, -9.0))
    problem = replace(
        PROBLEM,
        uavs=tuple(
            replace(uav, x_s=178.0, x_c=178.0, y_s=-12.0, y_c=-12.0, voyage=2000.0) for uav in PROBLEM.uavs
        ),
        targets=tuple(replace(target, x=-178.5, y=-12.0) for target in PROBLEM.targets),
        no_fly_zones=(NoFlyZone("z", corners[::-1]),),
    )
    features = json.loads(geojson(flown(problem)[0]))["features"]
    (zone,) = [each for each in features if each["properties"]["kind"] == "zone"]
    assert zone["geometry"]["type"] == "MultiPolygon"
    areas = []
    for ((*ring,),) in zone["geometry"]["coordinates"]:
        assert ring[0] == ring[-1]
        areas.append(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairwise(ring)) / 2)
        assert all(-180 <= x <= 180 for x, _ in ring)
    assert areas == [pytest.approx(1.0), pytest.approx(0.5)]


def test_the_printed_page_draws_zones_and_names_who_waits():
    plan, answer = flown()
    page = printed_page(plan)
    assert "No-fly zones: Airport (airport)." in page
    assert "Kestrel (u)" in page
    assert "Village &lt;1&gt; (a)" in page
    assert "<polygon points=" in page
    stop, later = answer["routes"][0]["stops"]
    assert "(waits 1:" in page
    assert "on the ground" in page
    minutes = round(60 * (later["begin_time"] - later["arrival_time"]))
    assert f"waits {minutes // 60}:{minutes % 60:02d} h in the air" in page
    assert "+2:30 h</td>" in page
    (points,) = re.findall(r'<polyline points="([^"]*)"', page)
    assert len(points.split()) == len(stop["path"]) + 1 + 3
    windy = printed_page(flown(replace(PROBLEM, no_fly_zones=(), wind=Wind(30.0, 90.0)))[0])
    assert "Wind: 30 km/h towards 90°." in windy
    assert not math.isnan(plan.reward)


def test_what_uses_nothing_of_it_is_written_as_before():
    first = replace(
        PROBLEM,
        uavs=tuple(replace(uav, available_from=0.0, name=None) for uav in PROBLEM.uavs),
        targets=tuple(replace(target, earliest=0.0, name=None) for target in PROBLEM.targets),
        no_fly_zones=(),
    )
    plan, _ = flown(first)
    assert not plan.in_world
    assert csv_table(plan).splitlines()[0].endswith(",step,delivered_1")
    assert "begin_time" not in geojson(plan)
    assert "Begin" not in printed_page(plan)
    assert LOITER not in [
        item.command for item in items_of(waypoint_file(plan.routes[0].flights[0], FlightChoices()))
    ]
