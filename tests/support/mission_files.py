"""The rules by which other programs read the files of a mission."""

import math

from pymavlink import mavwp

WAYPOINT, RETURN, LAND, TAKEOFF, DELAY, PLACE, SPEED, SERVO, GRIPPER = 16, 20, 21, 22, 93, 94, 178, 183, 211


def commands(text):
    """The commands of a waypoint file as pymavlink's loader reads it, and the loader."""
    loader = mavwp.MAVWPLoader()
    lines = text.splitlines()
    assert lines[0] == "QGC WPL 110"
    loader._read_waypoints_v110(lines[1:])
    return [loader.wp(i).command for i in range(loader.count())], loader


def check_as_qgroundcontrol(content):
    """The rules of QGroundControl's loader for a plan of simple items: keys, types, versions, counts."""
    assert (content["fileType"], content["version"]) == ("Plan", 1)
    assert isinstance(content["groundStation"], str)
    assert content["geoFence"]["version"] == 2
    assert content["geoFence"]["circles"] == content["geoFence"]["polygons"] == []
    assert content["rallyPoints"] == {"version": 2, "points": []}
    mission = content["mission"]
    assert mission["version"] == 2
    for key in ("firmwareType", "vehicleType", "globalPlanAltitudeMode"):
        assert isinstance(mission[key], int)
    for key in ("cruiseSpeed", "hoverSpeed"):
        assert mission[key] > 0
    latitude, longitude, altitude = mission["plannedHomePosition"]
    assert -90 <= latitude <= 90
    assert -180 <= longitude <= 180
    assert altitude == 0
    assert mission["items"], "a mission has at least one item"
    for number, item in enumerate(mission["items"], 1):
        assert item["type"] == "SimpleItem"
        assert item["doJumpId"] == number
        assert item["autoContinue"] is True
        assert isinstance(item["command"], int)
        assert item["frame"] in (2, 3, 10)
        assert len(item["params"]) == 7
        assert all(value is None or isinstance(value, int | float) for value in item["params"][:4])
        assert all(math.isfinite(value) for value in item["params"][4:])
        if item["frame"] != 2:
            assert item["AMSLAltAboveTerrain"] is None
            assert item["AltitudeMode"] in (1, 4)
            assert item["Altitude"] == item["params"][6]
