"""What an area with needs left could still get: who could come, and where one more visit fits into a plan.

Facts only; :mod:`app.simulation.unmet` says what follows from them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.simulation import simulator
from app.simulation.arrays import Floats, Integers, ProblemArrays

_LOOKS = 3_000_000
"""Places for one more visit that are looked at: tens of milliseconds. Beyond, only ends of routes."""

_PIECE = 300_000
"""Of them, between two looks at the clock."""


NONE, NOT_LOOKED = -1, -2
"""In place of a UAV: there is none; there was no time to look for one."""


class Facts(NamedTuple):
    """About each target, from where the request has the swarm; UAVs are NONE where there is none.

    Attributes
    ----------
    carrier, missing
        (N,) the UAV that carries something needed and lacks least range, and how much it lacks.
    fastest, late
        (N,) the UAV among those with the range that arrives first, and how long after the deadline.
    uav, place, guess, short
        (N,) the best place for one more visit: UAV (NOT_LOOKED if nobody looked), number of the visit,
        guessed change of the reward, and the range that the UAV lacks to keep the rest of its route.
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
class FlownPlan:
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


def gather(arrays: ProblemArrays, plan: FlownPlan, urgent: Integers, hurry: Callable[[], bool]) -> Facts:
    """Look at the swarm and the plan from every target that is listed.

    Parameters
    ----------
    arrays
        A stack of one problem.
    plan
        A legal plan.
    urgent
        Targets with needs left, most urgent first.
    hurry
        Once it is true, no more places are looked at.
    """
    m, n, _ = arrays.shape
    facts = Facts(
        np.full(n, NONE, np.int64), np.full(n, np.inf), np.full(n, NONE, np.int64), np.full(n, np.inf),
        np.full(n, NOT_LOOKED, np.int64), np.zeros(n, np.int64), np.full(n, -np.inf), np.zeros(n),
    )  # fmt: skip
    # What is found does not depend on the order; neighbours in memory are quicker one after the other.
    _look_from_start(arrays, plan.episodes, np.sort(urgent), facts)
    steps = plan.target.shape[1]
    # Just before each visit: distance flown, time, what is carried; and what is earned from there on.
    flown, clock = np.zeros((m, steps + 1)), np.zeros((m, steps + 1))
    load, later = np.zeros((m, steps + 1, arrays.shape[2])), np.zeros((m, steps + 1))
    _walk(arrays, plan.target, plan.length, plan.delivered, flown, clock, load, later)
    places = int(plan.length.sum()) + m
    thorough, done = min(len(urgent), _LOOKS // places), 0
    while done < len(urgent) and not hurry():
        everywhere = done < thorough
        piece = max(1, _PIECE // (places if everywhere else m))
        some = np.sort(urgent[done : min(done + piece, thorough if everywhere else len(urgent))])
        _look_for_place(
            arrays,
            plan.episodes,
            plan.target,
            plan.length,
            flown,
            clock,
            load,
            later,
            some,
            everywhere,
            facts,
        )
        facts.uav[some] = np.maximum(facts.uav[some], NONE)
        done += len(some)
    return facts


@simulator.compiled
def _look_from_start(
    arrays: ProblemArrays, episodes: simulator.Episodes, urgent: Integers, facts: Facts
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
    facts: Facts,
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
