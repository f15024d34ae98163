"""The rules between the fields of the world, read from the specification again: on the JSON of a request.

Independent of the domain on purpose: it decides whether a refusal was one. Where doubles do not say exactly
whether sides cross, both answers count.
"""

import json
import math
from itertools import combinations, pairwise

from app.domain.identifiers import fault_of

MOST_CORNERS = 1000
"""The default of the setting."""

MOST_MATERIALS = 8
"""What the service of the tests of the API takes (``tests/api/conftest.py``)."""

DOUBTFUL = 1e-6
"""Sizes of a polygon below which a crossing may be only a touch."""


def breaks_rules_of_the_world(problem):
    """Whether a problem that keeps to the schema breaks a rule that no schema can say."""
    return any(
        broken(problem)
        for broken in (texts, materials, bases, promises, exclusions, start_plan, matrices, zones)
    )


def named(item, stem, number):
    return item.get("id") or f"{stem}-{number}"


def texts(problem):
    zones, bases = problem.get("no_fly_zones") or [], problem.get("bases") or []
    items = [*problem["uavs"], *problem["targets"], *zones, *bases]
    words = [item[key] for item in items for key in ("name", "profile") if item.get(key) is not None]
    words += [
        word for item in items for key in ("skills", "excluded", "committed") for word in item.get(key) or []
    ]
    words += [each["name"] for each in problem.get("materials") or [] if each.get("name") is not None]
    words += list(problem.get("matrices") or {})
    ids = [[named(zone, "zone", number) for number, zone in enumerate(zones, 1)]]
    ids += [[named(base, "base", number) for number, base in enumerate(bases, 1)]]
    sizes = [
        len(
            json.dumps(item["properties"], ensure_ascii=False, separators=(",", ":")).encode(
                errors="surrogatepass"
            )
        )
        for item in items
        if item.get("properties") is not None
    ]
    return (
        any(map(fault_of, [*words, *ids[0], *ids[1]]))
        or any(len(set(each)) < len(each) for each in ids)
        or max(sizes, default=0) > 4096
    )


def materials(problem):
    given = problem.get("materials") or []
    if given and len(given) != len(problem["uavs"][0]["loadlist"]):
        return True
    weights = [each.get("weight", 1.0) for each in given] or [1.0] * len(problem["uavs"][0]["loadlist"])
    return any(
        uav.get("capacity") is not None
        and sum(w * max(a, b) for w, a, b in zip(weights, uav["loadlist"], full_load(uav), strict=False))
        > uav["capacity"] * (1 + 0.9e-9)
        for uav in problem["uavs"]
    )


def full_load(uav):
    return uav["loadlist"] if uav.get("full_load") is None else uav["full_load"]


def bases(problem):
    given, number = problem.get("bases") or [], len(problem["uavs"][0]["loadlist"])
    amounts = [base["stock"] for base in given if base.get("stock") is not None]
    if any(len(each) != number for each in [*amounts, *map(full_load, problem["uavs"])]):
        return True
    if problem.get("crs") == "wgs84" and any(abs(base["x"]) > 180 or abs(base["y"]) > 90 for base in given):
        return True
    known = {named(base, "base", place) for place, base in enumerate(given, 1)}
    return any(not known.issuperset(uav.get("bases") or ()) for uav in problem["uavs"])


def promises(problem):
    known = {named(target, "area", number) for number, target in enumerate(problem["targets"], 1)}
    for uav in problem["uavs"]:
        excluded, committed = uav.get("excluded") or [], uav.get("committed") or []
        if not known.issuperset([*excluded, *committed]) or set(excluded) & set(committed):
            return True
        if len(set(committed)) < len(committed):
            return True
    return False


def exclusions(problem):
    objective = problem.get("objective") or {}
    if objective.get("loading") == "planned" and objective.get("unloading") != "planned":
        return True
    if objective.get("half_life") is not None and objective.get("unloading") == "planned":
        return True
    if objective.get("change_weight", 0) > 0 and problem.get("start_plan") is None:
        return True
    return problem.get("matrices") is not None and bool(problem.get("no_fly_zones") or problem.get("wind"))


def start_plan(problem):
    plan, m, n = problem.get("start_plan"), len(problem["uavs"]), len(problem["targets"])
    if plan is None:
        return False
    if not 1 <= len(plan) <= problem.get("max_steps", 5):
        return True
    last = n + len(problem.get("bases") or ())
    return any(len(row) != m or any(action > last for action in row) for row in plan)


def matrices(problem):
    given, uavs = problem.get("matrices"), problem["uavs"]
    targets = [*problem["targets"], *(problem.get("bases") or ())]
    if given is None:
        places = [item.get(key) for item in uavs for key in ("location", "home_location", "profile")]
        return any(place is not None for place in [*places, *(target.get("location") for target in targets)])
    tables = [
        table
        for each in given.values()
        for table in (each["distance"], each.get("duration"))
        if table is not None
    ]
    size = len(tables[0])
    if any(len(table) != size or any(len(row) != size for row in table) for table in tables):
        return True
    if any(item.get("location") is None for item in [*uavs, *targets]):
        return True
    rows = [item.get(key) for item in [*uavs, *targets] for key in ("location", "home_location")]
    if any(row is not None and row >= size for row in rows):
        return True
    return any(uav.get("profile") not in (given if len(given) > 1 else (None, *given)) for uav in uavs)


def zones(problem):
    polygons = [zone["polygon"] for zone in problem.get("no_fly_zones") or []]
    if not polygons:
        return False
    polygons = [polygon[:-1] if polygon[0] == polygon[-1] else polygon for polygon in polygons]
    if min(map(len, polygons)) < 3:
        return True
    if problem.get("crs") != "wgs84":
        return any(is_none([(x, y, 1.0) for x, y in moved(polygon)]) for polygon in polygons)
    corners = [corner for polygon in polygons for corner in polygon]
    if any(abs(x) > 180 or abs(y) > 90 for x, y in corners):
        return True
    places = [(stop["x"], stop["y"]) for stop in [*problem["targets"], *(problem.get("bases") or ())]]
    for uav in problem["uavs"]:
        start = uav["x_s"], uav["y_s"]
        now = [
            given if given is not None else same
            for given, same in zip((uav.get("x_c"), uav.get("y_c")), start, strict=True)
        ]
        places += [start, tuple(now)]
    points = [*places, *corners]
    xs, ys = sorted({x for x, _ in points}), [y for _, y in points]
    gaps = [(b - a, b) for a, b in pairwise([*xs, xs[0] + 360])]
    widest, west = max(gaps)
    middle = on_sphere(west + (360 - widest) / 2, (min(ys) + max(ys)) / 2)
    nearest = min(sum(a * b for a, b in zip(on_sphere(*point), middle, strict=True)) for point in points)
    if nearest < math.cos(math.radians(60 - DOUBTFUL)):
        return True
    return any(is_none([on_sphere(*corner) for corner in polygon]) for polygon in polygons)


def has_too_many_parts(problem):
    """Whether there are more materials, or corners of all zones together, than the tests' service takes."""
    if len(problem.get("materials") or ()) > MOST_MATERIALS:
        return True
    return sum(len(zone["polygon"]) for zone in problem.get("no_fly_zones") or []) > MOST_CORNERS


def moved(polygon):
    """A polygon of size 1 near 0, 0, so that products of its numbers say something."""
    xs, ys = zip(*polygon, strict=True)
    size = max(max(xs) - min(xs), max(ys) - min(ys)) or 1.0
    return [((x - xs[0]) / size, (y - ys[0]) / size) for x, y in polygon]


def on_sphere(x, y):
    a, b = math.radians(x), math.radians(y)
    return math.cos(b) * math.cos(a), math.cos(b) * math.sin(a), math.sin(b)


def is_none(corners):
    """Whether two sides may cross, or the area be 0; on a plane corners have a third number, 1."""
    size = max(math.dist(a, b) for a, b in combinations(corners, 2))
    if not size:
        return True
    sides = list(pairwise([*corners, corners[0]]))
    # What the fan of triangles from the first corner adds up to.
    if abs(sum(triple(corners[0], a, b) for a, b in sides)) <= DOUBTFUL * size**2:
        return True
    return any(
        triple(*one, other[0]) * triple(*one, other[1]) < 0
        and triple(*other, one[0]) * triple(*other, one[1]) < 0
        for one, other in combinations(sides, 2)
    )


def triple(a, b, c):
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
