"""Random days of missions: events that fit a state, and what has to hold after each; over JSON alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from referee import replay
from referee_legs import Legs


class Day:
    """Draws events that a mission takes.

    Parameters
    ----------
    rng
        Source of all randomness.
    pace
        Time between two events, in the mean.
    """

    def __init__(self, rng: np.random.Generator, pace: float) -> None:
        self._rng, self._pace = rng, pace
        self._added = 0

    def event(self, state: dict[str, Any], plan: dict[str, Any]) -> dict[str, Any]:
        """Return an event with its ``at``, which lies after the state's clock."""
        at = state["clock"] + float(self._rng.exponential(self._pace))
        problem = state["problem"]
        kinds = [self._clock, self._visit, self._visit, self._telemetry, self._area, self._change]
        kinds += [self._level, self._cancel, self._delay, self._world, self._uav]
        kind = kinds[int(self._rng.integers(len(kinds)))]
        event = kind(problem, state, plan, at)
        return {"at": at, **(event or {"type": "clock"})}

    def _pick(self, items: Any) -> Any:
        return items[int(self._rng.integers(len(items)))] if items else None

    def _clock(self, problem, state, plan, at):
        return {"type": "clock"}

    def _visit(self, problem, state, plan, at):
        """Report what was planned to be done, a little otherwise now and then."""
        open_ = [
            each for each in state["done"] if not each["reported"] and each["uav_id"] not in state["lost"]
        ]
        done = self._pick(open_)
        if done is None:
            return None
        uav = next(each for each in problem["uavs"] if each["id"] == done["uav_id"])
        if "base_id" in done:
            return {
                "type": "reload_done", "uav_id": done["uav_id"], "base_id": done["base_id"],
                "loadlist": list(uav["loadlist"]),
            }  # fmt: skip
        share = 1.0 if self._rng.random() < 0.6 else float(self._rng.uniform(0.0, 1.0))
        delivered = [share * amount for amount in done["amounts"]]
        return {
            "type": "visit_done", "uav_id": done["uav_id"], "target_id": done["target_id"],
            "delivered": delivered, "time": min(at, done["time"]),
        }  # fmt: skip

    def _telemetry(self, problem, state, plan, at):
        """Tell where some UAVs are: near to where they are thought to be."""
        positions = []
        for uav in problem["uavs"]:
            if self._rng.random() < 0.6:
                x, y = uav["x_c"], uav["y_c"]
                if self._rng.random() < 0.5 and problem.get("crs") != "wgs84":
                    x, y = x + float(self._rng.normal(0, 0.01)), y + float(self._rng.normal(0, 0.01))
                positions.append({"uav_id": uav["id"], "time": at, "x": x, "y": y})
        return {"type": "telemetry", "positions": positions} if positions else None

    def _area(self, problem, state, plan, at):
        if len(problem["targets"]) > 12:
            return None
        like = self._pick(problem["targets"])
        self._added += 1
        new = {
            **{name: like[name] for name in ("x", "y", "location") if name in like},
            "id": f"new-{self._added}",
            "level": float(self._rng.uniform(0.1, 2.0)),
            "loadlist": [float(amount) for amount in self._rng.integers(0, 4, len(like["loadlist"]))],
        }
        if self._rng.random() < 0.3:
            new["deadline"] = at + float(self._rng.exponential(8 * self._pace))
        return {"type": "areas_added", "targets": [new]}

    def _change(self, problem, state, plan, at):
        target = dict(self._pick(problem["targets"]))
        target["loadlist"] = [
            max(0.0, amount + float(self._rng.integers(-2, 3))) for amount in target["loadlist"]
        ]
        if self._rng.random() < 0.5:
            target["deadline"] = at + float(self._rng.exponential(10 * self._pace))
        target.pop("requested", None)
        return {"type": "areas_changed", "targets": [target]}

    def _level(self, problem, state, plan, at):
        target = self._pick(problem["targets"])
        return {
            "type": "level_changed", "target_id": target["id"],
            "level": float(target["level"] * self._rng.uniform(0.0, 3.0)),
        }  # fmt: skip

    def _cancel(self, problem, state, plan, at):
        known = [each["id"] for each in problem["targets"] if each["id"] not in state["cancelled"]]
        if len(known) < 3 or self._rng.random() < 0.5:
            return None
        return {"type": "area_cancelled", "target_id": self._pick(known)}

    def _delay(self, problem, state, plan, at):
        uav = self._pick([each for each in problem["uavs"] if each["id"] not in state["lost"]])
        if uav is None:
            return None
        until = at + float(self._rng.exponential(2 * self._pace)) + 1e-9
        return {"type": "uav_delayed", "uav_id": uav["id"], "until": until}

    def _world(self, problem, state, plan, at):
        bases = [each for each in problem.get("bases") or () if each.get("stock") is not None]
        if bases and self._rng.random() < 0.5:
            base = self._pick(bases)
            stock = [float(amount) for amount in self._rng.integers(0, 9, len(base["stock"]))]
            return {"type": "stock_changed", "base_id": base["id"], "stock": stock}
        if problem.get("crs") == "wgs84" or "location" in problem["uavs"][0]:
            return None
        if self._rng.random() < 0.5:
            slowest = min(uav["speed"] for uav in problem["uavs"])
            wind = {
                "speed": slowest * float(self._rng.uniform(0, 0.8)),
                "towards": float(self._rng.uniform(0, 360)),
            }
            return {"type": "wind_changed", "wind": wind if self._rng.random() < 0.7 else None}
        zones = problem.get("no_fly_zones") or []
        if zones and self._rng.random() < 0.5:
            return {"type": "zones_changed", "no_fly_zones": zones[1:]}
        target = self._pick(problem["targets"])
        x, y, size = target["x"] + 0.02, target["y"] + 0.02, 0.05
        turns = [2 * math.pi * k / 4 for k in range(4)]
        polygon = [[x + size * math.cos(a), y + size * math.sin(a)] for a in turns]
        zone = {"id": f"zone-new-{self._added}-{len(zones)}", "polygon": polygon}
        return {"type": "zones_changed", "no_fly_zones": [*zones[-2:], zone]}

    def _uav(self, problem, state, plan, at):
        active = [each for each in problem["uavs"] if each["id"] not in state["lost"]]
        if len(active) > 2 and self._rng.random() < 0.4:
            return {"type": "uav_lost", "uav_id": self._pick(active)["id"]}
        if len(problem["uavs"]) > 6:
            return None
        like = self._pick(problem["uavs"])
        self._added += 1
        taken = (
            "x_s",
            "y_s",
            "speed",
            "voyage",
            "loadlist",
            "location",
            "profile",
            "capacity",
            "skills",
            "endurance",
        )
        new = {name: like[name] for name in taken if name in like} | {"id": f"uav-new-{self._added}"}
        if like.get("home_location") is not None:
            new["location"] = like["home_location"]
        return {"type": "uavs_added", "uavs": [new]}


def require_sound(state: dict[str, Any], plan: dict[str, Any], matrices: Any = None) -> None:
    """Let the referee replay the plan in force for its moment, and compare what it earns.

    Raises
    ------
    referee.Illegal
        If it breaks a rule.
    """
    problem = {**state["problem"], "matrices": matrices} if matrices else state["problem"]
    assert plan["assignment"] == problem["start_plan"]
    problem = problem | {"no_fly_zones": [*map(_nearly, problem.get("no_fly_zones") or ())]}
    delivered, loaded = _amounts(problem, plan)
    objective = problem["objective"]
    planned = objective.get("unloading") == "planned"
    loading = objective.get("loading") == "planned"
    found = replay(
        problem,
        plan["assignment"],
        delivered if planned else None,
        Legs(problem),
        loaded if loading else None,
    )
    assert math.isclose(found["reward"], plan["reward"], rel_tol=1e-6, abs_tol=1e-6), (
        found["reward"],
        plan["reward"],
    )
    assert all(amount >= 0.0 for uav in problem["uavs"] for amount in uav["loadlist"])


def _nearly(zone):
    """A zone as it is but for rounding: who is on a way along its side is not inside."""
    corners = zone["polygon"]
    middle = [sum(each) / len(corners) for each in zip(*corners, strict=True)]
    return zone | {
        "polygon": [[m + (1 - 1e-9) * (c - m) for m, c in zip(middle, each, strict=True)] for each in corners]
    }


def _amounts(problem, plan):
    nothing = [0.0] * len(problem["uavs"][0]["loadlist"])
    shape = [[list(nothing) for _ in problem["uavs"]] for _ in plan["assignment"]]
    delivered, loaded = shape, [[list(nothing) for _ in row] for row in shape]
    for i, route in enumerate(plan["routes"]):
        for stop in route["stops"]:
            where = loaded if "base_id" in stop else delivered
            where[stop["step"] - 1][i] = stop["loaded" if "base_id" in stop else "delivered"]
    return delivered, loaded
