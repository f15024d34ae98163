"""Holds reasons for unmet needs against the plan with every single additional visit.

It replays plans with the referee, and planned unloading as a linear program solved by HiGHS; it shares no
code with the product. Problems and answers are JSON-shaped.
"""

from __future__ import annotations

import copy

from brute_force_unloading import asked_by, best_satisfaction
from referee import TOLERANCE, Aircraft, Illegal, apart, replay, weight_of

CRUMB = 1e-9


def routes_of_plan(problem, assignment):
    """The targets of each UAV in order."""
    n = len(problem["targets"])
    return [[row[i] for row in assignment if row[i] < n] for i in range(len(problem["uavs"]))]


def earned(problem, routes):
    """Reward of the plan that flies these routes and leaves out what is not allowed.

    Under planned unloading, range and deadlines decide what is allowed.
    """
    if (problem.get("objective") or {}).get("unloading") == "planned":
        flown = [legal_by_reach(problem, i, route) for i, route in enumerate(routes)]
        weight = weight_of(problem)
        length = sum(length for _, length in flown)
        return best_satisfaction(problem, [tuple(route) for route, _ in flown]) - weight * length
    n, m = len(problem["targets"]), len(problem["uavs"])
    cursor, rows = [0] * m, []
    for _ in range(problem.get("max_steps", 5)):
        row = [n] * m
        for i in range(m):
            while row[i] == n and cursor[i] < len(routes[i]):
                row[i] = routes[i][cursor[i]]
                cursor[i] += 1
                try:
                    replay(problem, [*rows, row[: i + 1] + [n] * (m - i - 1)])
                except Illegal:
                    row[i] = n
        rows.append(row)
    return replay(problem, rows)["reward"]


def is_earned(problem, routes, reward, scale):
    """Whether routes earn this under planned unloading once some visits that unload nothing are left out."""
    if (problem.get("objective") or {}).get("unloading") != "planned":
        return False
    weight = weight_of(problem)
    flown = [legal_by_reach(problem, i, route)[0] for i, route in enumerate(routes)]
    whole = best_satisfaction(problem, [tuple(route) for route in flown])
    states, seen = [flown], set()
    while states:
        state = states.pop()
        length = sum(legal_by_reach(problem, i, route)[1] for i, route in enumerate(state))
        if abs(whole - weight * length - reward) <= 10 * scale:
            return True
        for i, route in enumerate(state):
            for s in range(len(route)):
                fewer = [*state[:i], [*route[:s], *route[s + 1 :]], *state[i + 1 :]]
                key = str(fewer)
                if key not in seen:
                    seen.add(key)
                    if best_satisfaction(problem, [tuple(r) for r in fewer]) >= whole - scale:
                        states.append(fewer)
    return False


def can_unload(problem, routes, i, j):
    """Whether a visit can unload something under planned unloading without any loss."""
    if (problem.get("objective") or {}).get("unloading") != "planned":
        return True
    flown = [tuple(legal_by_reach(problem, h, route)[0]) for h, route in enumerate(routes)]
    if j not in flown[i]:
        return False
    whole = best_satisfaction(problem, flown)
    per_unit = problem["targets"][j]["level"] / sum(asked_by(problem["targets"][j]))
    for k, (have, want) in enumerate(
        zip(problem["uavs"][i]["loadlist"], problem["targets"][j]["loadlist"], strict=True)
    ):
        little = 1e-3 * min(have, want)
        if little > 0:
            rest = copy.deepcopy(problem)
            rest["targets"][j]["requested"] = asked_by(problem["targets"][j])
            rest["uavs"][i]["loadlist"][k] -= little
            rest["targets"][j]["loadlist"][k] -= little
            if best_satisfaction(rest, flown) + per_unit * little >= whole - 1e-9 * max(1.0, whole):
                return True
    return False


def legal_by_reach(problem, i, route):
    """Visits of a route that range, deadlines and steps allow, and the length that is charged."""
    objective, crs = problem.get("objective") or {}, problem.get("crs", "local")
    craft, length, kept = Aircraft(problem["uavs"][i]), 0.0, []
    for j in route:
        if not may_fly(problem, craft, j) or len(kept) == problem.get("max_steps", 5):
            continue
        area = problem["targets"][j]
        leg = apart(crs, craft.place, (area["x"], area["y"]))
        craft.clock += leg / craft.speed + (area.get("service_time") or 0.0)
        craft.flown += leg
        craft.place = (area["x"], area["y"])
        length += leg
        kept.append(j)
    if objective.get("charge_return") and craft.out:
        length += apart(crs, craft.place, craft.home)
    return kept, length


def may_fly(problem, craft, j):
    """Whether range and deadline allow a visit."""
    objective, crs, area = problem.get("objective") or {}, problem.get("crs", "local"), problem["targets"][j]
    there = (area["x"], area["y"])
    leg = apart(crs, craft.place, there)
    back = apart(crs, there, craft.home) if objective.get("return_to_base", True) else 0.0
    latest = area.get("deadline")
    return (
        craft.out
        and craft.flown + leg + back <= craft.voyage * (1 + TOLERANCE)
        and (latest is None or craft.clock + leg / craft.speed <= latest + abs(latest) * TOLERANCE)
    )


def insertions(problem, routes, j):
    """Every single additional visit to a target: UAV, place, routes."""
    for i, uav in enumerate(problem["uavs"]):
        if uav.get("ret"):
            continue
        for place in range(len(routes[i]) + 1):
            changed = list(routes)
            changed[i] = [*routes[i][:place], j, *routes[i][place:]]
            yield i, place, changed


def relaxed(problem, unmet):
    """The problem with what the remedy of a reason allows."""
    easier, relaxation = copy.deepcopy(problem), unmet["relaxation"]
    if relaxation is None:
        return easier
    uav = next(uav for uav in easier["uavs"] if uav["id"] == unmet["uav_id"])
    uav["loadlist"] = [a + b for a, b in zip(uav["loadlist"], relaxation["more_load"], strict=True)]
    uav["voyage"] += relaxation["more_range"]
    easier["max_steps"] += relaxation["more_steps"]
    for later in relaxation["later_deadlines"]:
        area = next(area for area in easier["targets"] if area["id"] == later["target_id"])
        area["deadline"] += later["by"]
    easier["objective"] = {**(problem.get("objective") or {}), "distance_weight": weight_of(problem)}
    return easier


def with_visit(problem, routes, unmet):
    """Routes with the visit that a reason is about, or as they are where the plan has it already."""
    i = [uav["id"] for uav in problem["uavs"]].index(unmet["uav_id"])
    j = [area["id"] for area in problem["targets"]].index(unmet["target_id"])
    place, changed = unmet["step"] - 1, list(routes)
    there = place < len(routes[i]) and routes[i][place] == j
    if there and unmet["relaxation"] is not None and any(unmet["relaxation"]["more_load"]):
        return changed
    changed[i] = [*routes[i][:place], j, *routes[i][place:]]
    return changed


def could_come(problem, unmet, j):
    """UAVs that carry, at first, something still needed, and could be there directly in range and time."""
    return [
        i
        for i, uav in enumerate(problem["uavs"])
        if may_fly(problem, Aircraft(uav), j)
        and any(a > 0 and b > 0 for a, b in zip(uav["loadlist"], unmet["remaining"], strict=True))
    ]


def left_over(problem, answer, i):
    """What a UAV still carries at the end."""
    hold = list(problem["uavs"][i]["loadlist"])
    for stop in answer["routes"][i]["stops"]:
        hold = [a - b for a, b in zip(hold, stop["delivered"], strict=True)]
    return [a if a > CRUMB * b else 0.0 for a, b in zip(hold, problem["uavs"][i]["loadlist"], strict=True)]


def objections(problem, answer, unmet):
    """Everything that contradicts a reason, in words."""
    found = []
    routes = routes_of_plan(problem, answer["assignment"])
    reward = earned(problem, routes)
    j = [area["id"] for area in problem["targets"]].index(unmet["target_id"])
    code, change = unmet["code"], unmet["reward_change"]
    scale = max(1.0, abs(reward)) * 1e-9
    if abs(reward - answer["reward"]) > 1e-9 * max(1.0, abs(reward)):
        found.append(f"the plan earns {reward}")
    if code == "not_chosen" and unmet["verified"] and not change > 0:
        found.append("not chosen, and earns nothing")
    soft = code in ("not_worth_it", "loads_used", "range_used", "time_used", "step_limit")
    if unmet["verified"] and soft:
        for i, place, changed in insertions(problem, routes, j):
            gain = earned(problem, changed) - reward
            if gain > 10 * scale and can_unload(problem, changed, i, j):
                found.append(f"uav {i} place {place} gains {gain}")
    comers = could_come(problem, unmet, j)
    useful = [
        i
        for i in comers
        if any(
            a > 0 and b > 0 for a, b in zip(left_over(problem, answer, i), unmet["remaining"], strict=True)
        )
    ]
    if code == "loads_used" and unmet["verified"] and useful:
        found.append(f"something useful is left over at {useful}")
    carriers = [
        uav
        for uav in problem["uavs"]
        if not uav.get("ret")
        and any(a > 0 and b > 0 for a, b in zip(uav["loadlist"], unmet["remaining"], strict=True))
    ]
    if (code == "no_supply") != (not carriers):
        found.append(f"{len(carriers)} carry it")
    hard = code in ("no_supply", "out_of_range", "deadline")
    if hard != (not comers):
        found.append(f"{comers} could come")
    if unmet["remedy"] is not None or (unmet["verified"] and change is not None):
        easier = relaxed(problem, unmet)
        changed = with_visit(problem, routes, unmet)
        after = earned(easier, changed)
        if abs(after - reward - change) > 10 * scale and not is_earned(
            easier, changed, reward + change, scale
        ):
            found.append(f"the change is {after - reward}, not {change}")
    if code in ("range_used", "time_used", "step_limit") and not (
        unmet["verified"] and change > 0 and unmet["remedy"]
    ):
        found.append("no remedy")
    return found
