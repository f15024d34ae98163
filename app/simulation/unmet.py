"""Why a rescue area does not get all it needs: a code, a sentence with numbers, and what would change it.

The reasons are tried from the hardest to the softest: what no plan could do from where the request has the
swarm, then what one more visit would do to this plan. Each is verified by flying the plan with that visit on
the simulator, first in the problem as it is, then with more load, range, time or steps. The most urgent areas
are first; where an answer has too many for all to be flown, the rest say that they were not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.domain.allocation import Unmet
from app.domain.problem import Problem
from app.simulation import simulator
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.counterfactual import Counterfactuals, Outcome

NO_SUPPLY = "no_supply"
OUT_OF_RANGE = "out_of_range"
DEADLINE = "deadline"
LOADS_USED = "loads_used"
RANGE_USED = "range_used"
NOT_WORTH_IT = "not_worth_it"
STEP_LIMIT = "step_limit"
NOT_CHOSEN = "not_chosen"

_LOOKS = 3_000_000
"""Places for one more visit that are looked at: tens of milliseconds. Beyond, only ends of routes."""

_PIECE = 300_000
"""Of them, between two looks at the clock."""


class _Facts(NamedTuple):
    """About each target, from where the request has the swarm; UAVs are -1 where there is none.

    Attributes
    ----------
    carrier, missing
        (N,) the UAV that carries something needed and lacks least range, and how much it lacks.
    fastest, late
        (N,) the UAV among those with the range that arrives first, and how long after the deadline.
    uav, place, guess, short
        (N,) the best place for one more visit: UAV, number of the visit, guessed change of the reward, and
        the range that the UAV lacks to keep the rest of its route.
    """

    carrier: Integers
    missing: Floats
    fastest: Integers
    late: Floats
    uav: Integers
    place: Integers
    guess: Floats
    short: Floats


@dataclass(frozen=True, slots=True)
class _Plan:
    """A plan as one more visit meets it.

    Attributes
    ----------
    target, length
        (M, S) and (M,) its routes.
    delivered
        (S, M, K) what its visits unload.
    reward
        What it earns.
    episodes
        One episode at its end, every UAV still at its last stop.
    """

    target: Integers
    length: Integers
    delivered: Floats
    reward: float
    episodes: simulator.Episodes


def unmet_targets(
    problem: Problem,
    arrays: ProblemArrays,
    episodes: simulator.Episodes,
    actions: Integers,
    delivered: Floats,
    reward: float,
    hurry: Callable[[], bool],
) -> tuple[Unmet, ...]:
    """List the targets with needs left at the end of a plan.

    Parameters
    ----------
    problem, arrays
        The problem, and the same as a stack of one.
    episodes
        One episode at the plan's end, every UAV still at its last stop.
    actions, delivered
        (S', M) joint actions and (S', M, K) what they unload.
    reward
        What the plan earns.
    hurry
        Once it is true, only ends of routes are looked at, and nothing more is flown.
    """
    m, n, _ = arrays.shape
    visiting = actions < n
    length = visiting.sum(axis=0)
    target = np.zeros((m, int(arrays.max_steps[0])), np.int64)
    target[:, : len(actions)] = np.where(visiting, actions, 0).T
    plan = _Plan(target, length, delivered, reward, episodes)
    remaining = episodes.need[0]
    open_targets = np.flatnonzero(remaining.max(axis=1) > 0)
    if not len(open_targets):
        return ()
    share = remaining[open_targets].sum(axis=1) / arrays.need_total[0, open_targets]
    urgent = open_targets[np.argsort(-arrays.level[0, open_targets] * share, kind="stable")]
    facts = _gather(arrays, plan, urgent, hurry)
    planned = problem.objective.unloading == "planned"
    counterfactuals = Counterfactuals(arrays, target, length, planned, remaining.sum(axis=1), hurry)
    judge = _Judge(problem, arrays, plan, facts, counterfactuals)
    found = {int(j): judge.reason(int(j)) for j in urgent}
    return tuple(found[int(j)] for j in open_targets)


class _Judge:
    """Finds the reason for one target after the other."""

    def __init__(
        self,
        problem: Problem,
        arrays: ProblemArrays,
        plan: _Plan,
        facts: _Facts,
        counterfactuals: Counterfactuals,
    ) -> None:
        self._problem, self._arrays, self._plan = problem, arrays, plan
        self._facts, self._fly = facts, counterfactuals
        self._least = 1e-9 * max(1.0, abs(plan.reward))

    def reason(self, j: int) -> Unmet:
        """Say why target `j` does not get all it needs."""
        facts, problem = self._facts, self._problem
        carrier, fastest = int(facts.carrier[j]), int(facts.fastest[j])
        if carrier < 0:
            return self._no_supply(j)
        if fastest < 0:
            lacks = float(facts.missing[j])
            says = f"no UAV that carries what it needs has the range: the best lacks {lacks:.6g}"
            remedy = f"range +{lacks:.6g} of {problem.uavs[carrier].id}"
            outcome = (
                None if self._fly.spent else self._fly.insert(carrier, 0, j, more_range=lacks * (1 + 1e-9))
            )
            return self._unmet(j, OUT_OF_RANGE, says, carrier, remedy, outcome)
        late = float(facts.late[j])
        latest = float(self._arrays.deadline[0, j])
        if late > abs(latest) * simulator.TOLERANCE:
            says = f"the fastest UAV that could serve it would arrive {late:.6g} after its deadline"
            remedy = f"a deadline {late:.6g} later"
            outcome = None if self._fly.spent else self._fly.insert(fastest, 0, j, deadline=latest + late)
            return self._unmet(j, DEADLINE, says, fastest, remedy, outcome)
        return self._one_more_visit(j)

    def _no_supply(self, j: int) -> Unmet:
        says = "no UAV that can be sent carries any of the materials still needed"
        ready = np.flatnonzero(~self._arrays.ret[0])
        if not len(ready):
            return self._unmet(j, NO_SUPPLY, says, -1, "a UAV that is not returning", None)
        nearest = int(ready[np.argmin(self._arrays.start_target[0, ready, j])])
        outcome = None
        if not self._fly.spent:
            place = int(self._plan.length[nearest])
            outcome = self._fly.insert(
                nearest, place, j, more_load=self._plan.episodes.need[0, j], more_steps=1
            )
            if not outcome.helps:
                outcome = self._fly.insert(nearest, 0, j, more_load=self._plan.episodes.need[0, j])
        remedy = f"{self._amounts(j)} aboard {self._problem.uavs[nearest].id}"
        return self._unmet(j, NO_SUPPLY, says, nearest, remedy, outcome)

    def _one_more_visit(self, j: int) -> Unmet:
        facts = self._facts
        i, place = int(facts.uav[j]), int(facts.place[j])
        if i < 0:
            says = "the UAVs that could serve it have used their loads, range or time elsewhere"
            return self._unmet(j, LOADS_USED, says, -1, None, None)
        uav = self._problem.uavs[i].id
        if self._fly.spent:
            guess = float(facts.guess[j])
            code = NOT_CHOSEN if guess > 0 else LOADS_USED
            says = f"one more visit, by {uav}, is guessed to change the reward by {guess:.6g}"
            return self._unmet(j, code, says, i, None, None)
        where = "first" if place == 0 else f"after {self._id(int(self._plan.target[i, place - 1]))}"
        now = self._fly.insert(i, place, j)
        gain = now.reward - self._plan.reward
        if gain > self._least:
            says = f"one more visit would earn {gain:.6g}; a better algorithm or more time finds it"
            return self._unmet(j, NOT_CHOSEN, says, i, f"{uav} flies there {where}", now)
        full = int(self._plan.length[i]) >= int(self._arrays.max_steps[0])
        if full:
            longer = self._fly.insert(i, place, j, more_steps=1)
            if longer.reward - self._plan.reward > self._least:
                says = f"one more decision step would earn {longer.reward - self._plan.reward:.6g} here"
                return self._unmet(j, STEP_LIMIT, says, i, "one more decision step", longer)
        lacks = float(facts.short[j])
        if lacks > 0:
            further = self._fly.insert(i, place, j, more_range=lacks * (1 + 1e-9), more_steps=int(full))
            if further.reward - self._plan.reward > self._least:
                says = (
                    f"{uav} would have to give up other visits for it: it lacks {lacks:.6g} of range for all"
                )
                step = " and one more decision step" if full else ""
                return self._unmet(j, RANGE_USED, says, i, f"range +{lacks:.6g} of {uav}{step}", further)
        needed = self._plan.episodes.need[0, j]
        loaded = self._fly.insert(
            i, place, j, more_load=needed, more_range=max(0.0, lacks) * (1 + 1e-9), more_steps=int(full)
        )
        remedy = None
        if loaded.reward - self._plan.reward > self._least:
            extras = [f"{self._amounts(j)} more aboard {uav}"]
            extras += [f"range +{lacks:.6g}"] if lacks > 0 else []
            extras += ["one more decision step"] if full else []
            remedy = ", ".join(extras)
        outcome = now if remedy is None else loaded
        if now.helps and now.elsewhere >= self._elsewhere(j) - self._least:
            says = f"one more visit would cost {max(0.0, -gain):.6g} more in distance than it earns"
            return self._unmet(j, NOT_WORTH_IT, says, i, remedy, outcome)
        says = "what there is serves as much elsewhere"
        if gain < 0:
            says = f"what there is serves more elsewhere: bringing it here would cost {-gain:.6g}"
        return self._unmet(j, LOADS_USED, says, i, remedy, outcome)

    def _elsewhere(self, j: int) -> float:
        """What the plan earns at other targets than `j`, without distance."""
        whole = float(self._arrays.need_total[0, j])
        met = whole - float(self._plan.episodes.need[0, j].sum())
        return float(self._plan.episodes.satisfaction[0]) - float(self._arrays.level[0, j]) * met / whole

    def _unmet(
        self, j: int, code: str, says: str, uav: int, remedy: str | None, outcome: Outcome | None
    ) -> Unmet:
        change = None if outcome is None else outcome.reward - self._plan.reward
        hard = code in (NO_SUPPLY, OUT_OF_RANGE, DEADLINE)
        verified = outcome is not None and (outcome.helps or not hard)
        return Unmet(
            target_id=self._id(j),
            remaining=tuple(self._plan.episodes.need[0, j].tolist()),
            code=code,
            reason=says,
            uav_id=None if uav < 0 else self._problem.uavs[uav].id,
            remedy=remedy,
            reward_change=change if verified else None,
            verified=verified,
        )

    def _id(self, j: int) -> str:
        return self._problem.targets[j].id

    def _amounts(self, j: int) -> str:
        left = self._plan.episodes.need[0, j]
        return " and ".join(f"{left[k]:.6g} of material {k + 1}" for k in np.flatnonzero(left > 0))


def _gather(arrays: ProblemArrays, plan: _Plan, urgent: Integers, hurry: Callable[[], bool]) -> _Facts:
    """Look at the swarm and the plan from every target that is listed, most urgent first."""
    m, n, _ = arrays.shape
    facts = _Facts(
        np.full(n, -1, np.int64), np.full(n, np.inf), np.full(n, -1, np.int64), np.full(n, np.inf),
        np.full(n, -1, np.int64), np.zeros(n, np.int64), np.full(n, -np.inf), np.zeros(n),
    )  # fmt: skip
    # What is found does not depend on the order; neighbours in memory are quicker one after the other.
    _look_from_start(arrays, plan.episodes, np.sort(urgent), facts)
    steps = plan.target.shape[1]
    # Just before each visit: distance flown, time, what is carried; and what is earned from there on.
    flown, clock = np.zeros((m, steps + 1)), np.zeros((m, steps + 1))
    load, later = np.zeros((m, steps + 1, arrays.shape[2])), np.zeros((m, steps + 1))
    _walk(arrays, plan.target, plan.length, plan.delivered, flown, clock, load, later)
    places = int(plan.length.sum()) + m
    thorough, piece = min(len(urgent), _LOOKS // places), max(1, _PIECE // places)
    done = 0
    while done < len(urgent):
        everywhere = done < thorough and not hurry()
        end = min(done + piece, thorough) if everywhere else len(urgent)
        _look_for_place(
            arrays, plan.episodes, plan.target, plan.length, flown, clock, load, later,
            np.sort(urgent[done:end]), everywhere, facts,
        )  # fmt: skip
        done = end
    return facts


@simulator.compiled
def _look_from_start(
    arrays: ProblemArrays, episodes: simulator.Episodes, urgent: Integers, facts: _Facts
) -> None:
    """Who carries what a target needs, who of them has the range, and who of those is there first."""
    for i in range(arrays.speed.shape[1]):
        if arrays.ret[0, i]:
            continue
        for q in range(urgent.shape[0]):
            j = urgent[q]
            useful = False
            for k in range(arrays.load.shape[2]):
                useful = useful or (arrays.load[0, i, k] > 0.0 and episodes.need[0, j, k] > 0.0)
            if not useful:
                continue
            reach = arrays.dis[0, i] + arrays.start_target[0, i, j]
            if arrays.return_to_base[0]:
                reach += arrays.home[0, i, j]
            missing = reach - arrays.voyage[0, i]
            if missing < facts.missing[j]:
                facts.missing[j], facts.carrier[j] = missing, i
            if reach <= arrays.voyage[0, i] * (1.0 + simulator.TOLERANCE):
                late = arrays.start_target[0, i, j] / arrays.speed[0, i] - arrays.deadline[0, j]
                if facts.fastest[j] < 0 or late < facts.late[j]:
                    facts.late[j], facts.fastest[j] = late, i


@simulator.compiled
def _walk(
    arrays: ProblemArrays,
    target: Integers,
    length: Integers,
    delivered: Floats,
    flown: Floats,
    clock: Floats,
    load: Floats,
    later: Floats,
) -> None:
    """Write down distance, time and load before each visit, and what is earned from there on."""
    materials = load.shape[2]
    for i in range(target.shape[0]):
        flown[i, 0] = arrays.dis[0, i]
        for k in range(materials):
            load[i, 0, k] = arrays.load[0, i, k]
        for s in range(length[i]):
            j = target[i, s]
            leg = arrays.start_target[0, i, j] if s == 0 else arrays.between[0, target[i, s - 1], j]
            flown[i, s + 1] = flown[i, s] + leg
            clock[i, s + 1] = clock[i, s] + leg / arrays.speed[0, i] + arrays.service[0, j]
            for k in range(materials):
                load[i, s + 1, k] = max(0.0, load[i, s, k] - delivered[s, i, k])
        for s in range(length[i] - 1, -1, -1):
            j = target[i, s]
            later[i, s] = later[i, s + 1]
            for k in range(materials):
                if delivered[s, i, k] > 0.0:
                    later[i, s] += arrays.level[0, j] * delivered[s, i, k] / arrays.need_total[0, j]


@simulator.compiled
def _look_for_place(
    arrays: ProblemArrays,
    episodes: simulator.Episodes,
    target: Integers,
    length: Integers,
    flown: Floats,
    clock: Floats,
    load: Floats,
    later: Floats,
    urgent: Integers,
    everywhere: bool,
    facts: _Facts,
) -> None:
    """Guess the best place for one more visit to each target: among all, or the ends of routes."""
    for i in range(target.shape[0]):
        if arrays.ret[0, i]:
            continue
        end = length[i]
        for q in range(urgent.shape[0]):
            j = urgent[q]
            for place in range(0 if everywhere else end, end + 1):
                if place == 0:
                    there = arrays.start_target[0, i, j]
                else:
                    there = arrays.between[0, target[i, place - 1], j]
                reach = flown[i, place] + there
                if arrays.return_to_base[0]:
                    reach += arrays.home[0, i, j]
                latest = arrays.deadline[0, j]
                arrival = clock[i, place] + there / arrays.speed[0, i]
                if reach > arrays.voyage[0, i] * (1.0 + simulator.TOLERANCE) or arrival > latest + abs(
                    latest
                ) * (simulator.TOLERANCE):
                    continue
                unloaded, spare = 0.0, 0.0
                for k in range(load.shape[2]):
                    unloaded += min(load[i, place, k], episodes.need[0, j, k])
                    spare += min(load[i, end, k], episodes.need[0, j, k])
                if unloaded <= 0.0:
                    continue
                detour, short = there, 0.0
                if place < end:
                    following = target[i, place]
                    detour += arrays.between[0, j, following] - (flown[i, place + 1] - flown[i, place])
                    last = flown[i, end] + detour
                    if arrays.return_to_base[0]:
                        last += arrays.home[0, i, target[i, end - 1]]
                    if last > arrays.voyage[0, i] * (1.0 + simulator.TOLERANCE):
                        short = last - arrays.voyage[0, i]
                # What is taken from later visits is guessed to be worth there what it is on average.
                lost = later[i, place] if short > 0.0 else later[i, place] * (1.0 - spare / unloaded)
                guess = (
                    arrays.level[0, j] * unloaded / arrays.need_total[0, j] - lost - arrays.weight[0] * detour
                )
                if facts.uav[j] < 0 or guess > facts.guess[j]:
                    facts.uav[j], facts.place[j] = i, place
                    facts.guess[j], facts.short[j] = guess, short
