"""A state of an episode in plain Python, by the referee's rules: what could be done, and in which units."""

from __future__ import annotations

import copy
import math
from typing import NamedTuple

from referee import Illegal, Replay, latest, weight_of, without
from referee_legs import place_of

from app.domain.problem import Problem
from app.domain.records import problem_to_record

NEAR = 16


class Outcome(NamedTuple):
    """What a visit or a reload would do now."""

    leg: object
    earned: float
    unloaded: list
    loaded: list
    arrival: float
    begin: float
    craft: object

    @property
    def amount(self):
        return sum(self.unloaded)


class PlainState:
    """A state that is played action by action; `possible` remembers what could be done in it."""

    def __init__(self, problem: Problem):
        self.record = problem_to_record(problem)
        self.flight = Replay(self.record)
        self.m, self.n = len(self.record["uavs"]), len(self.record["targets"])
        self.d = len(self.flight.bases)
        self.steps, self.step = self.record["max_steps"], 0
        self.weight, self.objective = weight_of(self.record), self.flight.objective
        self.first_amounts = [list(need) for need in self.flight.needs]
        self.first_needs = [sum(need) for need in self.flight.needs]
        self.in_the_air = {i for i, craft in enumerate(self.flight.fleet) if craft.out}
        self.made, self.acted, self.chosen = set(), set(), {}
        self.worth = [self._worth(j) for j in range(self.n)]
        self.level = max(self.worth) or 1.0
        self.span = max(self._every_leg()) or 1.0
        flying = [craft.speed for i, craft in enumerate(self.flight.fleet) if i in self.in_the_air]
        self.time = self.span / (sum(flying) / len(flying) if flying else 1.0)
        self.begin_step()

    def _worth(self, j):
        """What meeting all that an area needs at first brings at once: rule 5 of section 9."""
        area, asked, first = (
            self.flight.areas[j],
            self.flight.asked[j],
            self.objective.get("minimum_share") or 0,
        )
        more = (self.objective.get("minimum_weight") or 1.0) - 1.0

        def phi(share):
            return share + more * min(share, first)

        return sum(
            area["level"] * whole / sum(asked) * (phi(1.0) - phi((whole - need) / whole))
            for whole, need in zip(asked, self.flight.needs[j], strict=True)
            if need > 0
        )

    def _every_leg(self):
        stops = [place_of(stop) for stop in (*self.flight.areas, *self.flight.bases)]
        for craft in self.flight.fleet:
            legs = [self.flight.legs.leg(craft.record, a, b) for a in (craft.at, *stops) for b in stops]
            legs += [self.flight.way_to_nearest(craft, a) for a in (craft.at, *stops)]
            yield max((leg.ground for leg in legs if leg is not None), default=0.0)

    def begin_step(self):
        self.acted = {i for i, craft in enumerate(self.flight.fleet) if not craft.out}
        self.chosen = {}
        self._possible = {}

    def end_step(self):
        self.step += 1
        self.begin_step()

    def act(self, i, action):
        craft = self.flight.fleet[i]
        if action == self.n:
            home = self.flight.way_to_nearest(craft, craft.at)
            if craft.stops:
                craft.clock = self.flight.landed(craft)
            # The simulator counts this leg over ground, also in wind.
            craft.flown += home.ground if home is not None else 0.0
            self.flight.land(craft)
        elif action > self.n:
            self.flight.reload(self.step, i, action - self.n - 1)
            self.chosen[action] = max(i, self.chosen.get(action, -1))
        else:
            self.flight.visit(self.step, i, action, None)
            self.made.add((i, action))
            self.chosen[action] = max(i, self.chosen.get(action, -1))
        self.acted.add(i)
        self._possible = {}

    def possible(self, i, action):
        """The outcome of a visit or a reload if it were the next action of all; None if a rule forbids it."""
        if (i, action) not in self._possible:
            self._possible[i, action] = self._try(i, action)
        return self._possible[i, action]

    def in_order(self, i, action):
        """Whether those with higher numbers leave it as much as it would get before them (note 4)."""
        if self.chosen.get(action, -1) < i:
            return True
        craft = self.flight.fleet[i]
        if action > self.n:
            stock = self.flight.stocks[action - self.n - 1]
            return all(
                there >= full - have for full, have, there in zip(craft.full, craft.hold, stock, strict=True)
            )
        if (self.objective.get("minimum_weight") or 1.0) > 1 and (
            self.objective.get("minimum_share") or 0
        ) > 0:
            return False
        first, now = self.first_amounts[action], self.flight.needs[action]
        return all(not was or have <= need for was, have, need in zip(first, craft.hold, now, strict=True))

    def _try(self, i, action):
        trial = copy.copy(self.flight)
        trial.fleet, craft = list(self.flight.fleet), copy.copy(self.flight.fleet[i])
        craft.hold, craft.stops = list(craft.hold), list(craft.stops)
        trial.fleet[i] = craft
        trial.needs, trial.stocks = copy.deepcopy(self.flight.needs), copy.deepcopy(self.flight.stocks)
        place = place_of(trial.areas[action] if action < self.n else trial.bases[action - self.n - 1])
        leg = trial.legs.leg(craft.record, craft.at, place)
        try:
            if action < self.n:
                trial.visit(self.step, i, action, None)
            else:
                trial.reload(self.step, i, action - self.n - 1)
        except Illegal:
            return None
        stop = craft.stops[-1]
        return Outcome(
            leg,
            trial.satisfaction - self.flight.satisfaction,
            stop.get("delivered", []),
            stop.get("loaded", []),
            stop["arrival_time"],
            stop.get("begin_time", stop["arrival_time"]),
            craft,
        )

    def cost(self, length):
        return self.weight * length

    def net(self, i, j):
        """Reward of a visit; minus infinity where it is not possible."""
        outcome = self.possible(i, j)
        return -math.inf if outcome is None else outcome.earned - self.cost(outcome.leg.ground)

    def squash(self, reward):
        return flat(reward / self.level)

    def span_of(self, length, low=0.0, high=10.0):
        return clip(length / self.span, low, high)

    def time_of(self, time, low=0.0):
        return clip(time / self.time, low, 4.0)

    def first_clock(self):
        return min((craft.clock for craft in self.flight.fleet if craft.out), default=0.0)

    def wanted(self):
        """What all areas need, by material."""
        return [sum(column) for column in zip(*self.flight.needs, strict=True)]

    def way_home(self, i, at=None):
        """Length of the way to where a UAV lands; 0 where there is none, or it has landed."""
        craft = self.flight.fleet[i]
        leg = self.flight.way_to_nearest(craft, craft.at if at is None else at) if craft.out else None
        return 0.0 if leg is None else leg.ground

    def air_left(self, craft, at=None):
        """Time in the air that is left, or until it has to have landed; after the way home from a place."""
        endurance, until = craft.usable("endurance"), craft.record.get("available_until")
        home = None if at is None else self.flight.way_home(craft, at)
        home_time = home.time if home is not None else 0.0
        left = min(endurance - craft.aloft, (math.inf if until is None else until) - craft.clock)
        return self.time_of(left - home_time, low=-1.0)

    def near(self, j):
        """Areas that needed something at first, the nearest to an area by the shortest leg of any UAV."""
        found = []
        for other in range(self.n):
            if other != j and self.first_needs[other] > 0:
                found.append((self.between(j, other), other))
        return [other for _, other in sorted(found)[:NEAR]]

    def between(self, a, b, uavs=None):
        """The shortest leg between two areas, of some UAVs or all; infinite where there is none."""
        places = place_of(self.flight.areas[a]), place_of(self.flight.areas[b])
        legs = [self.flight.legs.leg(self.flight.fleet[i].record, *places) for i in uavs or range(self.m)]
        return min((leg.ground for leg in legs if leg is not None), default=math.inf)

    def next_visit(self, craft, at, hold, j):
        """Net, and length, of a visit from a place by simple rules; None where they forbid it.

        It counts range, deadline and what is needed now at one value a unit; not decay, a first share,
        endurance, and commitments.
        """
        amount = sum(map(min, hold, self.flight.needs[j]))
        area = self.flight.areas[j]
        leg = self.flight.legs.leg(craft.record, at, place_of(area))
        home = self.flight.way_home(craft, place_of(area))
        if amount <= 0 or leg is None or home is None or self.is_barred(craft, area):
            return None
        in_range = craft.flown + leg.air + home.air <= craft.usable("voyage") * (1 + 1e-6)
        if not in_range or craft.clock + leg.time > latest(area.get("deadline")):
            return None
        earned = area["level"] * amount / sum(self.flight.asked[j])
        return earned - self.cost(leg.ground), leg.ground, craft.clock + leg.time, home

    @staticmethod
    def is_barred(craft, area):
        lacks = set(area.get("skills") or ()) - set(craft.record.get("skills") or ())
        return bool(lacks) or area["id"] in (craft.record.get("excluded") or ())

    def follow_ups(self, i, j):
        """(net, length) of visits after one that is possible; none in the last step."""
        if self.steps - self.step <= 1:
            return []
        outcome = self.possible(i, j)
        craft, before = outcome.craft, self.flight.fleet[i]
        most = [
            max(carried, full) if self.d else carried
            for carried, full in zip(craft.loaded, craft.full, strict=True)
        ]
        hold = [
            without(have, amount, whole)
            for have, amount, whole in zip(before.hold, outcome.unloaded, most, strict=True)
        ]
        nexts = [self.next_visit(craft, place_of(self.flight.areas[j]), hold, k) for k in self.near(j)]
        return [(each[0], each[1]) for each in nexts if each is not None and each[0] > 0]


def flat(x):
    return x / (1 + abs(x))


def clip(x, low, high):
    return min(max(x, low), high)


def share(part, whole):
    return min(part / whole, 1.0) if whole > 0 else 0.0
