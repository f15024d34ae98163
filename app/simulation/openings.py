"""What an area with needs left could still get: UAVs that could come, and places for a visit in a plan.

Facts only; :mod:`app.simulation.unmet` says what follows from them. Every place in the route of every UAV is
looked at, and what a visit there does is exact, not guessed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from app.simulation import simulator, visit, worth
from app.simulation.arrays import NONE, Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled, inlined
from app.simulation.flown_plan import FlownPlan
from app.simulation.from_start import Start, carries, direct_rule
from app.simulation.insertion import (
    MADE,
    WORK,
    Trial,
    begin,
    gain_of_undisturbed_visit,
    gain_of_visit,
    is_undisturbed,
    move_to,
    need_at,
    take_up,
)
from app.simulation.planned_insertion import ADDS, ALL_KEPT, ONLY_LOOK, PlannedTrial, gain_of_planned_visit
from app.simulation.shortfalls import RANGE, STEP, TIME, detour, lacking

_WORK = 2_000_000
"""Visits flown for all areas of an answer: some tenths of a second. Beyond, no more are looked at."""

_PIECE = 40_000
"""Of them, between two looks at the clock."""

AS_IS = 8
"""Place in :class:`Places`, after those for every sum of what is lacking, of the best visit that is legal."""

_COMERS, _IN_RANGE, _IN_TIME, _ABLE = range(4)

_EASED = 1e20
"""Range that is enough for every leg that exists, and for none that does not."""


class Places(NamedTuple):
    """The best places for one more visit to a target; UAVs are NONE where there is none.

    Attributes
    ----------
    uav, place, gain
        (9,) visits with something that is left over in the plan, by what they lack, each with the change of
        the reward once that is there: 0 where they lack nothing. The last one is the best of all visits that
        are legal in the plan, whatever they take from others.
    loader, loader_place, hope
        (2,) the best UAV with more aboard, and the best one that lacks something beside, where in their
        routes, and what that would earn at most.
    left_over
        (1,) whether any UAV that could come has something useful left over.
    blocked
        (3,) UAV, place and rule of the first visit with something left over that range, time and steps would
        not make legal.
    """

    uav: Integers
    place: Integers
    gain: Floats
    loader: Integers
    loader_place: Integers
    hope: Floats
    left_over: Integers
    blocked: Integers


def no_places() -> Places:
    """Begin a look."""
    return Places(
        np.full(AS_IS + 1, NONE, np.int64), np.zeros(AS_IS + 1, np.int64), np.full(AS_IS + 1, -np.inf),
        np.full(2, NONE, np.int64), np.zeros(2, np.int64), np.full(2, -np.inf), np.zeros(1, np.int64),
        np.array([NONE, 0, 0]),
    )  # fmt: skip


class Lookout:
    """Looks at every place for one more visit, for one target after the other, as long as there is time.

    Parameters
    ----------
    arrays
        A stack of one problem.
    plan, trial, planned
        Its plan, and scratch space for it; `planned` is None where unloading is greedy.
    hurry
        Once it is true, no more is looked at.
    """

    def __init__(
        self,
        arrays: ProblemArrays,
        plan: FlownPlan,
        trial: Trial,
        planned: PlannedTrial | None,
        hurry: Callable[[], bool],
    ) -> None:
        # Copies of what is eased for a while.
        self._arrays = arrays._replace(
            uavs=arrays.uavs.copy(), areas=arrays.areas.copy(), max_steps=arrays.max_steps.copy()
        )
        self._plan, self.trial, self._planned, self._hurry = plan, trial, planned, hurry
        # A visit with many materials takes longer.
        self._size = 1 + arrays.shape[2] / 16
        room = plan.leg.shape[1] + 3
        self._lacking, self._kept = np.zeros(room), np.zeros(room)

    @property
    def spent(self) -> bool:
        """Whether this answer has had its share of looking, however much time there is."""
        return int(self.trial.tally[WORK]) >= _WORK / self._size

    def look(self, j: int, start: Start) -> Places | None:
        """Look at all places for a visit to target `j`; None if that cannot be finished."""
        if self.spent or self._hurry():
            return None
        comers = _COMERS if start.fastest[j] < 0 else _IN_RANGE
        if comers == _IN_RANGE and not visit.is_late(
            float(start.arrival[j]), float(self._arrays.areas["deadline"][0, j])
        ):
            comers = _IN_TIME if start.able[j] < 0 else _ABLE
        found = no_places()
        i = 0
        while True:
            i = _look(
                self._arrays, self._plan, self.trial, self._planned, j, comers, i,
                self._lacking, self._kept, found,
            )  # fmt: skip
            if i >= self._arrays.shape[0]:
                return found
            if self.spent or self._hurry():
                return None

    def lacking(self, i: int, place: int, j: int) -> tuple[bool, float, dict[int, float]]:
        """What UAV `i` lacks for target `j` as visit `place`, if it keeps all others.

        Returns
        -------
        tuple
            Whether a decision step; range; and for the targets that it would reach too late, how much.
        """
        lacks = lacking(self._arrays, self._plan, i, place, j, self._lacking)
        late: dict[int, float] = {}
        if lacks & TIME:
            route = self._plan.visits.target[i, place : self._plan.visits.length[i]].tolist()
            for x, after in zip([j, *route], self._lacking[2:].tolist(), strict=False):
                if x > self._arrays.shape[1]:
                    continue
                deadline = float(self._arrays.areas["deadline"][0, x])
                if visit.is_late(deadline + after, deadline):
                    late[x] = max(after, late.get(x, 0.0))
        return bool(lacks & STEP), float(self._lacking[1]) if lacks & RANGE else 0.0, late


@inlined
def _comes(arrays: ProblemArrays, plan: FlownPlan, i: int, j: int, comers: int) -> bool:
    """Whether a UAV counts among those that could come: carriers, those in range, in time, or able to."""
    comes = carries(arrays, plan, i, j)
    if comes and comers > _COMERS:
        rule = direct_rule(arrays, i, j)
        in_range = rule not in (visit.BARRED, visit.OUT_OF_RANGE)
        enough = comers == _IN_RANGE or (comers == _IN_TIME and rule != visit.TOO_LATE)
        comes = rule == visit.ALLOWED or (in_range and enough)
    return comes


@compiled
def _look(
    arrays: ProblemArrays,
    plan: FlownPlan,
    trial: Trial,
    planned: PlannedTrial | None,
    j: int,
    comers: int,
    first: int,
    lacks: Floats,
    kept: Floats,
    found: Places,
) -> int:
    """Look at the routes of UAVs from `first` on, for a while; return the UAV to go on with.

    Where `planned` is None, nothing that it is for is compiled.
    """
    tally = trial.tally
    end = tally[WORK] + _PIECE
    for i in range(first, plan.back.shape[0]):
        if tally[WORK] > end:
            return i
        if arrays.ret[0, i]:
            continue
        left_over = False
        if _comes(arrays, plan, i, j, comers):
            for k in range(plan.spare.shape[1]):
                left_over = left_over or (plan.spare[i, k] > 0.0 and plan.remaining[j, k] > 0.0)
            if planned is not None:
                gain_of_planned_visit(arrays, plan, trial, planned, i, ONLY_LOOK, j, False)
                left_over = left_over or planned.known[ALL_KEPT, ADDS] == 1
        if left_over:
            found.left_over[0] = 1
        for place in range(plan.visits.length[i] + 1):
            tally[WORK] += 1
            hope = _hope(arrays, plan, i, place, j)
            legal = True
            if planned is None:
                legal = _is_legal(arrays, plan, trial, i, place, j)
            if not legal and not left_over and hope <= min(found.hope[0], found.hope[1]):
                continue
            lack = lacking(arrays, plan, i, place, j, lacks)
            _note_loader(found, i, place, hope, lack)
            for easy in range(2):
                if easy == 0 and not legal:
                    if lack == 0 and left_over:
                        _note_blocked(arrays, plan, trial, found, i, place, j)
                    continue
                if easy == 1:
                    if lack == 0 or not left_over:
                        continue
                    _ease(arrays, plan, i, j, kept)
                if planned is None:
                    gain = _greedy_gain(arrays, plan, trial, i, place, j, easy == 1 or lack == 0)
                else:
                    gain = gain_of_planned_visit(arrays, plan, trial, planned, i, place, j, False)
                if easy == 1:
                    if tally[MADE] == 0:
                        _note_blocked(arrays, plan, trial, found, i, place, j)
                    _ease_no_more(arrays, plan, i, j, kept)
                if tally[MADE] == 0:
                    continue
                if easy == 0:
                    _note(found, AS_IS, i, place, gain)
                if left_over and (easy == 1 or lack == 0):
                    _note(found, lack, i, place, gain)
    return int(plan.back.shape[0])


@inlined
def _ease(arrays: ProblemArrays, plan: FlownPlan, i: int, j: int, kept: Floats) -> None:
    """Give a UAV range and its visits time and a step without limit; what they had is kept."""
    length = plan.visits.length[i]
    kept[0], kept[1] = arrays.uavs[0, i].voyage, arrays.areas[0, j].deadline
    arrays.uavs[0, i].voyage, arrays.areas[0, j].deadline = _EASED, np.inf
    for s in range(length):
        x = plan.visits.target[i, s]
        if not visit.is_base(arrays, x):
            kept[2 + s], arrays.areas[0, x].deadline = arrays.areas[0, x].deadline, np.inf
    arrays.max_steps[0] += 1


@inlined
def _ease_no_more(arrays: ProblemArrays, plan: FlownPlan, i: int, j: int, kept: Floats) -> None:
    """Undo :func:`_ease`: backwards, as a target may be visited twice."""
    length = plan.visits.length[i]
    arrays.max_steps[0] -= 1
    for s in range(length):
        x = plan.visits.target[i, length - 1 - s]
        if not visit.is_base(arrays, x):
            arrays.areas[0, x].deadline = kept[1 + length - s]
    arrays.uavs[0, i].voyage, arrays.areas[0, j].deadline = kept[0], kept[1]


@inlined
def _is_legal(arrays: ProblemArrays, plan: FlownPlan, trial: Trial, i: int, place: int, j: int) -> bool:
    """Whether a visit is legal, where unloading is greedy."""
    begin(trial, i, place, j)
    legal = bool(place < arrays.max_steps[0])
    if legal:
        move_to(plan, trial, i, place)
        legal = simulator.reach_verdict(arrays, trial.episodes, 0, i, j) == visit.ALLOWED
    if legal:
        take_up(arrays, plan, trial, i, place)
        need_at(arrays, plan, trial, j, place * plan.back.shape[0] + i)
        legal = simulator.verdict(arrays, trial.episodes, 0, i, j) == visit.ALLOWED
    return legal


@inlined
def _greedy_gain(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, i: int, place: int, j: int, keeps_all: bool
) -> float:
    """Change of the reward with a legal visit; quick where it takes nothing from other visits."""
    begin(trial, i, place, j)
    take_up(arrays, plan, trial, i, place)
    alone = need_at(arrays, plan, trial, j, place * plan.back.shape[0] + i) and keeps_all
    if alone and is_undisturbed(arrays, plan, trial, i, place, j):
        gain = gain_of_undisturbed_visit(arrays, plan, trial, i, place, j)
    else:
        gain = gain_of_visit(arrays, plan, trial, i, place, j, False)
    return gain


@inlined
def _note(found: Places, which: int, i: int, place: int, gain: float) -> None:
    """Keep a visit if it is the best of its kind."""
    if found.uav[which] < 0 or gain > found.gain[which]:
        found.uav[which], found.place[which], found.gain[which] = i, place, gain


@inlined
def _hope(arrays: ProblemArrays, plan: FlownPlan, i: int, place: int, j: int) -> float:
    """What a visit would earn that brings all that is still needed and takes nothing from others."""
    still = 0.0
    for k in range(plan.remaining.shape[1]):
        still += plan.remaining[j, k]
    hope: float = worth.earned_by(arrays, 0, j, still)
    hope -= worth.cost_of(arrays, 0, detour(arrays, plan, i, place, j))
    return hope


@inlined
def _note_blocked(
    arrays: ProblemArrays, plan: FlownPlan, trial: Trial, found: Places, i: int, place: int, j: int
) -> None:
    """Keep the first visit that another rule than range, deadline and steps forbids."""
    if found.blocked[0] < 0:
        move_to(plan, trial, i, place)
        rule = simulator.reach_verdict(arrays, trial.episodes, 0, i, j)
        if rule != visit.ALLOWED:
            found.blocked[0], found.blocked[1], found.blocked[2] = i, place, rule


@inlined
def _note_loader(found: Places, i: int, place: int, hope: float, lack: int) -> None:
    """Keep a visit with more aboard if there is more to hope from it."""
    which = 0 if lack == 0 else 1
    if hope > found.hope[which]:
        found.loader[which], found.loader_place[which], found.hope[which] = i, place, hope
