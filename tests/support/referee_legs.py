"""Legs of a problem in plain Python, by section 8 of the rules: length over ground, air length, time.

It shares no code with the product. On the globe ways round zones are looked for on a gnomonic plane, where
great circles are straight, and measured on the sphere; all is within some degrees there.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

from exact_ways import ExactWays, exact


class Leg(NamedTuple):
    """One leg: length over ground, air length, time."""

    ground: float
    air: float
    time: float


class Place(NamedTuple):
    """A place of a problem: where it is, and its row in matrices."""

    x: float
    y: float
    row: int | None = None


def start_of(uav):
    """Where a UAV is now."""
    x, y = uav.get("x_c"), uav.get("y_c")
    here = (uav["x_s"] if x is None else x, uav["y_s"] if y is None else y)
    return Place(*here, uav.get("location"))


def home_of(uav):
    """Where a UAV returns to."""
    row = uav.get("home_location")
    return Place(uav["x_s"], uav["y_s"], uav.get("location") if row is None else row)


def place_of(area):
    """Where an area is."""
    return Place(area["x"], area["y"], area.get("location"))


class Legs:
    """The legs of one problem; ways round zones are remembered."""

    def __init__(self, problem):
        self.crs = problem.get("crs", "local")
        self.matrices, self.wind = problem.get("matrices"), problem.get("wind")
        zones = [zone["polygon"] for zone in problem.get("no_fly_zones") or ()]
        self._middle = zones[0][0] if zones else None
        self._places = {}
        flat = [[self._flat(*corner) for corner in zone] for zone in zones]
        self.ways = ExactWays(flat, self._measure) if zones else None
        self.corners = {(float(x), float(y)) for zone in zones for x, y in zone}
        self._known = {}

    def leg(self, uav, a, b):
        """The leg of a UAV from a place to another; None where there is none."""
        key = (uav["speed"], uav.get("profile"), a, b)
        if key not in self._known:
            self._known[key] = self._leg(uav, a, b)
        return self._known[key]

    def _leg(self, uav, a, b):
        if self.matrices:
            return self._given(uav, a.row, b.row)
        points = self.points(a, b)
        if points is None:
            return None
        ground = time = 0.0
        for begin, end in pairwise(points):
            piece = apart(self.crs, begin, end)
            over_ground = self._over_ground(uav["speed"], begin, end) if piece else uav["speed"]
            if over_ground is None:
                return None
            ground, time = ground + piece, time + piece / over_ground
        return Leg(ground, time * uav["speed"], time) if self.wind else Leg(ground, ground, time)

    def points(self, a, b):
        """The points of the shortest way; None where there is none."""
        if self.ways is None:
            return [(a.x, a.y), (b.x, b.y)]
        _, points = self.ways.way(self._flat(a.x, a.y), self._flat(b.x, b.y))
        return points and [self._places[point] for point in points]

    def _flat(self, x, y):
        """Where a place is on the plane on which ways are straight."""
        at = (x, y)
        if self.crs != "local":
            lon_0, lat_0, lon, lat = map(math.radians, (*self._middle, x, y))
            up = math.sin(lat_0) * math.sin(lat) + math.cos(lat_0) * math.cos(lat) * math.cos(lon - lon_0)
            ahead = math.cos(lat_0) * math.sin(lat) - math.sin(lat_0) * math.cos(lat) * math.cos(lon - lon_0)
            at = (math.cos(lat) * math.sin(lon - lon_0) / up, ahead / up)
        self._places[exact(at)] = (float(x), float(y))
        return at

    def _measure(self, a, b):
        """Length of a straight piece, by its ends on the plane."""
        return apart(self.crs, self._places[a], self._places[b])

    def _given(self, uav, row, column):
        matrix = self.matrices[uav.get("profile") or next(iter(self.matrices))]
        length, times = matrix["distance"][row][column], matrix.get("duration")
        time = times[row][column] if times else length is not None and length / uav["speed"]
        return None if length is None or time is None else Leg(length, length, time)

    def _over_ground(self, speed, a, b):
        """Speed over ground along a straight piece; None where the wind is too strong."""
        if not self.wind:
            return speed
        angle = math.radians(self.wind["towards"]) - bearing(self.crs, a, b)
        along, across = self.wind["speed"] * math.cos(angle), self.wind["speed"] * math.sin(angle)
        if abs(across) >= speed:
            return None
        over_ground = along + math.sqrt(speed**2 - across**2)
        return over_ground if over_ground > 0 else None


def bearing(crs, a, b):
    """Direction from a point to another, clockwise from north; on the globe that in which the arc begins."""
    if crs == "local":
        return math.atan2(b[0] - a[0], b[1] - a[1])
    (lon_a, lat_a), (lon_b, lat_b) = ([math.radians(v) for v in point] for point in (a, b))
    north = math.cos(lat_a) * math.sin(lat_b) - math.sin(lat_a) * math.cos(lat_b) * math.cos(lon_b - lon_a)
    return math.atan2(math.sin(lon_b - lon_a) * math.cos(lat_b), north)


def apart(crs, a, b):
    """Distance on the plane, or by the haversine formula on a sphere of 6371.0088 km.

    A place with two spellings is one: 180 and -180, and a pole with any longitude.
    """
    if crs == "local":
        return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2)
    if a[1] == b[1] and (abs(a[1]) == 90 or (a[0] - b[0]) % 360 == 0):
        return 0.0
    (lon_a, lat_a), (lon_b, lat_b) = ([math.radians(v) for v in point] for point in (a, b))
    chord = (
        math.sin((lat_b - lat_a) / 2) ** 2
        + math.cos(lat_a) * math.cos(lat_b) * math.sin((lon_b - lon_a) / 2) ** 2
    )
    return 2 * 6371.0088 * math.asin(min(1.0, math.sqrt(chord)))
