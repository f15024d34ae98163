"""An independent, slow replay of a plan, in plain Python over JSON-shaped problems.

It shares no code with the product: the tests hold the compiled simulator and every answer against it.
"""

from __future__ import annotations

import math

TOLERANCE = 1e-6
CRUMB = 1e-9


class Illegal(Exception):
    """The plan breaks a rule; the argument says which: (step, uav, rule), counted from 0."""


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


def weight_of(problem):
    """λ: the objective's, or one over the diagonal of the bounding box, the narrowest one on the globe."""
    given = (problem.get("objective") or {}).get("distance_weight")
    if given is not None:
        return given
    points = [(t["x"], t["y"]) for t in problem["targets"]]
    for uav in problem["uavs"]:
        points += [(uav["x_s"], uav["y_s"]), now(uav)]
    xs, ys = zip(*points, strict=True)
    if problem.get("crs", "local") == "local":
        diagonal = apart("local", (min(xs), min(ys)), (max(xs), max(ys)))
        return 1 / diagonal if diagonal else 1.0
    # Every place may be the western end; the box that begins there ends with the place farthest to the east.
    width, west = min((max((x - begin) % 360 for x in xs), begin) for begin in xs)
    diagonal = apart("wgs84", (west, min(ys)), (west + width, max(ys)))
    return 1 / diagonal if diagonal >= 1e-9 else 1.0


def now(uav):
    """Current position; the starting point where none is given."""
    x, y = uav.get("x_c"), uav.get("y_c")
    return (uav["x_s"] if x is None else x, uav["y_s"] if y is None else y)


class Aircraft:
    """One UAV on its way."""

    def __init__(self, record):
        self.home = (record["x_s"], record["y_s"])
        self.place = now(record)
        self.speed, self.voyage = record["speed"], record["voyage"]
        self.flown = record.get("dis") or 0.0
        self.out = not record.get("ret")
        self.loaded = [float(amount) for amount in record["loadlist"]]
        self.hold = list(self.loaded)
        self.clock = 0.0


def unloaded_by(craft, wanted, area, carried, given):
    """What a visit unloads: all that is wanted and held, or what is given; None if that cannot be.

    Amounts that add up to a whole load or need may exceed it by their rounding.
    """
    if given is None:
        return [min(have, want) for have, want in zip(craft.hold, wanted, strict=True)]
    for k, amount in enumerate(given):
        have = craft.hold[k] + TOLERANCE * carried[k]
        want = wanted[k] + TOLERANCE * area["loadlist"][k]
        if not 0 <= amount <= min(have, want):
            return None
    return list(given)


def without(amount, taken, whole):
    """What is left of an amount; less than a billionth of the whole that it is a part of is nothing."""
    left = amount - taken
    return left if left >= CRUMB * whole else 0.0


def replay(problem, assignment, delivered=None):
    """Reward, satisfaction, distance and remaining needs of a legal plan; raises Illegal otherwise.

    With planned unloading `delivered` says what every visit unloads: amounts by step, UAV and material.
    """
    crs, objective = problem.get("crs", "local"), problem.get("objective") or {}
    charge, must_return = objective.get("charge_return", False), objective.get("return_to_base", True)
    fleet = [Aircraft(record) for record in problem["uavs"]]
    areas = problem["targets"]
    asked = [area["loadlist"] if area.get("requested") is None else area["requested"] for area in areas]
    needs = [
        [without(amount, 0.0, whole) for amount, whole in zip(area["loadlist"], row, strict=True)]
        for area, row in zip(areas, asked, strict=True)
    ]
    totals = [sum(row) for row in asked]
    weight = weight_of(problem)
    satisfaction = distance = 0.0
    if len(assignment) > problem.get("max_steps", 5):
        raise Illegal(0, 0, "steps")
    for s, row in enumerate(assignment):
        for i, (craft, choice) in enumerate(zip(fleet, row, strict=True)):
            if not 0 <= choice <= len(areas):
                raise Illegal(s, i, "action")
            if choice == len(areas):
                if craft.out and charge:
                    distance += apart(crs, craft.place, craft.home)
                craft.out = False
                continue
            if not craft.out:
                raise Illegal(s, i, "returning")
            area, wanted = areas[choice], needs[choice]
            there = (area["x"], area["y"])
            leg = apart(crs, craft.place, there)
            given = None if delivered is None else delivered[s][i]
            unloaded = unloaded_by(craft, wanted, area, problem["uavs"][i]["loadlist"], given)
            if unloaded is None:
                raise Illegal(s, i, "amount")
            if not any(amount > 0 for amount in unloaded):
                raise Illegal(s, i, "useless")
            back = apart(crs, there, craft.home) if must_return else 0.0
            if craft.flown + leg + back > craft.voyage * (1 + TOLERANCE):
                raise Illegal(s, i, "range")
            arrival = craft.clock + leg / craft.speed
            latest = area.get("deadline")
            if latest is not None and arrival > latest + abs(latest) * TOLERANCE:
                raise Illegal(s, i, "late")
            craft.clock = arrival + (area.get("service_time") or 0.0)
            craft.flown += leg
            distance += leg
            craft.place = there
            for k, amount in enumerate(unloaded):
                craft.hold[k] = without(craft.hold[k], amount, craft.loaded[k])
                wanted[k] = without(wanted[k], amount, asked[choice][k])
                if amount > 0:
                    satisfaction += area["level"] * amount / totals[choice]
    if charge:
        distance += sum(apart(crs, craft.place, craft.home) for craft in fleet if craft.out)
    return {
        "reward": satisfaction - weight * distance,
        "satisfaction": satisfaction,
        "distance": distance,
        "distance_weight": weight,
        "remaining": needs,
    }
