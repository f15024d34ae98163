"""Plans with bases, taken away: a file a flight, reloads in tables and maps, and a sheet of the loads."""

import csv
import io
import json
import zipfile
from dataclasses import replace
from itertools import pairwise

import pytest
from pymavlink import mavwp

from app.api.plan_formats.csv_table import csv_table
from app.api.plan_formats.errors import OutOfRange
from app.api.plan_formats.flown_plan import flown_plan
from app.api.plan_formats.geojson import geojson
from app.api.plan_formats.load_sheet import load_sheet
from app.api.plan_formats.mission import Delivery, Ending, FlightChoices
from app.api.plan_formats.printed_page import printed_page
from app.api.plan_formats.qgroundcontrol import file_name, plan_file, waypoint_file
from app.domain.plan import Plan
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.records import problem_to_record, to_record
from app.domain.surroundings import Base
from app.simulation.explain import explain

WAYPOINT, RETURN, LAND, TAKEOFF = 16, 20, 21, 22
START, DEPOT = (34.0, -19.0), (34.4, -19.0)
PROBLEM = Problem(
    uavs=(
        UAV("u", *START, *START, 80.0, 200.0, (4.0, 0.0), full_load=(3.0, 1.0), endurance=3.0),
        UAV("v", *DEPOT, *DEPOT, 80.0, 200.0, (0.0, 0.0), full_load=(2.0, 2.0)),
        UAV("idle", *START, *START, 80.0, 200.0, (0.0, 0.0)),
    ),
    targets=(
        Target("a", 34.2, -19.0, 1.0, (4.0, 0.0), service_time=0.05),
        Target("b", 34.5, -19.0, 1.0, (3.0, 1.0), earliest=2.0),
        Target("c", 34.3, -19.1, 1.0, (2.0, 2.0)),
    ),
    bases=(Base("depot", *DEPOT, (5.0, 9.0), 0.25, name="Depot <1>"), Base("spare", 35.0, -18.0)),
    crs="wgs84",
)
HOME, AT_DEPOT = 3, 4
ROWS = ((0, AT_DEPOT, HOME), (AT_DEPOT, 2, HOME), (1, HOME, HOME))


def flown(problem=PROBLEM, rows=ROWS):
    """A plan in which the first UAV reloads under way, and the second one before it takes off."""
    record = to_record(explain(problem, Plan(rows)))
    answer = {**record, "job_id": "0" * 32, "algorithm": "greedy"}
    return flown_plan(problem, answer), answer


def table(text):
    return list(csv.DictReader(io.StringIO(text)))


def items_of(text):
    loader = mavwp.MAVWPLoader()
    loader._read_waypoints_v110(text.splitlines()[1:])
    return [loader.wp(i) for i in range(loader.count())]


def test_a_route_is_a_sequence_of_flights():
    plan, answer = flown()
    u, v, idle = plan.routes
    assert [[stop.target.id for stop in flight.stops] for flight in u.flights] == [["a"], ["b"]]
    assert [flight.number for flight in u.flown] == [1, 2]
    # A reload before it has moved ends no flight.
    assert [(flight.number, flight.flies) for flight in v.flights] == [(1, False), (1, True)]
    assert not idle.flies
    first, second = u.flights
    visit, reload, last = answer["routes"][0]["stops"]
    assert first.landing.departure_time == pytest.approx(reload["arrival_time"] + 0.25)
    assert first.landing.range_left == pytest.approx(200 - visit["distance"] - reload["distance"])
    assert first.landing.endurance_left == pytest.approx(3 - reload["arrival_time"])
    assert (first.aboard, second.loaded, second.aboard) == ((4, 0), (3, 1), (3, 1))
    assert second.stops[0].range_left == pytest.approx(200 - last["distance"])
    assert second.take_off_time == pytest.approx(2 - last["distance"] / 80)
    assert second.landing.base.id == answer["routes"][0]["landing"]["base_id"] == "depot"


def test_a_flight_file_takes_off_at_its_base_and_lands_at_the_next():
    first, second = flown()[0].routes[0].flights
    choices = FlightChoices(delivery=Delivery.NONE)
    items = items_of(waypoint_file(first, choices))
    assert [item.command for item in items][-3:] == [93, WAYPOINT, LAND]
    assert (items[0].y, items[0].x) == pytest.approx(START)
    assert (items[-1].y, items[-1].x, items[-1].z) == pytest.approx((*DEPOT, 0))
    # It takes off at the base where it lands again, which is a return to launch.
    items = items_of(waypoint_file(second, choices))
    assert (items[0].y, items[0].x) == (items[1].y, items[1].x) == pytest.approx(DEPOT)
    assert [item.command for item in items][1::2] == [TAKEOFF, WAYPOINT]
    assert items[-1].command == RETURN
    content = json.loads(plan_file(second, choices))
    assert content["mission"]["plannedHomePosition"] == [*DEPOT[::-1], 0]
    (note,) = content["notes"]
    assert f"takes off {second.take_off_time:g} h" in note
    assert "'depot': reload" in json.loads(plan_file(first, choices))["notes"][-1]
    assert file_name(second, "plan", numbered=True) == "001-u-flight-2.plan"


def test_a_flight_to_a_base_ends_there_whatever_comes_after_the_last_stop():
    first, second = flown()[0].routes[0].flights
    choices = FlightChoices(delivery=Delivery.LAND, end=Ending.LAND)
    assert [i.command for i in items_of(waypoint_file(first, choices))][-3:] == [TAKEOFF, WAYPOINT, LAND]
    *_, last = items_of(waypoint_file(second, choices))
    assert (last.command, last.y) == (LAND, pytest.approx(34.5))


def test_range_and_endurance_are_those_of_the_flight():
    first, second = flown()[0].routes[0].flights
    for flight, named in ((first, "/routes/0/stops/1"), (second, "/routes/0")):
        short = replace(flight, landing=replace(flight.landing, range_left=-1.0, endurance_left=-0.5))
        with pytest.raises(OutOfRange) as caught:
            plan_file(short, FlightChoices())
        found = {error.pointer: error.detail for error in caught.value.errors}
        assert set(found) == {f"{named}/range_left", f"{named}/endurance_left"}
        assert "0.5 h beyond its endurance of 3 h at base 'depot'" in found[f"{named}/endurance_left"]


def test_who_need_not_return_has_no_way_to_a_base():
    plan, _ = flown(replace(PROBLEM, objective=Objective(return_to_base=False)))
    _, second = plan.routes[0].flights
    assert second.landing.time is None
    with pytest.raises(OutOfRange, match="no way home"):
        plan_file(second, FlightChoices())
    assert plan_file(second, FlightChoices(end=Ending.LAND))


def test_csv_has_reloads_flights_and_loads():
    plan, answer = flown()
    rows = [row for row in table(csv_table(plan)) if row["uav_id"] == "u"]
    told = [(row["order"], row["event"], row["flight"], row["target_id"], row["base_id"]) for row in rows]
    assert told == [
        ("0", "start", "1", "", ""),
        ("1", "visit", "1", "a", ""),
        ("2", "reload", "1", "", "depot"),
        ("3", "visit", "2", "b", ""),
        ("4", "return", "2", "", "depot"),
    ]
    _, reload, last = answer["routes"][0]["stops"]
    assert [float(rows[2][f"loaded_{k}"]) for k in (1, 2)] == reload["loaded"] == [3, 1]
    assert float(rows[2]["departure_time"]) == reload["departure_time"]
    assert float(rows[2]["time"]) == reload["arrival_time"]
    assert (float(rows[2]["x"]), float(rows[4]["y"])) == DEPOT
    assert float(rows[3]["range_left"]) == last["range_left"]
    assert rows[3]["waits_on_ground"] == "1"


def test_the_load_sheet_has_every_load_by_place_and_time():
    plan, answer = flown()
    rows = table(load_sheet(plan))
    aboard = [
        (r["base_id"], r["uav_id"], r["flight"], float(r["aboard_1"]), float(r["aboard_2"])) for r in rows
    ]
    assert aboard == [
        ("", "u", "1", 4, 0),
        ("", "v", "1", 0, 0),
        ("depot", "v", "1", 2, 2),
        ("depot", "u", "2", 3, 1),
    ]
    landed = [row["landing_time"] for row in rows]
    assert landed == ["", "", "0.0", repr(answer["routes"][0]["stops"][1]["arrival_time"])]
    assert rows[1]["take_off_time"] == ""
    assert float(rows[2]["take_off_time"]) == float(rows[2]["ready_time"]) == 0.25
    taken = [sum(float(row[f"loaded_{k}"]) for row in rows[2:]) for k in (1, 2)]
    assert [5 - taken[0], 9 - taken[1]] == answer["bases"][0]["stock"]


def test_geojson_has_bases_and_a_line_a_flight():
    plan, answer = flown()
    features = json.loads(geojson(plan))["features"]
    depot, spare = (each["properties"] for each in features if each["properties"]["kind"] == "base")
    assert depot["stock"] == [5, 9]
    assert depot["stock_left"] == answer["bases"][0]["stock"]
    assert (depot["name"], depot["turnaround"]) == ("Depot <1>", 0.25)
    assert spare["stock"] is spare["stock_left"] is None
    lines = [each for each in features if each["properties"]["kind"] == "route"]
    told = [
        (p["uav_id"], p["flight"], p["from_base_id"], p["to_base_id"])
        for p in (line["properties"] for line in lines)
    ]
    assert told == [("u", 1, None, "depot"), ("u", 2, "depot", "depot"), ("v", 1, "depot", None)]
    first, second, _ = lines
    assert [stop["kind"] for stop in first["properties"]["stops"]] == ["visit", "reload"]
    assert first["properties"]["stops"][1]["loaded"] == [3, 1]
    assert first["geometry"]["coordinates"][-1] == second["geometry"]["coordinates"][0] == list(DEPOT)
    legs = [stop["distance"] for stop in answer["routes"][0]["stops"]]
    assert first["properties"]["distance"] == pytest.approx(legs[0])
    assert first["properties"]["return_distance"] == pytest.approx(legs[1])


def test_the_printed_page_has_flights_loads_and_stocks():
    page = printed_page(flown()[0])
    assert page.count("<polyline") == 2
    assert "reload: base Depot &lt;1&gt; (depot)" in page
    assert "home: base Depot &lt;1&gt; (depot)" in page
    assert "Flight 2, with 3 · 1; takes off " in page
    _, sheet, stocks, _ = (part.split("</section>")[0] for part in _parts(page))
    assert sheet.count("<tr>") == 1 + 4
    assert "5 · 9" in stocks
    assert "0 · 6" in stocks
    assert "as much as is asked for" in stocks


def _parts(page):
    """The page before the load sheet, the sheet, the stocks, and what comes after."""
    cuts = [0, page.index("<h2>Load sheet"), page.index("<h2>Stocks"), page.index("<h2>Unmet"), len(page)]
    return [page[a:b] for a, b in pairwise(cuts)]


@pytest.fixture(scope="module")
def served(service):
    """The job and the answer of the plan, evaluated by the service."""
    body = {**problem_to_record(PROBLEM), "algorithm": "greedy"}
    return service.client.post("/allocate", json=body).raise_for_status().json()


def test_the_service_gives_a_file_a_flight_and_the_load_sheet(client, served):
    url = f"/jobs/{served['job_id']}/plan"
    archive = client.get(url, params={"format": "qgc-plan"})
    assert archive.status_code == 200, archive.text
    names = zipfile.ZipFile(io.BytesIO(archive.content)).namelist()
    lengths = {}
    for name in names:
        uav, flight = name.removesuffix(".plan").split("-flight-")
        lengths[uav] = max(lengths.get(uav, 0), int(flight))
    assert sum(lengths.values()) == len(names) > len(lengths)
    several = max(lengths, key=lengths.get)
    alone = client.get(url, params={"format": "qgc-plan", "uav": several[4:]})
    assert zipfile.ZipFile(io.BytesIO(alone.content)).namelist() == [
        n for n in names if n.startswith(several)
    ]
    sheet = client.get(url, params={"format": "load-sheet"})
    assert sheet.headers["content-type"] == "text/csv; charset=utf-8"
    assert "-loads.csv" in sheet.headers["content-disposition"]
    reloads = [s for route in served["routes"] for s in route["stops"] if s["kind"] == "reload"]
    assert len([row for row in table(sheet.text) if row["base_id"]]) == len(reloads) > 0
