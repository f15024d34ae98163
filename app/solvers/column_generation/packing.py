"""Set packing: the choice of pooled routes that together earn most, found by HiGHS.

Annealing decides on all routes at once and ends in one of many good plans; the best route of each may stand
in another. Over the routes of many such plans the choice is a small integer program,

    maximise  Σ_j level_j · y_j − λ Σ_r d_r · x_r
    subject to  Σ_{r of kind g} x_r ≤ UAVs of kind g,   y_j ≤ Σ_{r visits j} x_r,   x binary, 0 ≤ y ≤ 1,

whose linear relaxation (x ≥ 0) is close. Its reduced costs say which routes no better plan can use, so few
are left, and its prices what other routes would have to be worth (``pricing.py``).
A target may be in several chosen routes; the visits that unload nothing then leave the plan, which gets
shorter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import highspy
import numpy as np

from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.highs import QuietHighs
from app.solvers.column_generation.pool import Pool
from app.solvers.protocol import StopCriterion
from app.solvers.scale import largest_level
from app.solvers.stop import never

_NODES = 100
"""Nodes of the tree in which HiGHS looks for the choice; most end at the first."""

_AHEAD = 0.8
"""Share of what is left of the time after which HiGHS is told to stop choosing, because it takes longer."""

_FEW = 200
"""Routes that HiGHS chooses from: with all of them it takes several times as long for the same choice."""

_LEAST_GAIN = 1e-6
"""Gain, in largest levels, for which a choice is worth making."""

_LEAST_GRAIN = 1e-3
"""Least common measure of the levels, in largest levels, that rewards are counted in."""


class Relaxation(NamedTuple):
    """An optimum of the linear relaxation.

    Attributes
    ----------
    reward
        What no choice of the pool's routes exceeds.
    loss
        (size,) by how much less a choice earns at best that uses a route.
    price
        (N,) what another visit to a target would earn.
    least
        (M,) what a new route of a UAV has to earn at these prices, less its distance, to be worth using.
    share
        (size,) how often each route is used.
    """

    reward: float
    loss: Floats
    price: Floats
    least: Floats
    share: Floats


class Packing:
    """The choice among the routes of a pool, which may grow meanwhile but not be thinned."""

    def __init__(self, arrays: ProblemArrays, pool: Pool, until: StopCriterion = never) -> None:
        """Prepare to relax and to choose within the time that a criterion leaves."""
        self._arrays, self._pool, self._until = arrays, pool, until
        self._idle = idle_cost(arrays)
        # HiGHS has absolute tolerances: it is told of rewards in largest levels.
        self._unit = largest_level(arrays)
        self._relaxation = QuietHighs(presolve="off", solver="simplex")
        self._relaxation.passModel(self._program(np.arange(0)))
        self._routes = 0
        self.fixed: list[int] = []
        """Routes that are to be used."""

    def fix(self, routes: Sequence[int]) -> None:
        """Let these routes be used, too, whatever the relaxation says."""
        n = self._arrays.shape[1]
        for q in routes:
            self._relaxation.changeColBounds(n + q, 1.0, 1.0)
        self.fixed.extend(routes)

    def loosen(self) -> None:
        """Let no route be fixed."""
        n = self._arrays.shape[1]
        for q in self.fixed:
            self._relaxation.changeColBounds(n + q, 0.0, highspy.kHighsInf)
        self.fixed.clear()

    def spare(self) -> Integers:
        """(M,) how many UAVs of each kind have no fixed route."""
        kind, m = self._pool.kind, self._arrays.shape[0]
        return np.bincount(kind, minlength=m) - np.bincount(kind[self._pool.uav[self.fixed]], minlength=m)

    def room_for(self, routes: Integers) -> bool:
        """Whether there are UAVs without a fixed route for all of these."""
        kind, m = self._pool.kind, self._arrays.shape[0]
        return bool((np.bincount(kind[self._pool.uav[routes]], minlength=m) <= self.spare()).all())

    def relax(self) -> Relaxation | None:
        """Solve the linear relaxation over the routes there are; None where there is no time for it."""
        m, n, _ = self._arrays.shape
        highs, known, size = self._relaxation, self._routes, int(self._pool.size[0])
        # A set of targets that is known may have got a shorter order.
        highs.changeColsCost(known, np.arange(n, n + known, dtype=np.int32), self._costs(np.arange(known)))
        added = np.arange(known, size)
        start, row, value = self._entries(added)
        highs.addCols(
            len(added), self._costs(added), np.zeros(len(added)), np.full(len(added), highspy.kHighsInf),
            len(row), start[:-1].astype(np.int32), row.astype(np.int32), value,
        )  # fmt: skip
        self._routes = size
        # A relaxation that was cut short says nothing.
        highs.limit(self._until.seconds_left())
        if not highs.optimise():
            return None
        solution = highs.getSolution()
        # Rewards are maximised, so HiGHS's prices of the rows are negative.
        dual = self._unit * np.maximum(0.0, -np.array(solution.row_dual))
        return Relaxation(
            reward=-self._unit * highs.getInfo().objective_function_value - float(self._idle.sum()),
            loss=self._unit * np.maximum(0.0, np.array(solution.col_dual)[n:]),
            price=dual[m:],
            least=dual[:m][self._pool.kind] - self._idle,
            share=np.array(solution.col_value)[n:],
        )

    def better_than(self, reward: float) -> float:
        """Return what a choice earns at least that is better than some reward."""
        return next_reward(self._arrays, reward)

    def choose(self, relaxed: Relaxation, reward: float) -> Integers | None:
        """Choose routes that make a better plan, from those of least loss.

        Parameters
        ----------
        relaxed
            The last relaxation.
        reward
            What the plan must exceed.

        Returns
        -------
        Integers or None
            (S, M) joint actions, legal but for visits that unload nothing; None where no better choice was
            found.
        """
        n = self._arrays.shape[1]
        least = self.better_than(reward)
        if relaxed.reward < least:
            return None
        by_loss = np.argsort(relaxed.loss, kind="stable")[:_FEW]
        useful = np.sort(by_loss[relaxed.loss[by_loss] <= relaxed.reward - least])
        program = self._program(useful)
        # Visits are whole numbers by themselves; told so, HiGHS sees that rewards may be counted in steps.
        program.integrality_ = [highspy.HighsVarType.kInteger] * (n + len(useful))
        highs = QuietHighs(presolve="off", mip_rel_gap=0.0, mip_max_nodes=_NODES)
        highs.limit(_AHEAD * self._until.seconds_left())
        highs.passModel(program)
        optimal, info = highs.optimise(), highs.getInfo()
        # A choice is one even where a better one may exist.
        if not optimal and info.primal_solution_status != highspy.SolutionStatus.kSolutionStatusFeasible:
            return None
        if -self._unit * info.objective_function_value - float(self._idle.sum()) < least:
            return None
        return self.actions(useful[np.array(highs.getSolution().col_value)[n:] > 0.5])

    def _program(self, routes: Integers) -> highspy.HighsLp:
        """Write the program over some routes: columns are N targets, then these; rows are M kinds, N targets.

        The row of a kind is that of its first UAV.
        """
        m, n, _ = self._arrays.shape
        start, row, value = self._entries(routes)
        room = np.bincount(self._pool.kind, minlength=m).astype(np.float64)
        program = highspy.HighsLp()
        program.num_col_, program.num_row_ = n + len(routes), m + n
        program.col_cost_ = np.concatenate((-worth(self._arrays) / self._unit, self._costs(routes)))
        program.col_lower_, program.col_upper_ = np.zeros(n + len(routes)), np.ones(n + len(routes))
        program.row_lower_ = np.full(m + n, -highspy.kHighsInf)
        program.row_upper_ = np.concatenate((room, np.zeros(n)))
        program.a_matrix_.format_ = highspy.MatrixFormat.kColwise
        program.a_matrix_.start_ = np.concatenate((np.arange(n), n + start))
        program.a_matrix_.index_ = np.concatenate((m + np.arange(n), row))
        program.a_matrix_.value_ = np.concatenate((np.ones(n), value))
        return program

    def _costs(self, routes: Integers) -> Floats:
        """Return what routes cost, in largest levels, over what their UAVs cost where they are."""
        distance, uav = self._pool.distance[routes], self._pool.uav[routes]
        return (self._arrays.terms["weight"][0] * distance - self._idle[uav]) / self._unit

    def _entries(self, routes: Integers) -> tuple[Integers, Integers, Floats]:
        """Return the entries of the columns of C routes: where each begins, (C + 1,), rows and values."""
        uav, length = self._pool.uav[routes], self._pool.length[routes]
        used = np.arange(self._pool.target.shape[1])[None, :] < length[:, None]
        entries = np.column_stack((np.ones(len(routes), np.bool_), used))
        row = np.column_stack((self._pool.kind[uav], self._arrays.shape[0] + self._pool.target[routes]))[
            entries
        ]
        start = np.concatenate(([0], np.cumsum(length + 1)))
        value = np.full(len(row), -1.0)
        value[start[:-1]] = 1.0
        return start, row, value

    def actions(self, chosen: Integers) -> Integers:
        """(S, M) the chosen routes, each flown by a UAV of its kind."""
        m, n, _ = self._arrays.shape
        pool = self._pool
        actions = np.full((int(self._arrays.max_steps[0]), m), n, np.int64)
        free = {kind: np.flatnonzero(pool.kind == kind).tolist() for kind in np.unique(pool.kind).tolist()}
        for q in chosen.tolist():
            i = free[int(pool.kind[pool.uav[q]])].pop(0)
            length = int(pool.length[q])
            actions[:length, i] = pool.target[q, :length]
        return actions


def next_reward(arrays: ProblemArrays, reward: float) -> float:
    """Return what a better plan of whole routes earns at least."""
    largest, grain = _steps(arrays)
    if grain == 0.0:
        return reward + _LEAST_GAIN * largest
    return (math.floor(reward / grain + 1e-6) + 1) * grain - _LEAST_GAIN * largest


def reachable(arrays: ProblemArrays, bound: float) -> float:
    """Return the largest reward of whole routes that a bound leaves, rounded up."""
    _, grain = _steps(arrays)
    if grain == 0.0 or bound == math.inf:
        return bound
    return math.floor(bound / grain + 1e-6) * grain


def _steps(arrays: ProblemArrays) -> tuple[float, float]:
    """Return the largest level, and the steps in which rewards come; 0 where they may be anything.

    Where distance is free, whole routes earn a sum of levels; most are written in steps of some size.
    """
    levels, largest = arrays.areas["level"][0][arrays.areas["need_total"][0] > 0], largest_level(arrays)
    counted = not (
        arrays.terms["weight"][0]
        or arrays.terms["decay"][0]
        or arrays.terms["makespan"][0]
        or arrays.terms["change"][0]
    )
    grain = _common_measure(levels, 1e-9 * largest) if counted else 0.0
    return largest, grain if grain >= _LEAST_GRAIN * largest else 0.0


def _common_measure(values: Floats, tolerance: float) -> float:
    """Return the largest number of which all values are multiples, by Euclid's algorithm."""
    measure = 0.0
    for value in values.tolist():
        rest = value
        while rest > tolerance:
            measure, rest = rest, math.fmod(measure, rest)
    return measure


def worth(arrays: ProblemArrays) -> Floats:
    """(N,) what a visit earns that meets the whole need; nothing where nothing is needed."""
    return np.where(arrays.areas["need_total"][0] > 0, arrays.areas["level"][0], 0.0)


def idle_cost(arrays: ProblemArrays) -> Floats:
    """(M,) what a UAV costs that stays where it is."""
    charged = arrays.terms["charge_return"][0] & ~arrays.ret[0]
    return arrays.terms["weight"][0] * np.where(charged, arrays.uavs["start_home"][0], 0.0)
