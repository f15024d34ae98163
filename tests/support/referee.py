"""An independent, slow replay of a plan, in plain Python over JSON-shaped problems.

It shares no code with the product: the tests hold the compiled simulator and every answer against it.
"""

from __future__ import annotations

from referee_legs import Leg, Legs, apart, home_of, place_of, start_of

TOLERANCE = 1e-6
CRUMB = 1e-9


class Illegal(Exception):
    """The plan breaks a rule; the argument says which: (step, uav, rule), counted from 0."""


def weight_of(problem):
    """λ: the objective's, or one over the diagonal of the bounding box, the narrowest one on the globe."""
    given = (problem.get("objective") or {}).get("distance_weight")
    if given is not None:
        return given
    if problem.get("matrices"):
        tables = [matrix["distance"] for matrix in problem["matrices"].values()]
        return 1 / (max(leg or 0.0 for table in tables for row in table for leg in row) or 1.0)
    points = [(stop["x"], stop["y"]) for stop in [*problem["targets"], *(problem.get("bases") or ())]]
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
        self.record = record
        self.home, self.place = home_of(record)[:2], now(record)
        self.at = start_of(record)
        self.speed, self.voyage = record["speed"], record["voyage"]
        self.flown = record.get("dis") or 0.0
        self.out = not record.get("ret")
        self.loaded = [float(amount) for amount in record["loadlist"]]
        self.hold = list(self.loaded)
        self.clock = record.get("available_from") or 0.0
        self.aloft = record.get("airborne") or 0.0
        self.on_ground = self.at == home_of(record) and not self.flown and not self.aloft
        full = record.get("full_load")
        self.full = [float(amount) for amount in (record["loadlist"] if full is None else full)]
        self.reloaded = False
        self.stops = []

    def may_use(self, base):
        """Whether it may land at a base, and reload there."""
        return self.record.get("bases") is None or base["id"] in self.record["bases"]

    def usable(self, name):
        """What may be used of its range or endurance; infinite where there is no limit."""
        whole = self.record.get(name)
        return float("inf") if whole is None else whole * (1 - (self.record.get("reserve") or 0.0))


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


def first_part(before, share, objective):
    """How much of a share that is delivered after another is of the first share, which earns more."""
    first = objective.get("minimum_share") or 0.0
    return max(0.0, min(before + share, first) - min(before, first))


def latest(time):
    """A time with the tolerance of its comparisons; infinite where there is none."""
    return float("inf") if time is None else time + abs(time) * TOLERANCE


class Replay:
    """A plan that is being flown."""

    def __init__(self, problem, legs=None):
        self.problem, self.objective = problem, problem.get("objective") or {}
        self.legs = legs or Legs(problem)
        self.fleet = [Aircraft(record) for record in problem["uavs"]]
        self.areas = problem["targets"]
        self.asked = [
            area["loadlist"] if area.get("requested") is None else area["requested"] for area in self.areas
        ]
        self.needs = [
            [without(amount, 0.0, whole) for amount, whole in zip(area["loadlist"], row, strict=True)]
            for area, row in zip(self.areas, self.asked, strict=True)
        ]
        self.bases = problem.get("bases") or ()
        self.stocks = [
            [float("inf")] * len(self.asked[0]) if base.get("stock") is None else list(base["stock"])
            for base in self.bases
        ]
        self.satisfaction = self.distance = 0.0

    def way_home(self, craft, at):
        """The leg home; one of nothing where it need not return, None where it must and cannot."""
        if not self.objective.get("return_to_base", True):
            return Leg(0.0, 0.0, 0.0)
        return self.way_to_nearest(craft, at)

    def way_to_nearest(self, craft, at):
        """The leg to the starting point or, if that is nearer in the air, to a base that it may use."""
        best = self.legs.leg(craft.record, at, home_of(craft.record))
        for base in self.bases:
            leg = self.legs.leg(craft.record, at, place_of(base)) if craft.may_use(base) else None
            if leg is not None and (best is None or leg.air < best.air):
                best = leg
        return best

    def land(self, craft):
        """Fly home for good, which costs its length where that is charged."""
        leg = self.way_to_nearest(craft, craft.at)
        if craft.out and self.objective.get("charge_return", False) and leg is not None:
            self.distance += leg.ground
        craft.out = False

    def landed(self, craft):
        """When it has landed, from where it is at the end of its visits."""
        home = self.way_home(craft, craft.at)
        return craft.clock + (home.time if home else 0.0)

    def reload(self, s, i, d, given=None):
        """Let UAV `i` land at base `d` in step `s`, and take what it lacks, or is given; raises Illegal."""
        craft, base, stock = self.fleet[i], self.bases[d], self.stocks[d]
        if not craft.out:
            raise Illegal(s, i, "returning")
        leg = self.legs.leg(craft.record, craft.at, place_of(base))
        if leg is None or not craft.may_use(base):
            raise Illegal(s, i, "barred")
        if craft.flown + leg.air > craft.usable("voyage") * (1 + TOLERANCE):
            raise Illegal(s, i, "range")
        if len(craft.stops) < len(craft.record.get("committed") or ()):
            raise Illegal(s, i, "committed")
        if craft.reloaded:
            raise Illegal(s, i, "reloaded")
        if craft.aloft + leg.time > craft.usable("endurance") * (1 + TOLERANCE):
            raise Illegal(s, i, "endurance")
        departure = craft.clock + leg.time + (base.get("turnaround") or 0.0)
        if departure > latest(craft.record.get("available_until")):
            raise Illegal(s, i, "landing")
        arrival, craft.clock, craft.flown, craft.aloft = craft.clock + leg.time, departure, 0.0, 0.0
        craft.at, craft.place, craft.reloaded = place_of(base), (base["x"], base["y"]), True
        self.distance += leg.ground
        loaded = [
            max(0.0, min(full - have, there))
            for full, have, there in zip(craft.full, craft.hold, stock, strict=True)
        ]
        if given is not None:
            loaded = self.loaded_as_given(s, i, d, given)
        craft.hold = [max(0.0, have + more) for have, more in zip(craft.hold, loaded, strict=True)]
        self.stocks[d] = [max(0.0, there - gone) for there, gone in zip(stock, loaded, strict=True)]
        craft.stops.append(
            {
                "step": s + 1,
                "base": d,
                "arrival_time": arrival,
                "departure_time": departure,
                "distance": leg.ground,
                "loaded": loaded,
            }
        )

    def loaded_as_given(self, s, i, d, given):
        """What a reload takes, or leaves behind, if stock, load and capacity allow it; raises Illegal."""
        craft, materials = self.fleet[i], self.problem.get("materials")
        weights = [each.get("weight", 1.0) for each in materials] if materials else [1.0] * len(given)
        for amount, have, there in zip(given, craft.hold, self.stocks[d], strict=True):
            if amount > there + TOLERANCE * max(1.0, there):
                raise Illegal(s, i, "stock")
            if have + amount < -TOLERANCE * max(1.0, have):
                raise Illegal(s, i, "amount")
        weight = sum(w * (have + more) for w, have, more in zip(weights, craft.hold, given, strict=True))
        if craft.record.get("capacity") is not None and weight > craft.record["capacity"] * (1 + TOLERANCE):
            raise Illegal(s, i, "capacity")
        return list(given)

    def visit(self, s, i, j, given):
        """Fly UAV `i` to area `j` in step `s`; raises Illegal."""
        craft, area, wanted = self.fleet[i], self.areas[j], self.needs[j]
        if not craft.out:
            raise Illegal(s, i, "returning")
        carried = list(map(max, craft.loaded, craft.full, craft.hold))
        unloaded = unloaded_by(craft, wanted, area, carried, given)
        if unloaded is None:
            raise Illegal(s, i, "amount")
        if not any(amount > 0 for amount in unloaded):
            raise Illegal(s, i, "useless")
        there = place_of(area)
        leg, home = self.legs.leg(craft.record, craft.at, there), self.way_home(craft, there)
        lacks = set(area.get("skills") or ()) - set(craft.record.get("skills") or ())
        if leg is None or home is None or lacks or area.get("id") in (craft.record.get("excluded") or ()):
            raise Illegal(s, i, "barred")
        if craft.flown + leg.air + home.air > craft.usable("voyage") * (1 + TOLERANCE):
            raise Illegal(s, i, "range")
        arrival = craft.clock + leg.time
        if arrival > latest(area.get("deadline")):
            raise Illegal(s, i, "late")
        committed = craft.record.get("committed") or ()
        if len(craft.stops) < len(committed) and committed[len(craft.stops)] != area["id"]:
            raise Illegal(s, i, "committed")
        begin = max(arrival, area.get("earliest") or 0.0)
        end = begin + (area.get("service_time") or 0.0)
        waits_on_ground = craft.reloaded or (craft.on_ground and not craft.stops)
        aloft = craft.aloft + (end - craft.clock) - (begin - arrival if waits_on_ground else 0.0)
        if aloft + home.time > craft.usable("endurance") * (1 + TOLERANCE):
            raise Illegal(s, i, "endurance")
        if end + home.time > latest(craft.record.get("available_until")):
            raise Illegal(s, i, "landing")
        craft.clock, craft.flown, craft.aloft = end, craft.flown + leg.air, aloft
        craft.at, craft.place, craft.reloaded = there, (area["x"], area["y"]), False
        self.distance += leg.ground
        self.unload(craft, j, unloaded, begin)
        endurance = craft.record.get("endurance")
        craft.stops.append(
            {
                "step": s + 1,
                "target": j,
                "arrival_time": arrival,
                "begin_time": begin,
                "departure_time": end,
                "distance": leg.ground,
                "delivered": unloaded,
                "range_left": craft.voyage - craft.flown,
                "endurance_left": None if endurance is None else endurance - aloft,
            }
        )

    def unload(self, craft, j, unloaded, begin):
        """Unload amounts at area `j`, and earn what that is worth then."""
        area, wanted, asked = self.areas[j], self.needs[j], self.asked[j]
        half_life = self.objective.get("half_life")
        for k, amount in enumerate(unloaded):
            if amount > 0:
                first = first_part((asked[k] - wanted[k]) / asked[k], amount / asked[k], self.objective)
                gained = amount + ((self.objective.get("minimum_weight") or 1.0) - 1.0) * first * asked[k]
                worth = 1.0 if half_life is None else 2.0 ** (-begin / half_life)
                self.satisfaction += area["level"] * gained / sum(asked) * worth
            most = max(craft.loaded[k], craft.full[k]) if self.bases else craft.loaded[k]
            craft.hold[k] = without(craft.hold[k], amount, most)
            wanted[k] = without(wanted[k], amount, asked[k])


def replay(problem, assignment, delivered=None, legs=None, loaded=None):
    """Reward, satisfaction, distance and remaining needs of a legal plan; raises Illegal otherwise.

    With planned unloading `delivered` says what every visit unloads: amounts by step, UAV and material. With
    planned loading `loaded` says so of every reload.
    `legs` are those of the problem, where they are known already.
    """
    flight, n = Replay(problem, legs), len(problem["targets"])
    if len(assignment) > problem.get("max_steps", 5):
        raise Illegal(0, 0, "steps")
    visited = set()
    for s, row in enumerate(assignment):
        for i, (craft, choice) in enumerate(zip(flight.fleet, row, strict=True)):
            if not 0 <= choice <= n + len(flight.bases):
                raise Illegal(s, i, "action")
            if choice == n:
                flight.land(craft)
            elif choice > n:
                flight.reload(s, i, choice - n - 1, None if loaded is None else loaded[s][i])
            else:
                flight.visit(s, i, choice, None if delivered is None else delivered[s][i])
                visited.add((i, choice))
    for craft in flight.fleet:
        flight.land(craft)
    before = {(i, j) for row in problem.get("start_plan") or () for i, j in enumerate(row) if j < n}
    weight, objective = weight_of(problem), flight.objective
    makespan = max((flight.landed(craft) for craft in flight.fleet if craft.stops), default=0.0)
    changes = len(before - visited)
    return {
        "reward": flight.satisfaction
        - weight * flight.distance
        - (objective.get("makespan_weight") or 0.0) * makespan
        - (objective.get("change_weight") or 0.0) * changes,
        "satisfaction": flight.satisfaction,
        "distance": flight.distance,
        "distance_weight": weight,
        "remaining": flight.needs,
        "stocks": flight.stocks,
        "makespan": makespan,
        "changes": changes,
        "stops": [craft.stops for craft in flight.fleet],
        "landed": [flight.landed(craft) for craft in flight.fleet],
    }
