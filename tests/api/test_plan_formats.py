"""Plans to take away: every file is read back by the rules of its format and compared with the plan."""

import csv
import io
import json
import math
from dataclasses import replace

import pytest
from mission_files import (
    DELAY,
    GRIPPER,
    LAND,
    PLACE,
    RETURN,
    SERVO,
    SPEED,
    TAKEOFF,
    WAYPOINT,
    check_as_qgroundcontrol,
    commands,
)
from pymavlink import mavwp

from app.api.plan_formats.antimeridian import closed, cut_ring
from app.api.plan_formats.csv_table import csv_table
from app.api.plan_formats.errors import OutOfRange
from app.api.plan_formats.flown_plan import flown_plan
from app.api.plan_formats.geojson import geojson
from app.api.plan_formats.mission import Delivery, Ending, FlightChoices
from app.api.plan_formats.printed_page import printed_page
from app.api.plan_formats.qgroundcontrol import file_name, plan_file, waypoint_file
from app.domain.problem import UAV, Problem, Target
from app.domain.surroundings import NoFlyZone


def two_visits(crs="wgs84", *, voyage=300.0, dis=0.0, x_c=34.0, service_time=0.1, ids=("uav 1", "uav-2")):
    """A problem of two UAVs, of which the first flies to both areas, and its answer."""
    problem = Problem(
        uavs=(
            UAV(ids[0], 34.0, -19.0, x_c, -19.0, 72.0, voyage, (10.0, 4.0), dis=dis),
            UAV(ids[1], 34.0, -19.0, 34.0, -19.0, 72.0, voyage, (10.0, 4.0)),
        ),
        targets=(
            Target("north <&>", 34.0, -18.5, 2.0, (3.0, 4.0), service_time=service_time),
            Target("east", 34.5, -18.5, 1.0, (9.0, 0.0)),
        ),
        crs=crs,
    )
    first, second, home = 55.6, 52.7, 76.7
    stops = [
        {
            "target_id": "north <&>",
            "step": 1,
            "arrival_time": 0.772,
            "distance": first,
            "delivered": [3.0, 4.0],
        },
        {"target_id": "east", "step": 2, "arrival_time": 1.604, "distance": second, "delivered": [7.0, 0.0]},
    ]
    answer = {
        "job_id": "0123456789abcdef" * 2,
        "algorithm": "greedy",
        "reward": 2.0,
        "satisfaction": 2.5,
        "distance": first + second,
        "routes": [
            {"uav_id": ids[0], "distance": first + second, "return_distance": home, "stops": stops},
            {"uav_id": ids[1], "distance": 0.0, "return_distance": 0.0, "stops": []},
        ],
        "unmet": [{"target_id": "east", "remaining": [2.0, 0.0], "reason": "loads are used <up>"}],
    }
    return flown_plan(problem, answer)


def test_waypoints_load_in_pymavlink_and_are_the_plan(tmp_path):
    route = two_visits().routes[0]
    file = tmp_path / "mission.waypoints"
    file.write_text(waypoint_file(route.flights[0], FlightChoices(altitude_m=80.0)))

    loader = mavwp.MAVWPLoader()
    loader.load(str(file))

    read = [loader.wp(i) for i in range(loader.count())]
    assert [item.command for item in read] == [
        *(WAYPOINT, TAKEOFF, SPEED),
        *(WAYPOINT, PLACE, DELAY),
        *(WAYPOINT, PLACE),
        RETURN,
    ]
    assert [item.current for item in read] == [1] + [0] * 8
    assert (read[0].x, read[0].y) == (-19.0, 34.0)
    assert [(read[i].x, read[i].y, read[i].z) for i in (3, 6)] == [(-18.5, 34.0, 80.0), (-18.5, 34.5, 80.0)]
    assert read[2].param2 == 20.0, "72 km/h are 20 m/s"
    assert read[5].param1 == 360.0, "0.1 h of service are 360 s"


def test_plan_file_keeps_the_rules_of_qgroundcontrols_loader():
    route = two_visits().routes[0]

    content = json.loads(plan_file(route.flights[0], FlightChoices(altitude_m=80.0)))

    check_as_qgroundcontrol(content)
    items = content["mission"]["items"]
    flown = [item["params"][4:] for item in items if item["command"] == WAYPOINT]
    assert flown == [[stop.target.y, stop.target.x, 80.0] for stop in route.stops]


@pytest.mark.parametrize("delivery", Delivery)
@pytest.mark.parametrize("end", Ending)
def test_both_formats_say_the_same(delivery, end):
    route = two_visits().routes[0]
    choices = FlightChoices(delivery=delivery, end=end, servo_channel=7, servo_pwm_us=1100, gripper=2)

    codes, loader = commands(waypoint_file(route.flights[0], choices))
    content = json.loads(plan_file(route.flights[0], choices))

    check_as_qgroundcontrol(content)
    items = content["mission"]["items"]
    assert [item["command"] for item in items] == codes[1:]
    for i, item in enumerate(items, 1):
        read = loader.wp(i)
        known = [value or 0.0 for value in item["params"]]
        assert known == pytest.approx(
            [read.param1, read.param2, read.param3, read.param4, read.x, read.y, read.z]
        )
    released = {Delivery.SERVO: SERVO, Delivery.GRIPPER: GRIPPER, Delivery.PAYLOAD_PLACE: PLACE}
    if delivery in released:
        assert codes.count(released[delivery]) == 2
    assert codes[-1] == (RETURN if end is Ending.RETURN else codes[-1])
    assert codes.count(LAND) == (2 if delivery is Delivery.LAND else int(end is Ending.LAND))
    assert codes.count(TAKEOFF) == 1 + (0 if delivery is not Delivery.LAND else 2 - int(end is Ending.LAND))


@pytest.mark.parametrize("on_its_way", [{"dis": 5.0}, {"x_c": 34.1}])
def test_uav_on_its_way_does_not_take_off_again(on_its_way):
    codes, _ = commands(waypoint_file(two_visits(**on_its_way).routes[0].flights[0], FlightChoices()))

    assert TAKEOFF not in codes


def test_range_that_does_not_suffice_is_named_for_every_place():
    route = two_visits(voyage=100.0).routes[0]

    with pytest.raises(OutOfRange) as caught:
        plan_file(route.flights[0], FlightChoices())

    found = {error.pointer: error.detail for error in caught.value.errors}
    assert set(found) == {"/routes/0/stops/1/range_left", "/routes/0/range_left"}
    assert "'east'" in found["/routes/0/stops/1/range_left"]
    assert "8.3 km beyond its range of 100 km" in found["/routes/0/stops/1/range_left"]


def test_flight_that_ends_at_the_last_stop_needs_no_range_for_the_way_home():
    route = two_visits(voyage=110.0).routes[0]

    with pytest.raises(OutOfRange, match="at home"):
        plan_file(route.flights[0], FlightChoices())
    codes, _ = commands(waypoint_file(route.flights[0], FlightChoices(end=Ending.LAND)))

    assert codes[-1] == LAND


@pytest.mark.parametrize(
    ("choice", "named"),
    [
        ({"altitude_m": 0.5}, "altitude 0.5"),
        ({"altitude_m": math.nan}, "altitude nan"),
        ({"servo_pwm_us": 2501}, "servo_pwm 2501"),
        ({"servo_channel": 0}, "servo_channel 0"),
        ({"gripper": 9}, "gripper 9"),
        ({"max_descent_m": -1.0}, "max_descent -1"),
    ],
)
def test_choices_are_checked(choice, named):
    with pytest.raises(OutOfRange, match=named):
        plan_file(two_visits().routes[0].flights[0], FlightChoices(**choice))


def test_stay_that_no_autopilot_can_be_told_is_refused():
    with pytest.raises(OutOfRange, match="72000 s"):
        plan_file(two_visits(service_time=20.0).routes[0].flights[0], FlightChoices())


def test_geojson_has_the_whole_plan():
    plan = two_visits()

    content = json.loads(geojson(plan))

    assert content["type"] == "FeatureCollection"
    by_kind = {}
    for feature in content["features"]:
        assert feature["type"] == "Feature"
        by_kind.setdefault(feature["properties"]["kind"], []).append(feature)
    assert {kind: len(features) for kind, features in by_kind.items()} == {"uav": 2, "area": 2, "route": 1}
    (line,) = by_kind["route"]
    assert line["geometry"] == {
        "type": "LineString",
        "coordinates": [[34.0, -19.0], [34.0, -18.5], [34.5, -18.5], [34.0, -19.0]],
    }
    assert [stop["delivered"] for stop in line["properties"]["stops"]] == [[3.0, 4.0], [7.0, 0.0]]
    assert by_kind["area"][1]["properties"]["remaining"] == [2.0, 0.0]


@pytest.mark.parametrize("turned", [1, -1])
def test_geojson_has_the_zones_closed_and_counter_clockwise(turned):
    plan = two_visits(crs="local")
    corners = ((34.1, -18.9), (34.2, -18.9), (34.2, -18.8))
    zone = NoFlyZone("z", corners[::turned], "Airport", {"k": 1})
    plan = replace(plan, problem=replace(plan.problem, no_fly_zones=(zone,)))
    (feature,) = (f for f in json.loads(geojson(plan))["features"] if f["properties"]["kind"] == "zone")
    assert feature["properties"] == {
        "kind": "zone",
        "zone_id": "z",
        "name": "Airport",
        "properties": {"k": 1},
    }
    ((*ring, last),) = feature["geometry"]["coordinates"]
    assert last == ring[0]
    start = ring.index(list(corners[0]))
    assert [*ring[start:], *ring[:start]] == [list(corner) for corner in corners]


@pytest.mark.parametrize("first", range(4))
def test_a_zone_across_the_antimeridian_is_two_polygons(first):
    corners = [(179.0, 0.0), (-179.0, 0.0), (-179.0, 2.0), (179.0, 1.0)]
    west, east = cut_ring([*corners[first:], *corners[:first]])
    found = {frozenset(closed(ring)): closed(ring) for ring in (west, east)}
    assert set(found) == {
        frozenset([(179.0, 0.0), (180.0, 0.0), (180.0, 1.5), (179.0, 1.0)]),
        frozenset([(-180.0, 0.0), (-179.0, 0.0), (-179.0, 2.0), (-180.0, 1.5)]),
    }
    around_the_pole, elsewhere = (
        [(-10.0, 80.0), (110.0, 80.0), (-130.0, 80.0)],
        [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)],
    )
    assert cut_ring(around_the_pole) == [around_the_pole]
    assert cut_ring(elsewhere) == [elsewhere]


def test_geojson_cuts_lines_at_the_antimeridian():
    problem = Problem(
        uavs=(UAV("u", 179.0, 0.0, 179.0, 0.0, 100.0, 900.0, (1.0,)),),
        targets=(Target("t", -179.0, 2.0, 1.0, (1.0,)),),
        crs="wgs84",
    )
    stop = {"target_id": "t", "step": 1, "arrival_time": 3.0, "distance": 300.0, "delivered": [1.0]}
    route = {"uav_id": "u", "distance": 300.0, "return_distance": 300.0, "stops": [stop]}
    numbers = {"reward": 1.0, "satisfaction": 1.0, "distance": 300.0}
    answer = {"job_id": "j", "algorithm": "ga", **numbers, "routes": [route], "unmet": []}

    content = json.loads(geojson(flown_plan(problem, answer)))

    line = next(each for each in content["features"] if each["properties"]["kind"] == "route")
    assert line["geometry"]["type"] == "MultiLineString"
    assert line["geometry"]["coordinates"] == [
        [[179.0, 0.0], [180.0, 1.0]],
        [[-180.0, 1.0], [-179.0, 2.0], [-180.0, 1.0]],
        [[180.0, 1.0], [179.0, 0.0]],
    ]


def test_csv_has_a_row_an_event():
    plan = two_visits(crs="local")

    rows = list(csv.DictReader(io.StringIO(csv_table(plan))))

    assert [(row["uav_id"], row["event"]) for row in rows] == [
        *(("uav 1", event) for event in ("start", "visit", "visit", "return")),
        ("uav-2", "start"),
    ]
    assert [float(row["range_left"]) for row in rows[:4]] == pytest.approx([300.0, 244.4, 191.7, 115.0])
    assert [(row["delivered_1"], row["delivered_2"]) for row in rows[1:3]] == [("3.0", "4.0"), ("7.0", "0.0")]
    assert float(rows[3]["time"]) == pytest.approx(1.604 + 76.7 / 72.0)


def test_csv_has_no_formula():
    ids = ("=1+1", "'@SUM(1)")
    rows = list(csv.DictReader(io.StringIO(csv_table(two_visits(ids=ids)))))

    assert {row["uav_id"] for row in rows} == {"'=1+1", "''@SUM(1)"}
    assert {row["target_id"] for row in rows} == {"", "north <&>", "east"}
    assert all(float(row["y"]) < 0 for row in rows)


def test_printed_page_has_every_stop_and_escapes_ids():
    page = printed_page(two_visits())

    assert "north &lt;&amp;&gt;" in page
    assert "north <&>" not in page
    assert "loads are used &lt;up&gt;" in page
    assert "18.50000° S, 34.50000° E" in page
    assert "+0:46 h" in page
    assert "src=" not in page
    assert "<script" not in page


def test_file_names_are_safe():
    plan = two_visits(ids=("../../etc/паром", "..."))

    assert [file_name(route.flights[0], "plan", numbered=False) for route in plan.routes] == [
        "001-etc.plan",
        "002-uav.plan",
    ]
