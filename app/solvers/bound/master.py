"""The master problem of the column generation, solved by HiGHS: which mix of routes pays most."""

from __future__ import annotations

from typing import NamedTuple

import highspy
import numpy as np

from app.simulation.arrays import Flags, Floats
from app.simulation.highs import QuietHighs
from app.solvers.bound.instance import Instance
from app.solvers.protocol import StopCriterion

IDLE = -1
"""Route of a UAV that visits nothing."""


class MasterSolution(NamedTuple):
    """An optimum of the master problem.

    Attributes
    ----------
    value
        What the mix earns, in the instance's scale.
    prices
        (N, K) price of meeting each whole need.
    shadow
        (M,) what another copy of a UAV would earn.
    mix
        (C,) share of each column.
    """

    value: float
    prices: Floats
    shadow: Floats
    mix: Floats


class Master:
    """Columns are routes with what they deliver; rows are the UAVs and the needs.

    Every UAV spreads one route's worth over its columns, the first of which is to visit nothing.
    """

    def __init__(self, instance: Instance) -> None:
        m = len(instance.idle)
        self._rows = np.flatnonzero(instance.need.ravel() > 0)
        self._row_of = np.full(instance.need.size, -1)
        self._row_of[self._rows] = m + np.arange(len(self._rows))
        self._shape = instance.need.shape
        self._uavs = m
        self._program = QuietHighs(presolve="off", solver="simplex")
        for _ in range(m):
            self._program.addRow(1.0, 1.0, 0, np.empty(0, np.int32), np.empty(0))
        for _ in self._rows:
            self._program.addRow(-highspy.kHighsInf, 1.0, 0, np.empty(0, np.int32), np.empty(0))
        self.uav: list[int] = []
        self.route: list[int] = []
        self._known: set[tuple[int, int, bytes]] = set()
        for i, idle in enumerate(instance.idle.tolist()):
            self.add(i, IDLE, idle, np.zeros(self._shape))

    def add(self, i: int, route: int, earning: float, share: Floats) -> bool:
        """Add a column, unless it is there.

        Parameters
        ----------
        i, route
            The UAV and the index of its target set, or ``IDLE``.
        earning
            What the route earns without prices.
        share
            (N, K) shares of the needs that it meets.
        """
        key = (i, route, np.round(share, 9).tobytes())
        if key in self._known:
            return False
        self._known.add(key)
        met = np.flatnonzero(share.ravel() > 0)
        index = np.concatenate(([i], self._row_of[met])).astype(np.int32)
        value = np.concatenate(([1.0], share.ravel()[met]))
        self._program.addCol(-earning, 0.0, highspy.kHighsInf, len(index), index, value)
        self.uav.append(i)
        self.route.append(route)
        return True

    def allow(self, allowed: Flags) -> None:
        """Let only these columns be used; ``allowed`` is (C,)."""
        count = len(self.uav)
        upper = np.where(allowed, highspy.kHighsInf, 0.0)
        self._program.changeColsBounds(count, np.arange(count, dtype=np.int32), np.zeros(count), upper)

    def solve(self, stop: StopCriterion) -> MasterSolution | None:
        """Solve; None where the columns allow no route to some UAV, or HiGHS finds no optimum in time."""
        self._program.limit(stop.seconds_left())
        if not self._program.optimise():
            return None
        solution = self._program.getSolution()
        dual = np.array(solution.row_dual)
        prices = np.zeros(self._shape).ravel()
        prices[self._rows] = np.maximum(0.0, -dual[self._uavs :])
        return MasterSolution(
            -self._program.getInfo().objective_function_value,
            prices.reshape(self._shape),
            -dual[: self._uavs],
            np.array(solution.col_value),
        )
