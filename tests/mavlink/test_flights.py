"""The next flights of a mission's UAVs, of a state and a plan that are written out."""

import pytest
from pymavlink.dialects.v20 import common

from app.api.plan_formats.errors import NotGeographic
from app.api.plan_formats.mission import FlightChoices
from app.domain.errors import InvalidProblem
from app.mavlink.flights import goes_on, items_for, next_flights, require_geographic, stops_of

UAV = {
    "x_s": 34.0,
    "y_s": -19.0,
    "x_c": 34.0,
    "y_c": -19.0,
    "speed": 60.0,
    "voyage": 100.0,
    "loadlist": [5.0],
}
AREA = {"x": 34.1, "y": -19.0, "level": 1.0, "loadlist": [3.0]}
MATRICES = {"m": {"distance": [[0.0, 15.0], [15.0, 0.0]], "duration": [[0.0, 0.25], [0.25, 0.0]]}}


def a_mission(**located):
    uavs = [{**UAV, **located, "id": name} for name in ("flies", "gone", "stays")]
    area = {**AREA, "id": "a", **({"location": 1} if located else {})}
    problem = {"crs": "wgs84", "uavs": uavs, "targets": [area]}
    stop = {"target_id": "a", "step": 1, "arrival_time": 0.25, "distance": 15.0, "delivered": [3.0]}
    flown = {
        "distance": 15.0,
        "return_distance": 15.0,
        "stops": [stop],
        "landing": {"time": 0.5, "path": None},
    }
    stays = {"distance": 0.0, "return_distance": 0.0, "stops": [], "landing": None}
    routes = [{"uav_id": "flies", **flown}, {"uav_id": "gone", **flown}, {"uav_id": "stays", **stays}]
    return {"problem": problem, "lost": ["gone"]}, {"routes": routes}


def test_who_flies_has_a_flight_and_who_is_lost_has_none():
    flights = next_flights(*a_mission())
    assert flights.keys() == {"flies"}
    assert stops_of(flights["flies"]) == ("a", "/home")


def test_states_leave_out_matrices():
    mission = a_mission(location=0)
    assert next_flights(*mission, MATRICES).keys() == {"flies"}
    with pytest.raises(InvalidProblem, match="needs `matrices`"):
        next_flights(*mission)


def test_ardupilot_has_its_home_as_the_first_item():
    flight = next_flights(*a_mission())["flies"]
    plain = items_for(flight, FlightChoices(), common.MAV_AUTOPILOT_PX4)
    home, *rest = items_for(flight, FlightChoices(), common.MAV_AUTOPILOT_ARDUPILOTMEGA)
    assert tuple(rest) == plain == items_for(flight, FlightChoices(), None)
    assert (home.command, home.frame, home.place) == (
        common.MAV_CMD_NAV_WAYPOINT,
        common.MAV_FRAME_GLOBAL,
        (34.0, -19.0, 0.0),
    )


def test_a_flight_goes_on_where_stops_were_made_and_none_was_changed():
    assert goes_on(("a", "b", "/home"), ("b", "/home"))
    assert goes_on(("a", "/home"), ("/home",))
    assert not goes_on(("a", "b", "/home"), ("a", "/home"))
    assert not goes_on(("a", "/home"), ("a", "/depot"))
    assert not goes_on((), ("a", "/home"))


def test_positions_on_a_plane_are_refused():
    with pytest.raises(NotGeographic, match="'local'"):
        require_geographic({"crs": "local"})
