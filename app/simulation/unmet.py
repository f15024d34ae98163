"""Why a rescue area does not get all it needs: a code, a sentence with numbers, and what would change it.

The reasons are tried from the hardest to the softest: what no plan could do from where the request has the
swarm, then what one more visit would do to this plan. For the latter every visit of every UAV at every place
of its route is evaluated, in the problem as it is and, where the UAV has something useful left over, with
the range, time or steps that it lacks. The most urgent areas are first; where an answer has too many for all
to be looked at, the rest say that they were not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from app.domain.allocation import Relaxation, Unmet, UnmetCode
from app.domain.problem import Problem
from app.simulation.amounts import Amounts
from app.simulation.another_flight import NO_STEPS, another_flight
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.counterfactual import NO_VISIT, Counterfactuals, Outcome, relaxation_for
from app.simulation.direct_flights import direct_flights_tell
from app.simulation.flown_plan import FlownPlan, record_plan
from app.simulation.from_start import Start, direct_rule, is_carried, look_from_start, needs_of
from app.simulation.insertion import new_trial
from app.simulation.legs import UNREACHABLE
from app.simulation.openings import AS_IS, Lookout, Places
from app.simulation.planned_insertion import new_planned_trial
from app.simulation.shortfalls import RANGE, STEP, TIME
from app.simulation.spare_visits import SpareLookout
from app.simulation.unmet_wording import Wording
from app.simulation.visit import (
    COMMITTED_ELSEWHERE,
    HOME_TOO_LATE,
    TOO_LATE,
    TOO_LONG_ALOFT,
    farthest,
    is_late,
)

_RELAXED = (STEP, RANGE, TIME, STEP + RANGE, STEP + TIME, RANGE + TIME, STEP + RANGE + TIME)
"""What a visit may lack, fewest things first."""


_BLOCKED = {
    TOO_LONG_ALOFT: UnmetCode.ENDURANCE,
    HOME_TOO_LATE: UnmetCode.AVAILABLE_UNTIL,
    COMMITTED_ELSEWHERE: UnmetCode.COMMITTED,
}
"""Codes of the rules that forbid a visit whatever range, time and steps there are."""


def unmet_targets(
    problem: Problem,
    arrays: ProblemArrays,
    actions: Integers,
    amounts: Amounts,
    needs: Floats,
    hurry: Callable[[], bool],
    *,
    keep: bool,
) -> tuple[Unmet, ...]:
    """List the targets with needs left at the end of a plan.

    Parameters
    ----------
    problem, arrays
        The problem, and the same as a stack of one.
    actions, amounts
        (S', M) joint actions, and what they unload and load.
    needs
        (N, K) what is still needed at the end, as it is to be printed.
    hurry
        Once it is true, nothing more is looked at.
    keep
        Whether planned amounts stay as they are whatever is added; otherwise they are worked out anew.
    """
    planned = problem.plans_unloading
    plan = record_plan(arrays, actions, amounts, planned)
    open_targets = np.flatnonzero(plan.remaining.max(axis=1) > 0)
    if not len(open_targets):
        return ()
    share = plan.remaining[open_targets].sum(axis=1) / arrays.areas["need_total"][0, open_targets]
    urgent = open_targets[np.argsort(-arrays.areas["level"][0, open_targets] * share, kind="stable")]
    start = look_from_start(arrays, plan, open_targets)
    lookout: Lookout | SpareLookout
    counterfactuals: Counterfactuals | SpareLookout
    # What the end of a plan costs is known only of amounts that stay.
    ends = problem.objective.makespan_weight > 0.0 or problem.objective.change_weight > 0.0
    if planned and (keep or ends):
        lookout = counterfactuals = SpareLookout(arrays, plan, actions, amounts, hurry)
    else:
        scratch = new_trial(arrays, plan), new_planned_trial(arrays, plan, actions) if planned else None
        lookout = Lookout(arrays, plan, *scratch, hurry)
        counterfactuals = Counterfactuals(problem, arrays, plan, *scratch)
    judge = _Evaluator(problem, arrays, plan, needs, start, lookout, counterfactuals)
    # All of them first have a reason without looking, so that a look can end anywhere.
    found = {j: judge.at_once(j) for j in open_targets.tolist()}
    for looked, j in enumerate(urgent.tolist()):
        places = lookout.look(j, start)
        if places is None:
            if lookout.spent:
                found.update({rest: judge.at_once(rest) for rest in urgent[looked:].tolist()})
            break
        found[j] = judge.reason(j, places)
    return tuple(found.values())


class _Remedy(NamedTuple):
    """A visit, and what has to be allowed for it; `new` is false where the plan has the visit already."""

    uav: int
    place: int
    relaxation: Relaxation | None = None
    new: bool = True


class _Evaluator:
    """Finds the reason for one target after the other."""

    def __init__(
        self,
        problem: Problem,
        arrays: ProblemArrays,
        plan: FlownPlan,
        needs: Floats,
        start: Start,
        lookout: Lookout | SpareLookout,
        counterfactuals: Counterfactuals | SpareLookout,
    ) -> None:
        self._problem, self._arrays, self._plan, self._start = problem, arrays, plan, start
        self._needs, self._lookout, self._counterfactuals = needs, lookout, counterfactuals
        self._says = Wording(problem, plan)

    def at_once(self, j: int) -> Unmet:
        """Say why target `j` does not get all it needs, as far as that is known without looking."""
        hard = self._hard(j)
        if hard is not None:
            code, says, least = hard
            return self._unmet(j, code, says, uav=None if least is None else least.uav)
        visitor = self._visitor(j)
        able = int(self._start.fastest[j]) if visitor == NONE else visitor
        says = self._says.not_looked(able, self._lookout.spent)
        return self._unmet(j, UnmetCode.NOT_CHOSEN, says, uav=able, verified=False)

    def reason(self, j: int, places: Places) -> Unmet:
        """Say why target `j` does not get all it needs, and what would change it."""
        hard = self._hard(j)
        return self._of_this_plan(j, places) if hard is None else self._of_any_plan(j, *hard, places)

    def _hard(self, j: int) -> tuple[UnmetCode, str, _Remedy | None] | None:
        """A reason that no plan could change, and the least that would; None where there is none."""
        carrier, fastest = int(self._start.carrier[j]), int(self._start.fastest[j])
        if carrier == NONE:
            return UnmetCode.NO_SUPPLY, self._says.no_supply(), None
        if self._visitor(j) != NONE:
            return None
        if fastest == NONE:
            missing = float(self._start.missing[j])
            if missing >= UNREACHABLE / 2:
                return self._barred(j)
            least = _Remedy(carrier, 0, relaxation_for(self._problem, more_range=missing))
            return UnmetCode.OUT_OF_RANGE, self._says.out_of_range(carrier, missing), least
        arrival, deadline = float(self._start.arrival[j]), float(self._arrays.areas["deadline"][0, j])
        if is_late(arrival, deadline):
            late = arrival - deadline
            least = _Remedy(fastest, 0, relaxation_for(self._problem, late={j: late}))
            return UnmetCode.DEADLINE, self._says.deadline(fastest, late), least
        if self._start.able[j] == NONE:
            return self._too_long(fastest, j)
        return None

    def _barred(self, j: int) -> tuple[UnmetCode, str, _Remedy | None]:
        """Why no UAV that carries what target `j` needs may, or can, fly there."""
        problem, target = self._problem, self._problem.targets[j]
        carriers = [i for i in range(problem.n_uavs) if self._carries(i, j)]
        allowed = [i for i in carriers if target.id not in problem.uavs[i].excluded]
        skilled = [i for i in allowed if set(target.skills) <= set(problem.uavs[i].skills)]
        if not allowed:
            return UnmetCode.EXCLUDED, self._says.excluded(carriers), None
        if not skilled:
            lacked = set(target.skills).difference(*(problem.uavs[i].skills for i in allowed[:1]))
            return UnmetCode.SKILLS, self._says.skills(allowed[0], sorted(lacked)), None
        if problem.no_fly_zones and (problem.wind is None or self._is_cut_off(j)):
            return UnmetCode.NO_FLY_ZONE, self._says.no_fly_zone(), None
        if problem.wind is not None:
            return UnmetCode.WIND, self._says.wind(skilled[0]), None
        return UnmetCode.OUT_OF_RANGE, self._says.no_leg(), None

    def _carries(self, i: int, j: int) -> bool:
        """Whether UAV `i` can be sent and carries, now or from a base, what target `j` needs at the end."""
        return bool(is_carried(self._arrays, self._plan, i, j))

    def _visitor(self, j: int) -> int:
        """UAV that the plan sends to target `j` in spite of what a direct flight says; NONE where none."""
        if direct_flights_tell(self._problem):
            return NONE
        there = (uav for uav, _ in self._visits(j) if self._carries(uav, j))
        return next(there, NONE)

    def _visits(self, j: int) -> Iterator[tuple[int, int]]:
        """UAV and place in its route of each visit that the plan makes to target `j`."""
        visits, m = self._plan.visits, self._arrays.shape[0]
        slot = int(visits.first[j])
        while slot != NONE:
            yield slot % m, slot // m
            slot = int(visits.following[slot])

    def _is_cut_off(self, j: int) -> bool:
        """Whether no leg at all leads to target `j`: then it is not the wind alone."""
        others = np.arange(self._arrays.between.shape[2]) != j
        into = self._arrays.between[0][:, others, j]
        return bool((self._arrays.start_target[0, :, j] >= UNREACHABLE).all() and (into >= UNREACHABLE).all())

    def _too_long(self, i: int, j: int) -> tuple[UnmetCode, str, _Remedy | None]:
        """Why UAV `i`, the first that could be there, may not fly to target `j` in spite of that."""
        needs = needs_of(self._arrays, i, j)
        if int(direct_rule(self._arrays, i, j)) == HOME_TOO_LATE:
            return UnmetCode.AVAILABLE_UNTIL, self._says.available_until(i, needs.landing), None
        if needs.aloft - needs.waiting <= farthest(float(self._arrays.uavs["endurance"][0, i])):
            return UnmetCode.TOO_EARLY_TO_WAIT, self._says.too_early_to_wait(i, j, needs), None
        return UnmetCode.ENDURANCE, self._says.endurance(i, needs.aloft), None

    def _of_any_plan(
        self, j: int, code: UnmetCode, says: str, least: _Remedy | None, places: Places
    ) -> Unmet:
        """A hard reason, with the remedy that earns something, or helps at least."""
        uav = None if least is None else least.uav
        remedies = [
            *([] if least is None else [least]),
            *self._relaxed(j, places),
            *self._reloaded(j, places),
        ]
        helping = []
        for remedy in remedies:
            outcome = self._fly(j, remedy)
            if outcome.helps and outcome.gain > 0:
                return self._unmet(j, code, says, remedy, outcome)
            if outcome.helps:
                helping.append((remedy, outcome))
        if helping:
            remedy, outcome = helping[0]
            return self._unmet(j, code, says, remedy, outcome)
        return self._unmet(j, code, says, uav=uav)

    def _of_this_plan(self, j: int, places: Places) -> Unmet:
        """A reason that lies in the other visits of the plan."""
        best = now = None
        if places.uav[AS_IS] != NONE:
            best = _Remedy(int(places.uav[AS_IS]), int(places.place[AS_IS]))
            now = self._fly(j, best)
            if now.gain > 0:
                says = self._says.not_chosen(best.uav, best.place, now.gain)
                return self._unmet(j, UnmetCode.NOT_CHOSEN, says, best, now)
        for remedy in self._relaxed(j, places):
            outcome = self._fly(j, remedy)
            if outcome.helps and outcome.gain > 0 and remedy.relaxation is not None:
                code = _code_of(remedy.relaxation)
                says = self._says.used(remedy.uav, remedy.place, j, remedy.relaxation)
                return self._unmet(j, code, says, remedy, outcome)
        code, says = UnmetCode.LOADS_USED, self._says.loads_used(None if now is None else now.gain)
        uav = None
        if self._problem.bases and not places.left_over[0]:
            code, says, uav = self._of_another_flight(j, code, says)
        possible = (places.uav[:AS_IS] != NONE).any()
        if places.left_over[0] and not possible and places.blocked[0] != NONE:
            uav, place, rule = places.blocked.tolist()
            code, says = _BLOCKED.get(rule, UnmetCode.OUT_OF_RANGE), self._says.blocked(uav, place, rule)
        elif places.left_over[0] and possible:
            lack = max((0, *_RELAXED), key=lambda lack: float(places.gain[lack]))
            uav, place, gain = int(places.uav[lack]), int(places.place[lack]), float(places.gain[lack])
            code, says = UnmetCode.NOT_WORTH_IT, self._says.not_worth_it(uav, place, gain, lack)
            best = now = None
            if lack == 0:
                best = _Remedy(uav, place)
                now = self._fly(j, best)
        for remedy in self._reloaded(j, places):
            outcome = self._fly(j, remedy)
            if outcome.helps and outcome.gain > 0:
                return self._unmet(j, code, says, remedy, outcome)
        return self._unmet(j, code, says, best, now, uav=uav, stated=False)

    def _of_another_flight(self, j: int, code: UnmetCode, says: str) -> tuple[UnmetCode, str, int | None]:
        """Why no UAV fetches what is missing: with bases, what is aboard is not all that there is."""
        flight = another_flight(self._arrays, self._plan, self._lookout.trial, j)
        if not flight.in_stock:
            return UnmetCode.STOCK, self._says.stock(), None
        if flight.uav != NONE:
            worth_it = flight.gain > 0.0
            code = UnmetCode.NOT_CHOSEN if worth_it else UnmetCode.NOT_WORTH_IT
            return code, self._says.another_flight(flight.uav, flight.base, flight.gain), flight.uav
        if flight.rules & {TOO_LATE, HOME_TOO_LATE}:
            return UnmetCode.NO_TIME_FOR_RELOAD, self._says.no_time_for_reload(NO_STEPS in flight.rules), None
        if flight.rules == {NO_STEPS}:
            return UnmetCode.STEP_LIMIT, self._says.no_steps_for_reload(), None
        return code, says, None

    def _relaxed(self, j: int, places: Places) -> Iterator[_Remedy]:
        """Visits with what is left over that gain once range, time or steps are there."""
        for lack in _RELAXED:
            i, place = int(places.uav[lack]), int(places.place[lack])
            if i != NONE and places.gain[lack] > 0:
                yield from self._eased(i, place, j)

    def _reloaded(self, j: int, places: Places) -> Iterator[_Remedy]:
        """Visits of the plan, then additional ones, that bring what is missing with more aboard."""
        if isinstance(self._lookout, SpareLookout):
            return
        visits = self._plan.visits
        for i, place in self._visits(j):
            yield _Remedy(i, place, relaxation_for(self._problem, self._more_load(i, place, j)), new=False)
        for i, place in zip(places.loader.tolist(), places.loader_place.tolist(), strict=True):
            there = place < int(visits.length[i]) and int(visits.target[i, place]) == j
            if i != NONE and not there:
                yield from self._eased(i, place, j, self._more_load(i, place, j))

    def _eased(self, i: int, place: int, j: int, more_load: Floats | None = None) -> Iterator[_Remedy]:
        """A visit with what it lacks; none where that is a leg, for which no range makes up."""
        if isinstance(self._lookout, Lookout):
            step, more_range, late = self._lookout.lacking(i, place, j)
            if more_range < UNREACHABLE / 2:
                yield _Remedy(i, place, relaxation_for(self._problem, more_load, more_range, int(step), late))

    def _more_load(self, i: int, place: int, j: int) -> Floats:
        """What UAV `i` has to carry more for all that is missing, and for what areas before it would take."""
        missing = self._plan.remaining[j]
        wanted = missing.copy()
        route = self._plan.visits.target[i, :place]
        for x in set(route[route < self._problem.n_targets].tolist()) - {j}:
            wanted += np.where(missing > 0, self._plan.remaining[x], 0.0)
        more: Floats = np.maximum(wanted - self._plan.spare[i], 0.0)
        return more

    def _fly(self, j: int, remedy: _Remedy) -> Outcome:
        place = remedy.place if remedy.new else NO_VISIT
        return self._counterfactuals.visit(remedy.uav, place, j, remedy.relaxation)

    def _unmet(
        self,
        j: int,
        code: UnmetCode,
        says: str,
        visit: _Remedy | None = None,
        outcome: Outcome | None = None,
        *,
        uav: int | None = None,
        stated: bool = True,
        verified: bool = True,
    ) -> Unmet:
        """Write a reason down: with the visit that it is about, as a remedy if it is to be stated as one."""
        remedy = None
        if visit is not None:
            uav = visit.uav if uav is None else uav
            if stated:
                remedy = self._says.remedy(visit.uav, visit.place, visit.new, visit.relaxation)
                if outcome is not None and outcome.gain <= 0:
                    remedy += self._says.even_then(outcome.gain)
        return Unmet(
            target_id=self._problem.targets[j].id,
            remaining=tuple(self._needs[j].tolist()),
            code=code,
            reason=f"{self._says.missing(j)}: {says}",
            uav_id=None if uav is None else self._problem.uavs[uav].id,
            step=None if visit is None else visit.place + 1,
            remedy=remedy,
            relaxation=None if visit is None or not stated else visit.relaxation,
            reward_change=None if outcome is None else outcome.gain,
            verified=verified,
        )


def _code_of(relaxation: Relaxation) -> UnmetCode:
    """The code of a reason that what is left over at a UAV only lacks this."""
    if relaxation.more_range:
        return UnmetCode.RANGE_USED
    return UnmetCode.TIME_USED if relaxation.later_deadlines else UnmetCode.STEP_LIMIT
