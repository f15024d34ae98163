"""The best plan of a tiny problem when unloading is planned, by trying every choice of routes.

What the visits of given routes unload is a linear program, solved by HiGHS. Shares no code with solvers.
"""

from itertools import permutations, product

import highspy
import numpy as np
from referee import TOLERANCE, Aircraft, apart, weight_of


def best_planned_reward(problem: dict) -> float:
    """Largest reward of any choice of routes, with the best amounts for it."""
    options = [routes_of(problem, record) for record in problem["uavs"]]
    weight = weight_of(problem)
    return max(
        best_satisfaction(problem, [visited for visited, _ in choice])
        - weight * sum(length for _, length in choice)
        for choice in product(*options)
    )


def routes_of(problem: dict, record: dict) -> list[tuple[tuple[int, ...], float]]:
    """What one UAV can visit, each set with the length of its shortest legal order."""
    crs, objective = problem.get("crs", "local"), problem.get("objective") or {}
    charged = objective.get("charge_return", False)
    shortest = {}
    areas = problem["targets"]
    idle = Aircraft(record)
    shortest[()] = apart(crs, idle.place, idle.home) if charged and idle.out else 0.0
    for length in range(1, min(len(areas), problem.get("max_steps", 5)) + 1 if idle.out else 1):
        for order in permutations(range(len(areas)), length):
            flown = fly(problem, record, order)
            if flown is not None:
                key = tuple(sorted(order))
                shortest[key] = min(flown, shortest.get(key, np.inf))
    return list(shortest.items())


def fly(problem: dict, record: dict, order: tuple[int, ...]) -> float | None:
    """Length that counts of a route; None where range or deadlines forbid it."""
    crs, objective = problem.get("crs", "local"), problem.get("objective") or {}
    craft, length = Aircraft(record), 0.0
    for j in order:
        area = problem["targets"][j]
        there = (area["x"], area["y"])
        leg = apart(crs, craft.place, there)
        back = apart(crs, there, craft.home) if objective.get("return_to_base", True) else 0.0
        if craft.flown + leg + back > craft.voyage * (1 + TOLERANCE):
            return None
        arrival, latest = craft.clock + leg / craft.speed, area.get("deadline")
        if latest is not None and arrival > latest + abs(latest) * TOLERANCE:
            return None
        craft.clock = arrival + (area.get("service_time") or 0.0)
        craft.flown += leg
        craft.place = there
        length += leg
    return length + (apart(crs, craft.place, craft.home) if objective.get("charge_return") else 0.0)


def asked_by(area: dict) -> list[float]:
    """What an area requested at first."""
    return area["loadlist"] if area.get("requested") is None else area["requested"]


def best_satisfaction(problem: dict, visited: list[tuple[int, ...]]) -> float:
    """The linear program: amounts of each visit, within loads and needs."""
    areas = problem["targets"]
    needs = [area["loadlist"] for area in areas]
    variables = [
        (i, j, k)
        for i, record in enumerate(problem["uavs"])
        for j in visited[i]
        for k, (have, want) in enumerate(zip(record["loadlist"], needs[j], strict=True))
        if have > 0 and want > 0 and areas[j]["level"] > 0
    ]
    if not variables:
        return 0.0
    program = highspy.Highs()
    program.setOptionValue("output_flag", False)
    none = (np.empty(0, np.int32), np.empty(0))
    for i, j, k in variables:
        worth = areas[j]["level"] / sum(asked_by(areas[j]))
        most = min(problem["uavs"][i]["loadlist"][k], needs[j][k])
        program.addCol(-worth, 0.0, most, 0, *none)

    def limit(columns: list[int], most: float) -> None:
        index = np.array(columns, np.int32)
        program.addRow(-highspy.kHighsInf, most, len(index), index, np.ones(len(index)))

    for i, k in {(i, k) for i, _, k in variables}:
        limit(
            [c for c, v in enumerate(variables) if v[0] == i and v[2] == k], problem["uavs"][i]["loadlist"][k]
        )
    for j, k in {(j, k) for _, j, k in variables}:
        limit([c for c, v in enumerate(variables) if v[1:] == (j, k)], needs[j][k])
    program.run()
    assert program.getModelStatus() == highspy.HighsModelStatus.kOptimal
    return -program.getInfo().objective_function_value
