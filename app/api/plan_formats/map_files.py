"""Flights for maps and receivers: KML 2.2 (OGC 07-147r2) and GPX 1.1."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

from app.api.plan_formats.altitudes import altitude_text
from app.api.plan_formats.antimeridian import closed
from app.api.plan_formats.flights import Flight, Point
from app.api.plan_formats.flown_plan import FlownPlan
from app.api.plan_formats.launches import PlannedFlight
from app.api.plan_formats.mission import Altitude
from app.api.plan_formats.printed_text import amounts_text, called
from app.domain.clock import clock

KML_TYPE = "application/vnd.google-earth.kml+xml"
GPX_TYPE = "application/gpx+xml"
_KML = "http://www.opengis.net/kml/2.2"
_GPX = "http://www.topografix.com/GPX/1/1"


def kml(plan: FlownPlan, flights: Sequence[PlannedFlight]) -> str:
    """Write a folder each of flights, areas, bases and no-fly zones of a ``wgs84`` plan.

    Flights are drawn at their altitudes above the ground: KML has no altitude above where one starts.
    """
    root = ET.Element("kml", xmlns=_KML)
    document = ET.SubElement(root, "Document")
    ET.SubElement(document, "name").text = f"Plan {plan.job_id[:8]}"
    folder = _folder(document, "Flights")
    for each in flights:
        place = _placemark(folder, _name(plan, each.flight), _about(each))
        line = ET.SubElement(place, "LineString")
        ET.SubElement(line, "tessellate").text = "1"
        ET.SubElement(line, "altitudeMode").text = "relativeToGround"
        ET.SubElement(line, "coordinates").text = " ".join(
            _coordinates(way, high.metres) for way, high in _ways(each)
        )
    folder = _folder(document, "Areas")
    for target in plan.problem.targets:
        place = _placemark(folder, called(target), f"needs {amounts_text(target.loadlist)}")
        _point(place, target.x, target.y)
    folder = _folder(document, "Bases")
    for base in plan.problem.bases:
        _point(_placemark(folder, called(base), None), base.x, base.y)
    folder = _folder(document, "No-fly zones")
    for zone in plan.problem.no_fly_zones:
        place = _placemark(folder, called(zone), None)
        boundary = ET.SubElement(ET.SubElement(place, "Polygon"), "outerBoundaryIs")
        ring = ET.SubElement(boundary, "LinearRing")
        ET.SubElement(ring, "coordinates").text = _coordinates(closed(zone.polygon), None)
    return _written(root)


def gpx(plan: FlownPlan, flights: Sequence[PlannedFlight]) -> str:
    """Write the areas as waypoints, and a route a flight, of a ``wgs84`` plan.

    Elevations, which GPX has above the sea, are not known; altitudes are told in words.
    """
    root = ET.Element("gpx", xmlns=_GPX, version="1.1", creator="uav-allocator")
    metadata = ET.SubElement(root, "metadata")
    ET.SubElement(metadata, "name").text = f"Plan {plan.job_id[:8]}"
    for target in plan.problem.targets:
        point = ET.SubElement(root, "wpt", lat=repr(target.y), lon=repr(target.x))
        ET.SubElement(point, "name").text = called(target)
    for each in flights:
        route = ET.SubElement(root, "rte")
        ET.SubElement(route, "name").text = _name(plan, each.flight)
        ET.SubElement(route, "desc").text = _about(each)
        names = {stop.path[-1]: called(stop.target) for stop in each.flight.stops}
        for x, y in _way(each.flight):
            point = ET.SubElement(route, "rtept", lat=repr(y), lon=repr(x))
            if (x, y) in names:
                ET.SubElement(point, "name").text = names[x, y]
    return _written(root)


def _written(root: ET.Element) -> str:
    ET.indent(root, " ")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _folder(document: ET.Element, name: str) -> ET.Element:
    folder = ET.SubElement(document, "Folder")
    ET.SubElement(folder, "name").text = name
    return folder


def _placemark(folder: ET.Element, name: str, about: str | None) -> ET.Element:
    place = ET.SubElement(folder, "Placemark")
    ET.SubElement(place, "name").text = name
    if about is not None:
        ET.SubElement(place, "description").text = about
    return place


def _point(place: ET.Element, x: float, y: float) -> None:
    ET.SubElement(ET.SubElement(place, "Point"), "coordinates").text = _coordinates([(x, y)], None)


def _coordinates(points: Sequence[Point], height: float | None) -> str:
    up = "" if height is None else f",{height:g}"
    return " ".join(f"{x!r},{y!r}{up}" for x, y in points)


def _name(plan: FlownPlan, flight: Flight) -> str:
    return called(flight.uav) + (f", flight {flight.number}" if plan.has_bases else "")


def _about(each: PlannedFlight) -> str:
    choices, takes_off = each.choices, each.flight.take_off_time
    begin = "in the air already" if takes_off is None else f"takes off at {clock(takes_off)} h"
    return "; ".join([f"{begin}, {altitude_text(choices.altitudes)}", *each.warnings])


def _ways(planned: PlannedFlight) -> list[tuple[list[Point], Altitude]]:
    """Return what is flown over leg by leg; where a leg begins only if its altitude is another one."""
    flight, choices = planned.flight, planned.choices
    ways = [([flight.place], choices.altitude(0))]
    for leg, path in enumerate((*(stop.path for stop in flight.stops), flight.landing.path)):
        high = choices.altitude(leg)
        begin = 0 if high != ways[-1][1] else 1
        ways.append(([*path[begin:]], high))
    return ways


def _way(flight: Flight) -> list[Point]:
    """Return all places that a flight goes over, in turn."""
    places = [flight.place]
    for path in (*(stop.path for stop in flight.stops), flight.landing.path):
        places += path[1:]
    return places
