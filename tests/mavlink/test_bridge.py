"""Simulated vehicles and a real service, over UDP on the loopback interface, with lost messages."""

import os
import signal
import struct
import subprocess
import sys
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import httpx
import pytest
from pymavlink import mavwp
from pymavlink.dialects.v20 import common
from simulated_vehicle import SimulatedVehicle
from typer.testing import CliRunner

from app.api.plan_formats.errors import NotGeographic
from app.api.plan_formats.mission import FlightChoices
from app.api.plan_formats.qgroundcontrol import waypoint_file
from app.cli import application
from app.mavlink.bridge import Choices, fly, read_log
from app.mavlink.errors import LinkFailed, ServiceRefused
from app.mavlink.flights import next_flights
from app.mavlink.service import MissionClient
from app.mavlink.streams import UdpStream

HOME = (34.835447, -19.818474)


@contextmanager
def flying(url, mission, lines, **choices):
    """Run a bridge; yield its port."""
    client, stream, stop = MissionClient(url, mission.id, None), UdpStream("127.0.0.1:0"), threading.Event()
    ended = []

    def run():
        try:
            ended.append(fly(stream, client, Choices(**{"systems": {}, **choices}), lines.append, stop))
        except Exception as error:
            ended.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield stream.port
    finally:
        stop.set()
        thread.join()
        stream.close()
        client.close()
    assert [each for each in ended if isinstance(each, Exception)] == []


def wait_for(found):
    """Ask until there is something."""
    for _ in range(600):
        if value := found():
            return value
        threading.Event().wait(0.05)
    raise AssertionError("it has not come")


def plan_of(mission, uav_id):
    (route,) = [each for each in mission.read("/plan")["routes"] if each["uav_id"] == uav_id]
    return [stop["target_id"] for stop in route["stops"]]


def as_file(mission, uav_id, tmp_path):
    """The waypoints of the next flight, as a flight file has them and pymavlink reads them."""
    flight = next_flights(mission.read()["state"], mission.read("/plan"))[uav_id]
    file = tmp_path / "flight.waypoints"
    file.write_text(waypoint_file(flight, FlightChoices()))
    loader = mavwp.MAVWPLoader()
    loader.load(str(file))
    return [loader.wp(n) for n in range(loader.count())]


def visited(mission, items):
    """The areas that waypoints lead to, in their order."""
    places = {
        (round(area["y"] * 1e7), round(area["x"] * 1e7)): area["id"] for area in mission.problem["targets"]
    }
    found = [places.get((item.x, item.y)) for item in items if item.command == common.MAV_CMD_NAV_WAYPOINT]
    return [each for each in found if each is not None]


@pytest.mark.parametrize("lost", [0.0, 0.25])
def test_vehicles_get_their_flights_and_tell_where_they_are(service, begin, tmp_path, lost):
    mission = begin()
    assert mission.accept("first")
    planned = {
        name: (plan_of(mission, name), as_file(mission, name, tmp_path)) for name in ("long-1", "long-2")
    }
    lines = []
    with (
        flying(service.url, mission, lines, upload=True, every_s=0.2, clock_every_s=0.0) as port,
        SimulatedVehicle(1, port, HOME, lost=lost) as one,
        SimulatedVehicle(2, port, HOME, lost=lost, autopilot=common.MAV_AUTOPILOT_PX4) as other,
    ):
        for vehicle in (one, other):
            items = vehicle.await_missions(1)
            stops, expected = planned[f"long-{vehicle.system}"]
            assert visited(mission, items) == stops
            # ArduPilot has its home as item 0, PX4 has not.
            expected = expected if vehicle is one else expected[1:]
            assert [each.command for each in items] == [each.command for each in expected]
            assert [each.frame for each in items] == [each.frame for each in expected]
            for got, wanted in zip(items, expected, strict=True):
                assert (got.x / 1e7, got.y / 1e7, got.z) == pytest.approx(
                    (wanted.x, wanted.y, wanted.z), abs=1e-6
                )
        one.aloft = True
        wait_for(lambda: mission.read()["positions"].get("long-1", {}).get("airborne"))
        wait_for(lambda: "long-2" in mission.read()["positions"])
        # An acknowledgement that is lost is asked for again.
        said = [
            f"{name!r} has its flight: {' → '.join(stops)} → /home" for name, (stops, _) in planned.items()
        ]
        wait_for(lambda: set(said) <= set(lines))
    told = mission.read()["positions"]
    assert told["long-1"]["x"] == pytest.approx(HOME[0], abs=1e-6)
    assert told["long-1"]["y"] == pytest.approx(HOME[1], abs=0.0011)
    assert mission.read()["clock"] == 0
    batches = mission.events("telemetry")
    assert all(len(each["event"]["positions"]) <= 2 for each in batches)


def test_a_vehicle_that_asks_gets_the_flight_and_a_new_plan_is_sent(service, begin):
    mission = begin()
    mission.accept("first")
    lines = []
    with (
        flying(service.url, mission, lines, systems={9: "mid-1"}, clock_every_s=0.0) as port,
        SimulatedVehicle(9, port, HOME, lost=0.2) as vehicle,
        SimulatedVehicle(3, port, HOME) as stranger,
    ):
        wait_for(lambda: any("system 3 is no UAV of the mission" in each for each in lines))
        assert vehicle.missions == []
        vehicle.asks = True
        assert visited(mission, vehicle.await_missions(1)) == plan_of(mission, "mid-1")
        first = plan_of(mission, "mid-1")
        mission.tell("gone", type="area_cancelled", target_id=first[0])
        wait_for(lambda: first[0] not in plan_of(mission, "mid-1"))
        while visited(mission, vehicle.missions[-1]) != plan_of(mission, "mid-1"):
            vehicle.asks = True
            vehicle.await_missions(len(vehicle.missions) + 1)
        assert stranger.missions == []


def test_a_refused_flight_is_said(service, begin):
    mission = begin()
    mission.accept("first")
    lines = []
    with (
        flying(service.url, mission, lines, upload=True, clock_every_s=0.5) as port,
        SimulatedVehicle(1, port, HOME, refuses=True),
    ):
        refused = "'long-1' has not got its flight: the vehicle refuses it (result 4)"
        wait_for(lambda: refused in lines)
        moved = wait_for(lambda: mission.events("clock"))
    # The clock moves to where the vehicle was seen last.
    told = [each["event"]["positions"][0]["time"] for each in mission.events("telemetry")]
    assert moved[0]["at"] in told


@contextmanager
def losing_answers(url, every):
    """Stand before a service, and lose the answer to every n-th event after it was told."""
    counted, keys = [], set()

    class Between(BaseHTTPRequestHandler):
        def do_GET(self):
            self._pass_on(httpx.get(url + self.path, timeout=60))

        def do_POST(self):
            keys.add(self.headers["Authorization"])
            body = self.rfile.read(int(self.headers["Content-Length"]))
            answer = httpx.post(
                url + self.path, content=body, headers={"Content-Type": "application/json"}, timeout=60
            )
            counted.append(answer.status_code)
            if len(counted) % every == 0:
                self.send_error(502)
            else:
                self._pass_on(answer)

        def _pass_on(self, answer):
            self.send_response(answer.status_code)
            self.send_header("Content-Length", str(len(answer.content)))
            self.end_headers()
            self.wfile.write(answer.content)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Between)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}", counted, keys
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def a_log(file, seconds=60, system=1):
    """Write a log of a vehicle that takes off after 10 s and flies north, a position a second."""
    mav = common.MAVLink(None, srcSystem=system, srcComponent=1)
    with file.open("wb") as log:
        log.write(b"\x00" * 5)  # what is no message is passed over
        for second in range(seconds):
            aloft = second >= 10
            state = common.MAV_LANDED_STATE_IN_AIR if aloft else common.MAV_LANDED_STATE_ON_GROUND
            north = 0.0001 * max(0, second - 10)
            place = (round((HOME[1] + north) * 1e7), round(HOME[0] * 1e7))
            for message in (
                mav.heartbeat_encode(2, 3, 0, 0, 4),
                mav.extended_sys_state_encode(0, state),
                mav.global_position_int_encode(second * 1000, *place, 0, 0, 0, 0, 0, 0),
            ):
                log.write(struct.pack(">Q", int((1_700_000_000 + second) * 1e6)) + message.pack(mav))
    return file


def test_a_log_is_told_once_though_answers_are_lost(service, begin, tmp_path):
    mission = begin()
    lines = []
    with losing_answers(service.url, every=3) as (url, counted, keys):
        client = MissionClient(url, mission.id, "a-key")
        told = read_log(a_log(tmp_path / "day.tlog"), client, Choices({}, clock_every_s=20.0), lines.append)
        client.close()
    batches = mission.events("telemetry")
    assert counted.count(200) > 5  # known already
    assert keys == {"Bearer a-key"}
    assert told == len(batches) == 60
    assert len({each["id"] for each in batches}) == 60
    assert any("502" in line for line in lines)
    last = batches[-1]["event"]["positions"][0]
    assert last["time"] == pytest.approx(59 / 3600)
    assert last["airborne"] == pytest.approx(49 / 3600)
    assert last["dis"] == pytest.approx(49 * 0.0001 * 111.195, rel=1e-3)
    assert mission.read()["clock"] == pytest.approx(59 / 3600)


def test_the_command_reads_a_log(service, begin, tmp_path):
    mission = begin()
    file = a_log(tmp_path / "day.tlog", seconds=5, system=7)
    options = ["--url", service.url, "--clock-every-s", "0", "--began", "2023-11-14T21:13:20"]

    ended = CliRunner().invoke(application, ["fly", mission.id, str(file), *options, "--system", "7=mid-2"])

    assert ended.exit_code == 0, ended.output
    assert "system 7 is 'mid-2'" in ended.output
    assert "5 positions" in ended.output
    assert mission.read()["positions"]["mid-2"]["time"] == pytest.approx(1 + 4 / 3600)
    assert mission.read()["clock"] == 0


def test_the_command_listens_until_it_is_interrupted(service, begin):
    mission = begin()
    free = UdpStream("127.0.0.1:0")
    port = free.port
    free.close()

    def interrupt():
        try:
            wait_for(lambda: mission.read()["positions"])
        finally:
            os.kill(os.getpid(), signal.SIGINT)

    with SimulatedVehicle(1, port, HOME):
        thread = threading.Thread(target=interrupt)
        thread.start()
        ended = CliRunner().invoke(
            application, ["fly", mission.id, f"127.0.0.1:{port}", "--url", service.url]
        )
        thread.join()

    assert ended.exit_code == 0, ended.output
    assert f"vehicles are listened to at 127.0.0.1:{port}" in ended.output
    assert int(ended.output.split()[-2]) == sum(
        len(each["event"]["positions"]) for each in mission.events("telemetry")
    )


def test_what_cannot_be_flown_says_why(service, begin, tmp_path):
    flat = begin(crs="local")
    file = a_log(tmp_path / "day.tlog", seconds=2)

    def said(*arguments):
        ended = CliRunner().invoke(application, ["fly", *arguments, "--url", service.url])
        assert ended.exit_code == 1
        return ended.output

    assert "needs 'wgs84'" in said(flat.id, str(file))
    mission = begin()
    assert "'nobody' is no UAV of the mission" in said(mission.id, str(file), "--system", "1=nobody")
    assert "--system 'x'" in said(mission.id, str(file), "--system", "x")
    assert "No such file" in said(mission.id, str(tmp_path / "none.tlog"))
    (tmp_path / "empty.tlog").write_bytes(b"nothing of it")
    assert "no MAVLink message" in said(mission.id, str(tmp_path / "empty.tlog"))
    assert "the service answers 404" in said("0" * 32, str(file))
    away = CliRunner().invoke(application, ["fly", mission.id, str(file), "--url", "http://127.0.0.1:9"])
    assert (away.exit_code, "the mission: " in away.output) == (1, True)
    assert "a host and a port are needed" in said(mission.id, "nowhere")


def test_errors_for_programs(service, begin):
    flat = begin(crs="local")
    client = MissionClient(service.url, flat.id, None)
    stream = UdpStream("127.0.0.1:0")
    with pytest.raises(NotGeographic):
        fly(stream, client, Choices({}), print, threading.Event())
    with pytest.raises(LinkFailed):
        UdpStream(f"127.0.0.1:{stream.port}")
    stream.close()
    client.close()
    for mission_id in ("0" * 32, f"../missions/{flat.id}"):
        nobody = MissionClient(service.url, mission_id, None)
        with pytest.raises(ServiceRefused, match="404"):
            nobody.mission()
        nobody.close()


@pytest.mark.parametrize("package", ["pymavlink", "httpx"])
def test_a_missing_extra_is_named(package):
    code = (
        f"import sys; sys.modules[{package!r}] = None; from app.cli import application;"
        " application(['fly', 'a', 'b.tlog'])"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    assert f"{package} is not installed: pip install 'uav-allocator[mavlink]'" in ended.stderr
