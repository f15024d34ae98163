"""From messages to positions: worked out by hand."""

import pytest
from pymavlink.dialects.v20 import common

from app.mavlink.errors import UnknownVehicle
from app.mavlink.vehicles import MissionClock, Vehicle, assigned

CLOCK = MissionClock(0.5, 1_000.0)
KM_A_DEGREE = 6371.0088 * 3.141592653589793 / 180


def message(kind, **fields):
    made = getattr(common.MAVLink(None, srcSystem=1), f"{kind}_encode")(**fields)
    made._header.srcComponent = 1
    return made


def heartbeat(armed, kind=common.MAV_TYPE_QUADROTOR):
    mode = common.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    return message(
        "heartbeat",
        type=kind,
        autopilot=common.MAV_AUTOPILOT_PX4,
        base_mode=mode,
        custom_mode=0,
        system_status=0,
    )


def landed(state):
    return message("extended_sys_state", vtol_state=0, landed_state=state)


def at(latitude, longitude=30.0, height_mm=0):
    place = {"lat": round(latitude * 1e7), "lon": round(longitude * 1e7)}
    none = dict.fromkeys(("time_boot_ms", "alt", "vx", "vy", "vz", "hdg"), 0)
    return message("global_position_int", **place, relative_alt=height_mm, **none)


def test_a_position_has_the_missions_clock():
    told = Vehicle("u").take(at(-20.5), 1_360.0, CLOCK)
    assert told == {"uav_id": "u", "time": pytest.approx(0.6), "x": 30.0, "y": -20.5}
    assert MissionClock(0.1, 1_000.0).at(0.0) == 0.0


def test_a_flight_whose_take_off_was_seen_has_its_distance_and_time():
    vehicle = Vehicle("u")
    vehicle.take(landed(common.MAV_LANDED_STATE_ON_GROUND), 999.0, CLOCK)
    vehicle.take(at(10.0), 1_000.0, CLOCK)
    vehicle.take(landed(common.MAV_LANDED_STATE_TAKEOFF), 1_001.0, CLOCK)
    vehicle.take(at(10.0), 1_002.0, CLOCK)
    vehicle.take(landed(common.MAV_LANDED_STATE_IN_AIR), 1_003.0, CLOCK)
    vehicle.take(at(10.01), 1_040.0, CLOCK)

    told = vehicle.take(at(10.0), 1_074.0, CLOCK)

    assert told["airborne"] == pytest.approx(72 / 3600)
    assert told["dis"] == pytest.approx(0.02 * KM_A_DEGREE)
    # What hovers has a position that trembles, and flies no way by that.
    told = vehicle.take(at(10.00001), 1_075.0, CLOCK)
    assert told["dis"] == pytest.approx(0.02 * KM_A_DEGREE)
    vehicle.take(landed(common.MAV_LANDED_STATE_ON_GROUND), 1_080.0, CLOCK)
    assert vehicle.take(at(10.0), 1_081.0, CLOCK).keys() == {"uav_id", "time", "x", "y"}


def test_a_flight_that_was_under_way_and_one_in_wind_are_not_measured():
    late = Vehicle("u")
    late.take(landed(common.MAV_LANDED_STATE_IN_AIR), 1_000.0, CLOCK)
    late.take(at(10.0), 1_001.0, CLOCK)
    assert "airborne" not in late.take(at(10.1), 1_100.0, CLOCK)
    blown = Vehicle("u", measures=False)
    for state, time_s in ((common.MAV_LANDED_STATE_ON_GROUND, 0.0), (common.MAV_LANDED_STATE_IN_AIR, 36.0)):
        blown.take(landed(state), 1_000.0 + time_s, CLOCK)
        told = blown.take(at(10.0), 1_000.0 + time_s, CLOCK)
    told = blown.take(at(10.1), 1_072.0, CLOCK)
    assert told["airborne"] == pytest.approx(0.01)
    assert "dis" not in told


def test_who_says_nothing_of_landing_flies_when_armed_and_off_the_ground():
    vehicle = Vehicle("u")
    vehicle.take(heartbeat(armed=False), 1_000.0, CLOCK)
    assert vehicle.autopilot == common.MAV_AUTOPILOT_PX4
    vehicle.take(at(10.0), 1_000.0, CLOCK)
    vehicle.take(heartbeat(armed=True), 1_001.0, CLOCK)
    assert "airborne" not in vehicle.take(at(10.0), 1_002.0, CLOCK)
    vehicle.take(at(10.0, height_mm=5_000), 1_003.0, CLOCK)
    assert vehicle.take(at(10.0, height_mm=5_000), 1_039.0, CLOCK)["airborne"] == pytest.approx(0.01)


def test_no_fix_and_ground_stations_tell_nothing():
    vehicle = Vehicle("u")
    assert vehicle.take(at(0.0, 0.0), 1_000.0, CLOCK) is None
    vehicle.take(heartbeat(armed=True, kind=common.MAV_TYPE_GCS), 1_000.0, CLOCK)
    assert vehicle.component is None


def test_systems_are_uavs_by_their_order_or_as_given():
    assert assigned(["a", "b"], {}) == {1: "a", 2: "b"}
    assert assigned(["a", "b"], {7: "a"}) == {7: "a"}
    with pytest.raises(UnknownVehicle, match="system 7: 'c' is no UAV of the mission; the mission has a, b"):
        assigned(["a", "b"], {7: "c"})
    with pytest.raises(UnknownVehicle, match="system 8: 'a' is another system's already"):
        assigned(["a", "b"], {7: "a", 8: "a"})
