"""Reasons for unmet needs, and their remedies, in sentences with names and numbers."""

from __future__ import annotations

from app.domain.allocation import LaterDeadline, Relaxation
from app.domain.clock import clock
from app.domain.problem import Problem
from app.domain.units import DISTANCE, SPEED, TIME, Unit
from app.simulation import shortfalls
from app.simulation.direct_flights import direct_flights_tell
from app.simulation.flown_plan import FlownPlan
from app.simulation.from_start import DirectNeeds
from app.simulation.visit import RULES

_SHORTFALLS = ((shortfalls.RANGE, "range"), (shortfalls.TIME, "time"), (shortfalls.STEP, "steps"))
_MOST_NAMED = 4
"""Materials of which a sentence has the amounts; `remaining` has all of them."""
_LEAST_MINUTES = 0.5
"""Less than that would be no time in hours and minutes."""


class Wording:
    """Puts what was found about a plan into words.

    Parameters
    ----------
    problem
        The problem.
    plan
        Its plan.
    """

    def __init__(self, problem: Problem, plan: FlownPlan) -> None:
        self._problem, self._plan = problem, plan
        # Of a flight that is not direct nothing is known where it might do better.
        self._there = "" if direct_flights_tell(problem) else " on a direct flight"
        # Numbers of Python's are much quicker to write than numpy's.
        self._remaining = plan.remaining.tolist()

    def missing(self, j: int) -> str:
        """How much target `j` lacks of what it needed."""
        left, target = self._remaining[j], self._problem.targets[j]
        whole = target.loadlist if target.requested is None else target.requested
        lacking = [k for k, amount in enumerate(left) if amount > 0]
        named = lacking if len(lacking) <= _MOST_NAMED + 1 else lacking[:_MOST_NAMED]
        amounts = [f"{left[k]:.6g} of {whole[k]:.6g} of {self._material(k)}" for k in named]
        if len(named) < len(lacking):
            amounts.append(f"{len(lacking) - len(named)} other materials")
        return " and ".join(amounts) + " missing"

    def no_supply(self) -> str:
        """Nobody carries it."""
        if all(uav.ret for uav in self._problem.uavs):
            return "every UAV is returning"
        return "no UAV that can be sent carries any of it"

    def excluded(self, carriers: list[int]) -> str:
        """Nobody who carries it may be sent."""
        return f"it is excluded for every UAV that carries any of it ({self._some(carriers)})"

    def skills(self, i: int, lacked: list[str]) -> str:
        """Nobody who carries it has the skills; one of them is UAV `i`."""
        return f"no UAV that carries any of it has the skills: {self._uav(i)} lacks {', '.join(lacked)}"

    def no_fly_zone(self) -> str:
        """No way there, or home."""
        return "no way leads there, or home from there, round the no-fly zones"

    def wind(self, i: int) -> str:
        """The wind is too strong; UAV `i` carries it."""
        wind, uav = self._problem.wind, self._problem.uavs[i]
        strength = 0.0 if wind is None else wind.speed
        return (
            f"a wind of {self._speed(strength)} is too strong to fly there and home from there "
            f"at the speed of {self._uav(i)}, {self._speed(uav.speed)}"
        )

    def no_leg(self) -> str:
        """The matrices have no leg."""
        return "the matrices have no leg there, or home from there, for any UAV that carries any of it"

    def endurance(self, i: int, needed: float) -> str:
        """Too long in the air, even directly."""
        return (
            f"{self._uav(i)} would be in the air for {self._time(needed)}{self._there}, "
            f"and has {self._usable(i)}"
        )

    def too_early_to_wait(self, i: int, j: int, needs: DirectNeeds) -> str:
        """It opens too late to wait for."""
        opens = self._problem.targets[j].earliest
        return (
            f"it opens at {self._time(opens)}: {self._uav(i)} would be in the air for "
            f"{self._time(needs.aloft)}{self._there}, {self._time(needs.waiting)} of it waiting, "
            f"and has {self._usable(i)}"
        )

    def available_until(self, i: int, landing: float) -> str:
        """It would land too late, even directly."""
        until = self._time(self._problem.uavs[i].available_until or 0.0)
        return (
            f"{self._uav(i)} would land at {self._time(landing)}{self._there}, and is available until {until}"
        )

    def blocked(self, i: int, place: int, rule: int) -> str:
        """A UAV with something left over must not fly there, whatever range, time and steps it has."""
        where = self._where(i, place)
        return f"{self._uav(i)} has some of it left over; a visit {where} is not allowed: {RULES[rule]}"

    def _usable(self, i: int) -> str:
        uav = self._problem.uavs[i]
        return self._time((uav.endurance or 0.0) * (1.0 - uav.reserve))

    def _some(self, uavs: list[int]) -> str:
        named = ", ".join(self._uav(i) for i in uavs[:_MOST_NAMED])
        return named if len(uavs) <= _MOST_NAMED else f"{named} and {len(uavs) - _MOST_NAMED} more"

    def out_of_range(self, i: int, lacks: float) -> str:
        """Nobody has the range; UAV `i` comes closest."""
        return (
            f"no UAV that carries any of it has the range{self._there}: {self._uav(i)} comes closest "
            f"and lacks {self._length(lacks)}"
        )

    def deadline(self, i: int, late: float) -> str:
        """Nobody can be in time; UAV `i` would be there first."""
        return (
            f"the fastest UAV that could serve it, {self._uav(i)}, "
            f"would arrive {self._time(late)} after its deadline{self._there}"
        )

    def not_looked(self, i: int, spent: bool) -> str:
        """UAV `i` could come, but nobody has looked further."""
        why = (
            "of so many areas only the most urgent were looked into"
            if spent
            else "no time was left to look further"
        )
        return f"{self._uav(i)} carries some of it and could be there in range and time; {why}"

    def not_chosen(self, i: int, place: int, gain: float) -> str:
        """One more visit earns something."""
        visit = f"one more visit by {self._uav(i)}, {self._where(i, place)},"
        return f"{visit} would earn {gain:.6g}; a better algorithm or more time finds it"

    def used(self, i: int, place: int, j: int, lacks: Relaxation) -> str:
        """The other visits of UAV `i` leave no room for one with what it has left over."""
        why = (
            [f"it lacks {self._length(lacks.more_range)} of range to keep its other visits"]
            if lacks.more_range
            else []
        )
        why += [self._late(later, j) for later in lacks.later_deadlines]
        why += ["all its decision steps are used"] if lacks.more_steps else []
        visit = f"{self._uav(i)} has some of it left over and could come {self._where(i, place)}"
        return f"{visit}, but {' and '.join(why)}"

    def not_worth_it(self, i: int, place: int, gain: float, lacks: int) -> str:
        """The best visit with something that is left over costs at least what it earns."""
        needs = [name for kind, name in _SHORTFALLS if lacks & kind]
        even = f"even with the {' and '.join(needs)} that it lacks, " if needs else ""
        visit = f"{even}one more visit by {self._uav(i)}, {self._where(i, place)},"
        if self._costs_more_than_distance:
            costs, all_costs = f"cost {-gain:.6g} more than it earns", "it costs"
        else:
            costs, all_costs = f"cost {-gain:.6g} more in distance than it earns", "its distance costs"
        return f"{visit} would {costs}" if gain < 0 else f"{visit} would earn no more than {all_costs}"

    def loads_used(self, gain: float | None) -> str:
        """All that could be brought is unloaded elsewhere; a visit that takes it from there brings `gain`."""
        says = "the UAVs that could bring it unload elsewhere all that it could use"
        if gain is None:
            return says
        return f"{says}: bringing it here instead would " + (
            f"cost {-gain:.6g}" if gain < 0 else "earn no more"
        )

    def stock(self) -> str:
        """All that is carried is unloaded elsewhere, and no base has any left."""
        return "the UAVs unload elsewhere all that they carry of it, and no base has any left for them"

    def another_flight(self, i: int, d: int, gain: float) -> str:
        """A reload and a visit after all others of UAV `i` are allowed; what they bring."""
        base = self._problem.bases[d]
        flight = f"another flight of {self._uav(i)}, from {base.name or base.id} at the end,"
        if gain > 0.0:
            return f"{flight} would earn {gain:.6g}; a better algorithm or more time finds it"
        if gain < 0.0:
            return f"{flight} would cost {-gain:.6g} more than it earns"
        return f"{flight} would earn no more than it costs"

    def no_time_for_reload(self, some_have_no_steps: bool) -> str:
        """A base has it, but nobody who has the steps is there and back in time."""
        who = "no UAV with two steps left" if some_have_no_steps else "no UAV"
        return f"{who} has the time to fetch it at a base after its other stops, and bring it"

    def no_steps_for_reload(self) -> str:
        """A base has it, but nobody has two steps left."""
        return "no UAV has the two steps left that it takes to fetch it at a base, and bring it"

    def even_then(self, gain: float) -> str:
        """What a visit costs in spite of its remedy."""
        if gain < 0:
            return f"; the visit would still cost {-gain:.6g} more than it earns"
        return "; the visit would still earn no more than it costs"

    def remedy(self, i: int, place: int, new: bool, relaxation: Relaxation | None) -> str:
        """What would change it: another visit, or what has to be allowed for it."""
        uav = self._uav(i)
        if relaxation is None:
            return f"{uav} flies there {self._where(i, place)}"
        load = " and ".join(
            f"{x:.6g} of {self._material(k)}" for k, x in enumerate(relaxation.more_load) if x > 0
        )
        says = [f"{load} more aboard {uav}"] if load else []
        if relaxation.more_range:
            says.append(f"range +{self._length(relaxation.more_range)} of {uav}")
        says += [
            f"a deadline {self._time(later.by)} later for {self._target(later.target_id)}"
            for later in relaxation.later_deadlines
        ]
        says += ["one more decision step"] if relaxation.more_steps else []
        return ", ".join(says) + ("" if new else ", which flies there anyway")

    def _late(self, later: LaterDeadline, j: int) -> str:
        late = f"{self._time(later.by)} after the deadline"
        if later.target_id == self._problem.targets[j].id:
            return f"it would arrive {late}"
        return f"it would then arrive {late} of {self._target(later.target_id)}"

    def _uav(self, i: int) -> str:
        uav = self._problem.uavs[i]
        return uav.name or uav.id

    def _target(self, target_id: str) -> str:
        return next(each.name or each.id for each in self._problem.targets if each.id == target_id)

    def _material(self, k: int) -> str:
        named = self._problem.materials
        return named[k].name if named else f"material {k + 1}"

    def _where(self, i: int, place: int) -> str:
        if place == 0:
            return "first"
        stop, n = int(self._plan.visits.target[i, place - 1]), self._problem.n_targets
        before = self._problem.targets[stop] if stop < n else self._problem.bases[stop - n - 1]
        return f"after {before.name or before.id}"

    def _length(self, length: float) -> str:
        return f"{length:.6g}{self._unit(DISTANCE)}"

    def _speed(self, speed: float) -> str:
        return f"{speed:.6g}{self._unit(SPEED)}"

    def _time(self, time: float) -> str:
        """Write a moment or a duration; less than half a minute is written exactly."""
        if not self._on_globe:
            return f"{time:.6g}"
        return f"{clock(time) if abs(time) * 60 >= _LEAST_MINUTES else f'{time:.6g}'}{self._unit(TIME)}"

    def _unit(self, unit: Unit) -> str:
        return f" {unit.wgs84}" if self._on_globe else ""

    @property
    def _costs_more_than_distance(self) -> bool:
        """Whether time, or what a plan changes, costs reward too."""
        objective = self._problem.objective
        return bool(objective.half_life or objective.makespan_weight or objective.change_weight)

    @property
    def _on_globe(self) -> bool:
        return self._problem.crs == "wgs84"
