"""The whole plan as GeoJSON (RFC 7946): starting points, areas, bases, no-fly zones, and a line a route.

Where there are bases it is a line a flight.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from app.api.plan_formats.antimeridian import closed, cut_line, cut_ring
from app.api.plan_formats.flights import Flight, FlownReload, FlownStop
from app.api.plan_formats.flown_plan import FlownPlan, FlownRoute
from app.domain.fields import declared_fields
from app.domain.problem import UAV, Target
from app.domain.records import item_to_record
from app.domain.surroundings import Base, NoFlyZone

MEDIA_TYPE = "application/geo+json"


def geojson(plan: FlownPlan) -> str:
    """Write a feature collection: a Point a UAV, an area and a base, a Polygon a zone, a LineString a flight.

    The positions of a ``local`` problem are no longitudes and latitudes, which RFC 7946 has only by prior
    arrangement: the member ``coordinates`` says which they are. What crosses the antimeridian is cut there
    (section 3.1.9).
    """
    geographic = plan.problem.crs == "wgs84"
    features = [_start(route) for route in plan.routes]
    features += _areas(plan)
    features += _bases(plan)
    features += [_zone(zone, geographic=geographic) for zone in plan.problem.no_fly_zones]
    features += [
        _line(plan, route, flight, geographic=geographic)
        for route in plan.flying
        for flight in (route.flown if plan.has_bases else route.flights)
    ]
    content = {
        "type": "FeatureCollection",
        "coordinates_are": "longitude and latitude in degrees (WGS 84)" if geographic else "x and y, local",
        "plan": {
            "job_id": plan.job_id,
            "algorithm": plan.algorithm,
            "reward": plan.reward,
            "satisfaction": plan.satisfaction,
            "distance": plan.distance,
        },
        **({"wind": item_to_record(plan.problem.wind)} if plan.problem.wind is not None else {}),
        "features": features,
    }
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _start(route: FlownRoute) -> dict[str, Any]:
    uav = route.uav
    instead: dict[str, dict[str, Any]] = {
        "id": {"uav_id": uav.id},
        "x_s": {"home": [uav.x_s, uav.y_s]},
        "dis": {"range_left": uav.voyage - uav.dis},
        # It is where the point is, and what it does is in the plan.
        **{name: {} for name in ("y_s", "x_c", "y_c", "ret")},
    }
    return _feature("uav", "Point", [uav.x_c, uav.y_c], **_fields(uav, instead))


def _areas(plan: FlownPlan) -> list[dict[str, Any]]:
    unmet = {each.target.id: each for each in plan.unmet}
    features = []
    for target in plan.problem.targets:
        missing = unmet.get(target.id)
        instead: dict[str, dict[str, Any]] = {
            "id": {"target_id": target.id},
            "loadlist": {
                "requested": list(target.loadlist if target.requested is None else target.requested),
                "needs": list(target.loadlist),
                "remaining": [0.0] * len(target.loadlist) if missing is None else list(missing.remaining),
                "reason": None if missing is None else missing.reason,
            },
            # The area is where the point is, and the stops of the routes have their times.
            **{name: {} for name in ("x", "y", "service_time", "requested")},
        }
        features.append(_feature("area", "Point", [target.x, target.y], **_fields(target, instead)))
    return features


def _bases(plan: FlownPlan) -> Iterator[dict[str, Any]]:
    left = {each.base.id: each.amounts for each in plan.stocks}
    for base in plan.problem.bases:
        amounts = left.get(base.id)
        instead: dict[str, dict[str, Any]] = {
            "id": {"base_id": base.id},
            "stock": {
                "stock": None if base.stock is None else list(base.stock),
                "stock_left": None if amounts is None else list(amounts),
            },
            "x": {},
            "y": {},
        }
        yield _feature("base", "Point", [base.x, base.y], **_fields(base, instead))


def _fields(
    item: UAV | Target | Base | NoFlyZone, instead: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the fields of an item by their names, but for those in whose place something else is said."""
    of: type = type(item)
    record = item_to_record(item)
    properties: dict[str, Any] = {}
    for each in declared_fields(of):
        if each.name in instead:
            properties.update(instead[each.name])
        elif each.name in record:
            properties[each.name] = record[each.name]
    return properties


def _line(plan: FlownPlan, route: FlownRoute, flight: Flight, *, geographic: bool) -> dict[str, Any]:
    landing = flight.landing
    places = [flight.place]
    for stop in flight.stops:
        places += stop.path[1:]
    if landing.distance > 0:
        places += landing.path[1:]
    lines = cut_line(places) if geographic else [places]
    several = len(lines) > 1
    coordinates = [[list(point) for point in line] for line in lines]
    stops = [_stop(plan, stop) for stop in flight.stops]
    if isinstance(landing, FlownReload):
        stops.append(_reload(landing))
    return _feature(
        "route",
        "MultiLineString" if several else "LineString",
        coordinates if several else coordinates[0],
        uav_id=route.uav.id,
        **(_between(flight) if plan.has_bases else {}),
        distance=sum(stop.distance for stop in flight.stops) if plan.has_bases else route.distance,
        return_distance=landing.distance,
        range_left=landing.range_left,
        return_time=landing.time,
        **({"waits_on_ground": flight.waiting_on_ground} if plan.in_world else {}),
        stops=stops,
    )


def _between(flight: Flight) -> dict[str, Any]:
    """Return which flight it is; bases are null where it begins or ends at the UAV's own place."""
    ends_at = flight.landing.base
    return {
        "flight": flight.number,
        "from_base_id": None if flight.origin is None else flight.origin.id,
        "to_base_id": None if ends_at is None else ends_at.id,
        "take_off_time": flight.take_off_time,
        "aboard": list(flight.aboard),
    }


def _stop(plan: FlownPlan, stop: FlownStop) -> dict[str, Any]:
    return {
        **({"kind": "visit"} if plan.has_bases else {}),
        "target_id": stop.target.id,
        "step": stop.step,
        "arrival_time": stop.arrival_time,
        **(_times(stop) if plan.in_world else {}),
        "distance": stop.distance,
        "delivered": list(stop.delivered),
        "range_left": stop.range_left,
    }


def _reload(landing: FlownReload) -> dict[str, Any]:
    return {
        "kind": "reload",
        "base_id": landing.base.id,
        "step": landing.step,
        "arrival_time": landing.time,
        "departure_time": landing.departure_time,
        "distance": landing.distance,
        "loaded": list(landing.loaded),
        "range_left": landing.range_left,
    }


def _times(stop: FlownStop) -> dict[str, float | None]:
    return {
        "begin_time": stop.begin_time,
        "departure_time": stop.departure_time,
        "endurance_left": stop.endurance_left,
    }


def _zone(zone: NoFlyZone, *, geographic: bool) -> dict[str, Any]:
    rings = cut_ring(zone.polygon) if geographic else [list(zone.polygon)]
    polygons = [[[list(point) for point in closed(ring)]] for ring in rings]
    several = len(polygons) > 1
    properties = _fields(zone, {"id": {"zone_id": zone.id}, "polygon": {}})
    return _feature(
        "zone",
        "MultiPolygon" if several else "Polygon",
        polygons if several else polygons[0],
        **properties,
    )


def _feature(kind: str, geometry: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": geometry, "coordinates": coordinates},
        "properties": {"kind": kind, **properties},
    }
