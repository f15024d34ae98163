"""Set packing: the choice of pooled routes that together earn most, found by HiGHS.

Annealing decides on all routes at once and ends in one of many good plans; the best route of each may stand
in another. Over the routes of many such plans the choice is a small integer program,

    maximise  Σ_j level_j · y_j − λ Σ_r d_r · x_r
    subject to  Σ_{r of kind g} x_r ≤ UAVs of kind g,   y_j ≤ Σ_{r visits j} x_r,   x binary, 0 ≤ y ≤ 1,

whose linear relaxation is close. Its reduced costs say which routes no better plan can use, so few are left.
A target may be in several chosen routes; the visits that unload nothing then leave the plan, which gets
shorter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import highspy
import numpy as np

from app.simulation.arrays import Flags, Floats, Integers, ProblemArrays
from app.solvers.highs import QuietHighs
from app.solvers.local_search.pool import Pool

_NODES = 100
"""Nodes of the tree in which HiGHS looks for the choice; most end at the first."""

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
    """

    reward: float
    loss: Floats
    price: Floats
    least: Floats


class _Columns(NamedTuple):
    """The integer program, column by column: C routes, then N targets."""

    cost: Floats
    start: Integers
    row: Integers
    value: Floats
    row_upper: Floats
    routes: int

    def only(self, kept: Flags) -> _Columns:
        """Leave out the routes that are not among those ``kept``, (C,)."""
        everything = np.concatenate((kept, np.ones(len(self.cost) - self.routes, np.bool_)))
        sizes = np.diff(self.start)
        entries = np.repeat(everything, sizes)
        start = np.concatenate(([0], np.cumsum(sizes[everything])))
        return _Columns(
            self.cost[everything],
            start,
            self.row[entries],
            self.value[entries],
            self.row_upper,
            int(kept.sum()),
        )


def relax(arrays: ProblemArrays, pool: Pool) -> Relaxation | None:
    """Solve the linear relaxation over the routes of a pool; None where there are none."""
    if pool.size[0] == 0:
        return None
    highs = _solved(_columns(arrays, pool), integer=False)
    if highs is None:
        return None
    m = arrays.shape[0]
    idle = _idle_cost(arrays)
    solution = highs.getSolution()
    # Rewards are maximised, so HiGHS's prices of the rows are negative.
    dual = np.maximum(0.0, -np.array(solution.row_dual))
    return Relaxation(
        reward=-highs.getInfo().objective_function_value - float(idle.sum()),
        loss=np.maximum(0.0, np.array(solution.col_dual)[: int(pool.size[0])]),
        price=dual[m:],
        least=dual[:m][pool.kind] - idle,
    )


def best_choice(
    arrays: ProblemArrays,
    pool: Pool,
    relaxed: Relaxation,
    reward: float,
    seconds: float | None = None,
) -> Integers | None:
    """Choose routes of a pool that make a better plan, from those of least loss.

    Parameters
    ----------
    arrays
        A stack of one problem.
    pool
        Routes of that problem.
    relaxed
        Its relaxation.
    reward
        What the plan must exceed.
    seconds
        How long to look; None for as long as it takes, with the same answer every time.

    Returns
    -------
    Integers or None
        (S, M) joint actions, legal but for visits that unload nothing; None where no better choice was found.
    """
    least = next_reward(arrays, reward)
    if relaxed.reward < least:
        return None
    by_loss = np.argsort(relaxed.loss, kind="stable")[:_FEW]
    useful = np.sort(by_loss[relaxed.loss[by_loss] <= relaxed.reward - least])
    kept = np.zeros(int(pool.size[0]), np.bool_)
    kept[useful] = True
    highs = _solved(_columns(arrays, pool).only(kept), integer=True, seconds=seconds)
    if highs is None or -highs.getInfo().objective_function_value - float(_idle_cost(arrays).sum()) < least:
        return None
    return _actions(arrays, pool, useful[np.array(highs.getSolution().col_value)[: len(useful)] > 0.5])


def next_reward(arrays: ProblemArrays, reward: float) -> float:
    """Return what a better plan of whole routes earns at least.

    Where distance is free, such a plan earns a sum of levels; most are written in steps of some size.
    """
    levels = arrays.level[0][arrays.need_total[0] > 0]
    largest = max(float(levels.max(initial=0.0)), 1e-300)
    grain = _common_measure(levels, 1e-9 * largest) if arrays.weight[0] == 0.0 else 0.0
    if grain < _LEAST_GRAIN * largest:
        return reward + _LEAST_GAIN * largest
    return (math.floor(reward / grain + 1e-6) + 1) * grain - _LEAST_GAIN * largest


def _common_measure(values: Floats, tolerance: float) -> float:
    """Return the largest number of which all values are multiples, by Euclid's algorithm."""
    measure = 0.0
    for value in values.tolist():
        rest = value
        while rest > tolerance:
            measure, rest = rest, math.fmod(measure, rest)
    return measure


def _idle_cost(arrays: ProblemArrays) -> Floats:
    """(M,) what a UAV costs that stays where it is."""
    charged = arrays.charge_return[0] & ~arrays.ret[0]
    return arrays.weight[0] * np.where(charged, arrays.start_home[0], 0.0)


def _columns(arrays: ProblemArrays, pool: Pool) -> _Columns:
    """Write a pool as an integer program; rows are M kinds, one for the first UAV of each, and N targets."""
    m, n, _ = arrays.shape
    count = int(pool.size[0])
    uav, length = pool.uav[:count], pool.length[:count]
    used = np.arange(pool.target.shape[1])[None, :] < length[:, None]
    row = np.column_stack((pool.kind[uav], m + pool.target[:count]))
    entries = np.column_stack((np.ones(count, np.bool_), used))
    value = np.where(np.arange(row.shape[1]) == 0, 1.0, -1.0)[None, :].repeat(count, axis=0)
    return _Columns(
        cost=np.concatenate(
            (arrays.weight[0] * pool.distance[:count] - _idle_cost(arrays)[uav], -arrays.level[0])
        ),
        start=np.concatenate(([0], np.cumsum(np.concatenate((length + 1, np.ones(n, np.int64)))))),
        row=np.concatenate((row[entries], m + np.arange(n))),
        value=np.concatenate((value[entries], np.ones(n))),
        row_upper=np.concatenate((np.bincount(pool.kind, minlength=m).astype(np.float64), np.zeros(n))),
        routes=count,
    )


def _solved(columns: _Columns, *, integer: bool, seconds: float | None = None) -> QuietHighs | None:
    """Let HiGHS solve it; None where it has no solution when it ends."""
    size, rows = len(columns.cost), len(columns.row_upper)
    program = highspy.HighsLp()
    program.num_col_, program.num_row_ = size, rows
    program.col_cost_ = columns.cost
    program.col_lower_, program.col_upper_ = np.zeros(size), np.ones(size)
    program.row_lower_, program.row_upper_ = np.full(rows, -highspy.kHighsInf), columns.row_upper
    program.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    program.a_matrix_.start_ = columns.start
    program.a_matrix_.index_, program.a_matrix_.value_ = columns.row, columns.value
    limit = highspy.kHighsInf if seconds is None else seconds
    highs = QuietHighs(presolve="off", mip_rel_gap=0.0, mip_max_nodes=_NODES, time_limit=limit)
    if integer:
        # Visits are whole numbers by themselves; told so, HiGHS sees that rewards may be counted in steps.
        program.integrality_ = [highspy.HighsVarType.kInteger] * size
    highs.passModel(program)
    optimal = highs.optimise()
    feasible = highspy.SolutionStatus.kSolutionStatusFeasible
    # A relaxation that was cut short says nothing; a choice is one even where a better one may exist.
    if optimal or (integer and highs.getInfo().primal_solution_status == feasible):
        return highs
    return None


def _actions(arrays: ProblemArrays, pool: Pool, chosen: Integers) -> Integers:
    """(S, M) the chosen routes, each flown by a UAV of its kind."""
    m, n, _ = arrays.shape
    actions = np.full((int(arrays.max_steps[0]), m), n, np.int64)
    free = {kind: np.flatnonzero(pool.kind == kind).tolist() for kind in np.unique(pool.kind).tolist()}
    for q in chosen.tolist():
        i = free[int(pool.kind[pool.uav[q]])].pop(0)
        length = int(pool.length[q])
        actions[:length, i] = pool.target[q, :length]
    return actions
