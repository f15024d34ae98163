"""The best amounts of given routes with reloads, as a dense linear program; without the product's code."""

import highspy
import numpy as np
from brute_force_unloading import asked_by


def best_by_program(problem: dict, assignment: list[list[int]], full: bool = False) -> float:
    """Largest satisfaction of the routes, whatever their lengths and times.

    With `full` every reload leaves the UAV with its `full_load`: exact where stocks have no end and nobody
    begins with more. Otherwise reloads take what is best.
    """
    n, materials = len(problem["targets"]), len(problem["uavs"][0]["loadlist"])
    stops = [(i, a) for row in assignment for i, a in enumerate(row) if a != n]
    lp = _Dense(len(stops) * materials + n * materials)
    _needs(problem, stops, lp)
    weights = [each.get("weight", 1.0) for each in problem.get("materials") or [{"weight": 1.0}] * materials]
    for i, uav in enumerate(problem["uavs"]):
        own = [(q, a) for q, (who, a) in enumerate(stops) if who == i]
        aboard = np.zeros((materials, lp.columns))
        begun = np.array(uav["loadlist"], float)
        for q, a in own:
            for k in range(materials):
                if a > n and full:
                    aboard[k] = 0.0
                    begun[k] = (uav["loadlist"] if uav.get("full_load") is None else uav["full_load"])[k]
                    continue
                aboard[k, q * materials + k] += -1.0 if a < n else 1.0
                lp.at_most(-aboard[k], begun[k])
            if a > n and not full and uav.get("capacity") is not None:
                held = sum(w * amount for w, amount in zip(weights, begun, strict=True))
                lp.at_most(np.array(weights) @ aboard, uav["capacity"] - held)
    for d, base in enumerate(problem.get("bases") or ()):
        if base.get("stock") is None or full:
            continue
        for k, there in enumerate(base["stock"]):
            taken = np.zeros(lp.columns)
            for q, (_, a) in enumerate(stops):
                if a == n + 1 + d:
                    taken[q * materials + k] += 1.0
                    lp.at_most(taken.copy(), there)
    return lp.best()


def _needs(problem: dict, stops: list[tuple[int, int]], lp: "_Dense") -> None:
    """Worth and limits of what is delivered; the last columns are what of it is of the first share."""
    materials = len(problem["uavs"][0]["loadlist"])
    objective = problem.get("objective") or {}
    bonus = (objective.get("minimum_weight") or 1.0) - 1.0
    for j, area in enumerate(problem["targets"]):
        asked = asked_by(area)
        worth = area["level"] / sum(asked) if sum(asked) else 0.0
        for k in range(materials):
            first = len(stops) * materials + j * materials + k
            share = (objective.get("minimum_share") or 0.0) * asked[k] - (asked[k] - area["loadlist"][k])
            lp.limit(first, worth * bonus, 0.0, max(0.0, share))
            met = np.zeros(lp.columns)
            for q, (_, a) in enumerate(stops):
                if a == j:
                    met[q * materials + k] = 1.0
                    lp.limit(q * materials + k, worth, 0.0, area["loadlist"][k])
            lp.at_most(met, area["loadlist"][k])
            early = -met
            early[first] = 1.0
            lp.at_most(early, 0.0)


class _Dense:
    """A program with rows written out in full; columns that are not limited are free and worth nothing."""

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self._worth = np.zeros(columns)
        self._low, self._high = np.full(columns, -highspy.kHighsInf), np.full(columns, highspy.kHighsInf)
        self._rows: list[tuple[np.ndarray, float]] = []

    def limit(self, column: int, worth: float, low: float, high: float) -> None:
        self._worth[column], self._low[column], self._high[column] = worth, low, high

    def at_most(self, row: np.ndarray, most: float) -> None:
        self._rows.append((row, most))

    def best(self) -> float:
        solver = highspy.Highs()
        solver.setOptionValue("output_flag", False)
        for column in range(self.columns):
            solver.addCol(
                -self._worth[column],
                self._low[column],
                self._high[column],
                0,
                np.empty(0, np.int32),
                np.empty(0),
            )
        for row, most in self._rows:
            index = np.flatnonzero(row).astype(np.int32)
            solver.addRow(-highspy.kHighsInf, most, len(index), index, row[index])
        solver.run()
        assert solver.getModelStatus() == highspy.HighsModelStatus.kOptimal
        return -solver.getInfo().objective_function_value
