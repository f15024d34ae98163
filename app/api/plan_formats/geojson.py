"""The whole plan as GeoJSON (RFC 7946): starting points, areas, no-fly zones, and a line a route."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from app.api.plan_formats.antimeridian import closed, cut_line, cut_ring
from app.api.plan_formats.flown_plan import FlownPlan, FlownRoute, FlownStop
from app.domain.fields import declared_fields
from app.domain.problem import UAV, Target
from app.domain.records import item_to_record
from app.domain.surroundings import NoFlyZone

MEDIA_TYPE = "application/geo+json"


def geojson(plan: FlownPlan) -> str:
    """Write a feature collection: a Point a UAV and an area, a Polygon a zone, a LineString a UAV that flies.

    The positions of a ``local`` problem are no longitudes and latitudes, which RFC 7946 has only by prior
    arrangement: the member ``coordinates`` says which they are. What crosses the antimeridian is cut there
    (section 3.1.9).
    """
    geographic = plan.problem.crs == "wgs84"
    features = [_start(route) for route in plan.routes]
    features += _areas(plan)
    features += [_zone(zone, geographic=geographic) for zone in plan.problem.no_fly_zones]
    features += [_line(plan, route, geographic=geographic) for route in plan.flying]
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


def _fields(item: UAV | Target | NoFlyZone, instead: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
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


def _line(plan: FlownPlan, route: FlownRoute, *, geographic: bool) -> dict[str, Any]:
    uav = route.uav
    places = [(uav.x_c, uav.y_c)]
    for stop in route.stops:
        places += stop.path[1:]
    if route.return_distance > 0:
        places += route.return_path[1:]
    lines = cut_line(places) if geographic else [places]
    several = len(lines) > 1
    coordinates = [[list(point) for point in line] for line in lines]
    return _feature(
        "route",
        "MultiLineString" if several else "LineString",
        coordinates if several else coordinates[0],
        uav_id=uav.id,
        distance=route.distance,
        return_distance=route.return_distance,
        range_left=route.range_left,
        return_time=route.return_time,
        **({"waits_on_ground": route.waiting_on_ground} if plan.in_world else {}),
        stops=[
            {
                "target_id": stop.target.id,
                "step": stop.step,
                "arrival_time": stop.arrival_time,
                **(_times(stop) if plan.in_world else {}),
                "distance": stop.distance,
                "delivered": list(stop.delivered),
                "range_left": stop.range_left,
            }
            for stop in route.stops
        ],
    )


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
