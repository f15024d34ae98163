"""The best amounts of given routes where loading is planned, as a linear program, solved by HiGHS.

Columns are what visits unload, what reloads take (or, below 0, leave behind), what is aboard after each
flight and in stock after each reload, and of a need the part that earns more. Rows keep loads, stocks and
needs in balance and the weight after each reload within the capacity.
"""

from __future__ import annotations

import highspy
import numpy as np

from app.domain.problem import ROUNDING
from app.simulation.amounts import Amounts, stops_in_order
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.highs import QuietHighs

_ZERO = 1e-9
"""Amount, in parts of the largest need of a material, that a solution of the program may be off by."""

_LEAST_CAPACITY = 1e-9
"""Of the weight of the heaviest of these largest needs; a row of weights is no finer."""


def amounts_by_program(arrays: ProblemArrays, actions: Integers) -> Amounts | None:
    """Solve the program.

    Parameters
    ----------
    arrays
        A stack of one problem whose loading is planned.
    actions
        (S', M) joint actions; ranges and deadlines do not matter here.

    Returns
    -------
    Amounts or None
        None if HiGHS finds no optimum. There always is one, but amounts and weights of a request may lie
        farther apart than its tolerances do.
    """
    if (actions == arrays.shape[1]).all():
        none = np.zeros((*actions.shape, arrays.shape[2]))
        return Amounts(none, none.copy())
    wanted = _Program(arrays, actions).solve()
    return None if wanted is None else in_turn(arrays, actions, wanted)


def in_turn(arrays: ProblemArrays, actions: Integers, wanted: Amounts) -> Amounts:
    """Return amounts that are possible to the last digit: each at most what is there in its turn.

    A reload takes no more than the UAV will unload until the next one, where that is possible.
    """
    simple = _possible(arrays, actions, Amounts(wanted.delivered, _as_unloaded(arrays, actions, wanted)))
    if np.abs(simple.delivered - wanted.delivered).max() <= _ZERO * max(1.0, float(wanted.delivered.max())):
        return simple
    return _possible(arrays, actions, wanted)


def _as_unloaded(arrays: ProblemArrays, actions: Integers, wanted: Amounts) -> Floats:
    """Return loads that are just what each flight unloads beyond what is aboard before it."""
    m, n, k = arrays.shape
    loaded = np.zeros_like(wanted.loaded)
    aboard, flight = arrays.load[0].copy(), np.full(m, -1)
    total = np.zeros((*actions.shape, k))
    for s, i, j in stops_in_order(actions, n):
        if j > n:
            flight[i] = s
        elif flight[i] >= 0:
            total[flight[i], i] += wanted.delivered[s, i]
    for s, i, j in stops_in_order(actions, n):
        if j > n:
            loaded[s, i] = np.maximum(0.0, total[s, i] - aboard[i])
            aboard[i] += loaded[s, i]
        else:
            aboard[i] = np.maximum(0.0, aboard[i] - wanted.delivered[s, i])
    return loaded


def _possible(arrays: ProblemArrays, actions: Integers, wanted: Amounts) -> Amounts:
    """Return amounts of which each is at most what is there in its turn; what is rounding is nothing."""
    n = arrays.shape[1]
    aboard, stock, need = arrays.load[0].copy(), arrays.stock[0].copy(), arrays.need[0].copy()
    weights, capacity = arrays.weights[0], arrays.uavs["capacity"][0]
    delivered, loaded = np.zeros_like(wanted.delivered), np.zeros_like(wanted.loaded)
    for s, i, j in stops_in_order(actions, n):
        if j < n:
            most = np.minimum(aboard[i], need[j])
            amount = np.minimum(wanted.delivered[s, i], most)
            amount = np.where(most - amount <= _ZERO * most, most, amount)
            amount = np.where(amount > ROUNDING * need[j], amount, 0.0)
            delivered[s, i] = amount
            aboard[i] -= amount
            need[j] -= amount
            continue
        d = j - n - 1
        amount = np.clip(wanted.loaded[s, i], -aboard[i], stock[d])
        weight = float(weights @ (aboard[i] + amount))
        if weight > capacity[i]:
            taken = np.maximum(amount, 0.0)
            over = (weight - capacity[i]) / max(float(weights @ taken), capacity[i] * 1e-300, 1e-300)
            amount -= taken * min(1.0, over)
        loaded[s, i] = amount
        aboard[i] = np.maximum(0.0, aboard[i] + amount)
        stock[d] = np.maximum(0.0, stock[d] - amount)
    return Amounts(delivered, loaded)


_Sum = tuple[float, dict[int, float]]
"""A constant, and columns with their factors."""


class _Program:
    """The program of one plan, written row by row."""

    def __init__(self, arrays: ProblemArrays, actions: Integers) -> None:
        self._arrays, self._actions = arrays, actions
        self._cost: list[float] = []
        self._lower: list[float] = []
        self._upper: list[float] = []
        self._rows: list[tuple[float, float, dict[int, float]]] = []
        # Amounts count in parts of the largest need, so that one tolerance suits all materials.
        most = arrays.need[0].max(axis=0)
        self._unit: Floats = np.where(most > 0.0, most, 1.0)
        self._visits: list[tuple[int, int, list[int]]] = []
        self._reloads: list[tuple[int, int, list[int]]] = []
        self._write()

    def solve(self) -> Amounts | None:
        """Return the amounts of an optimum; None if HiGHS finds none."""
        starts = np.cumsum([0, *(len(row) for _, _, row in self._rows)])
        lp = highspy.HighsLp()
        lp.num_col_, lp.num_row_ = len(self._cost), len(self._rows)
        lp.col_cost_, lp.col_lower_, lp.col_upper_ = (
            np.array(each, np.float64) for each in (self._cost, self._lower, self._upper)
        )
        lp.row_lower_ = np.array([lower for lower, _, _ in self._rows])
        lp.row_upper_ = np.array([upper for _, upper, _ in self._rows])
        lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
        lp.a_matrix_.start_ = starts
        lp.a_matrix_.index_ = np.array([column for _, _, row in self._rows for column in row], np.int32)
        lp.a_matrix_.value_ = np.array([value for _, _, row in self._rows for value in row.values()])
        highs = QuietHighs(solver="simplex")
        highs.passModel(lp)
        if not highs.optimise():
            return None
        found = np.array(highs.getSolution().col_value)
        shape = (*self._actions.shape, self._arrays.shape[2])
        amounts = Amounts(np.zeros(shape), np.zeros(shape))
        for s, i, columns in self._visits:
            amounts.delivered[s, i] = found[columns] * self._unit
        for s, i, columns in self._reloads:
            amounts.loaded[s, i] = found[columns] * self._unit
        return amounts

    def _column(self, cost: float, lower: float, upper: float) -> int:
        self._cost.append(cost)
        self._lower.append(lower)
        self._upper.append(upper)
        return len(self._cost) - 1

    def _write(self) -> None:
        arrays = self._arrays
        m, n, materials = arrays.shape
        need, load = arrays.need[0] / self._unit, arrays.load[0] / self._unit
        load[arrays.ret[0]] = 0.0
        stock = arrays.stock[0] / self._unit
        rate, bonus = _rates(arrays)[:, None] * self._unit, float(arrays.terms["bonus"][0])
        # What is aboard and in stock: a constant, and the columns that add to it.
        aboard: list[list[_Sum]] = [[(float(load[i, k]), {}) for k in range(materials)] for i in range(m)]
        left: list[list[_Sum]] = [
            [(float(stock[d, k]), {}) for k in range(materials)] for d in range(arrays.n_bases)
        ]
        met: dict[tuple[int, int], list[int]] = {}
        for s, i, j in stops_in_order(self._actions, n):
            columns = []
            for k in range(materials):
                if j < n:
                    column = self._column(-float(rate[j, k]), 0.0, float(need[j, k]))
                    met.setdefault((j, k), []).append(column)
                    self._change(aboard[i], k, column, -1.0)
                else:
                    column = self._column(0.0, -highspy.kHighsInf, highspy.kHighsInf)
                    aboard[i][k] = self._settled(aboard[i][k])
                    self._change(aboard[i], k, column, 1.0)
                    if np.isfinite(stock[j - n - 1, k]):
                        self._change(left[j - n - 1], k, column, -1.0)
                        left[j - n - 1][k] = self._settled(left[j - n - 1][k])
                columns.append(column)
            (self._visits if j < n else self._reloads).append((s, i, columns))
            if j > n and np.isfinite(arrays.uavs["capacity"][0, i]):
                self._limit_weight(aboard[i], float(arrays.uavs["capacity"][0, i]))
        for i in range(m):
            for k in range(materials):
                self._settled(aboard[i][k])
        first = np.maximum(0.0, arrays.need[0] - arrays.beyond[0]) / self._unit
        for (j, k), each in met.items():
            if len(each) > 1:
                self._rows.append((-highspy.kHighsInf, float(need[j, k]), dict.fromkeys(each, 1.0)))
            if bonus > 0.0 and first[j, k] > 0.0:
                part = self._column(-bonus * float(rate[j, k]), 0.0, float(first[j, k]))
                self._rows.append((-highspy.kHighsInf, 0.0, {part: 1.0, **dict.fromkeys(each, -1.0)}))

    @staticmethod
    def _change(sums: list[_Sum], k: int, column: int, by: float) -> None:
        constant, terms = sums[k]
        sums[k] = constant, {**terms, column: by}

    def _settled(self, total: _Sum) -> _Sum:
        """Say that a sum is 0 or more, and return it as one column."""
        constant, terms = total
        if not terms:
            return total
        column = self._column(0.0, 0.0, highspy.kHighsInf)
        self._rows.append((-constant, -constant, {**terms, column: -1.0}))
        return 0.0, {column: 1.0}

    def _limit_weight(self, aboard: list[_Sum], capacity: float) -> None:
        weights = self._arrays.weights[0] * self._unit
        carried = sum(float(w) * constant for w, (constant, _) in zip(weights, aboard, strict=True))
        # In parts of the capacity, unless that is nothing beside what is to be carried: HiGHS refuses a row
        # with factors beyond 1e15.
        part = max(capacity, _LEAST_CAPACITY * float(weights.max()))
        row = {
            column: by * float(w) / part
            for w, (_, terms) in zip(weights, aboard, strict=True)
            for column, by in terms.items()
            if w > 0.0
        }
        if row:
            self._rows.append((-highspy.kHighsInf, (capacity - carried) / part, row))


def _rates(arrays: ProblemArrays) -> Floats:
    """Return what a unit beyond the first share earns at each target, (N,)."""
    if arrays.terms["bonus"][0] != 0.0:
        return np.asarray(arrays.areas["unit"][0])
    total = arrays.areas["need_total"][0]
    wanted = total > 0.0
    return np.where(wanted, arrays.areas["level"][0], 0.0) / np.where(wanted, total, 1.0)
