"""Random small problems of every mixture of the second edition's fields, as a client writes them."""

from __future__ import annotations

import random
from typing import Any

WORDS = ("cold", "winch", "night")
LEGS = ("open", "open", "zones", "wind", "zones and wind", "matrices")
OPTIONS = (
    "deadline", "earliest", "service_time", "target skills", "requested", "under way", "ret", "reserve",
    "endurance", "airborne", "available_from", "available_until", "excluded", "committed",
    "minimum_share", "half_life", "makespan_weight",
)  # fmt: skip
"""What a problem has or has not; what has it is drawn item by item."""


class Scene:
    """Draws one problem.

    Parameters
    ----------
    rng
        The only source of randomness.
    uavs, targets
        How many there are at most.
    planned
        Whether unloading is planned.
    """

    def __init__(self, rng: random.Random, uavs: int = 3, targets: int = 4, planned: bool = False) -> None:
        self._rng, self._planned = rng, planned
        self._m, self._n, self._k = rng.randint(1, uavs), rng.randint(2, targets), rng.randint(1, 2)
        self._globe = rng.random() < 0.33
        self._legs = rng.choice(LEGS)
        self._has = {option for option in OPTIONS if rng.random() < 0.3}
        # A degree of the globe is some hundred km; a problem is half a degree wide.
        self._length = 50.0 if self._globe else 1.0

    def problem(self) -> dict[str, Any]:
        """Return the problem."""
        problem: dict[str, Any] = {
            "crs": "wgs84" if self._globe else "local",
            "max_steps": self._rng.randint(1, 3),
            "targets": [self._target(j) for j in range(self._n)],
            "objective": self._objective(),
        }
        problem["uavs"] = [self._uav(i) for i in range(self._m)]
        if "wind" in self._legs:
            speed, towards = self._rng.uniform(0, 1.2) * self._length, self._rng.uniform(0, 360)
            problem["wind"] = {"speed": speed, "towards": towards}
        if "zones" in self._legs:
            count = self._rng.randint(1, 2)
            problem["no_fly_zones"] = [{"id": f"zone-{z}", "polygon": self._zone(z)} for z in range(count)]
        if self._legs == "matrices":
            self._add_matrices(problem)
        return problem

    def _some(self, option: str, share: float = 0.6) -> bool:
        return option in self._has and self._rng.random() < share

    def _point(self) -> tuple[float, float]:
        x, y = self._rng.random(), self._rng.random()
        return (10.0 + x / 2, 45.0 + y / 2) if self._globe else (x, y)

    def _target(self, j: int) -> dict[str, Any]:
        rng = self._rng
        x, y = self._point()
        needs = [rng.randint(0, 6) for _ in range(self._k)]
        target: dict[str, Any] = {"id": f"area-{j}", "x": x, "y": y, "level": 0.3 + 2 * rng.random()}
        target["loadlist"] = needs
        if self._some("deadline"):
            target["deadline"] = rng.uniform(0.2, 3)
        if self._some("earliest"):
            target["earliest"] = rng.uniform(0, 1.5)
        if self._some("service_time"):
            target["service_time"] = rng.uniform(0, 0.3)
        if self._some("target skills", 0.5):
            target["skills"] = rng.sample(WORDS, rng.randint(0, 2))
        if "requested" in self._has:
            target["requested"] = [need + rng.randint(0, 4) for need in needs]
        return target

    def _uav(self, i: int) -> dict[str, Any]:
        rng, length = self._rng, self._length
        x, y = self._point()
        uav: dict[str, Any] = {"id": f"uav-{i}", "x_s": x, "y_s": y}
        uav |= {"speed": rng.uniform(0.5, 2) * length, "voyage": rng.uniform(1, 5) * length}
        uav["loadlist"] = [rng.randint(1, 8) for _ in range(self._k)]
        uav["skills"] = rng.sample(WORDS, rng.randint(0, 3))
        if self._some("under way"):
            uav["x_c"], uav["y_c"] = self._point()
            uav["dis"] = rng.uniform(0, 0.5) * length
        if self._some("ret", 0.3):
            uav["ret"] = 1
        if "reserve" in self._has:
            uav["reserve"] = rng.uniform(0, 0.5)
        for option, low, high in (
            ("endurance", 0.5, 3),
            ("airborne", 0, 0.5),
            ("available_from", 0, 1),
            ("available_until", 0.5, 4),
        ):
            if self._some(option, 0.8):
                uav[option] = rng.uniform(low, high)
        ids = [f"area-{j}" for j in range(self._n)]
        rng.shuffle(ids)
        if self._some("excluded"):
            uav["excluded"] = ids[:1]
        if self._some("committed"):
            uav["committed"] = ids[1 : 1 + rng.randint(1, 2)]
        return uav

    def _objective(self) -> dict[str, Any]:
        rng = self._rng
        objective: dict[str, Any] = {
            "distance_weight": rng.choice([0, None, 0.1, 0.3]),
            "return_to_base": rng.random() < 0.7,
            "charge_return": rng.random() < 0.4,
        }
        if objective["distance_weight"]:
            objective["distance_weight"] /= self._length
        if "minimum_share" in self._has:
            objective |= {"minimum_share": rng.random(), "minimum_weight": 1 + 2 * rng.random()}
        if self._planned:
            objective["unloading"] = "planned"
        elif "half_life" in self._has:
            objective["half_life"] = rng.uniform(0.3, 4)
        if "makespan_weight" in self._has:
            objective["makespan_weight"] = rng.uniform(0, 0.4)
        return objective

    def _zone(self, number: int) -> list[list[float]]:
        """A triangle or a rectangle; the two of a problem do not touch."""
        rng = self._rng
        left, low = 0.1 + 0.5 * number, rng.uniform(0.1, 0.5)
        right, high = left + rng.uniform(0.1, 0.3), low + rng.uniform(0.1, 0.4)
        corners = [(left, low), (right, low), (right, high), (left, high)]
        if rng.random() < 0.5:
            corners[2:] = [(left + 0.7 * (right - left), high)]
        return [[10.0 + x / 2, 45.0 + y / 2] if self._globe else [x, y] for x, y in corners]

    def _add_matrices(self, problem: dict[str, Any]) -> None:
        rng, size = self._rng, self._n + self._m + 2
        names = ["multirotor", "fixed-wing"][: rng.randint(1, 2)]
        problem["matrices"] = {}
        for name in names:
            distance = [
                [None if rng.random() < 0.08 else rng.uniform(0.05, 1.5) * self._length for _ in range(size)]
                for _ in range(size)
            ]
            problem["matrices"][name] = {"distance": distance}
            if rng.random() < 0.5:
                problem["matrices"][name]["duration"] = [
                    [None if d is None else d / self._length * rng.uniform(0.3, 2) for d in row]
                    for row in distance
                ]
        for j, target in enumerate(problem["targets"]):
            target["location"] = j
        for i, uav in enumerate(problem["uavs"]):
            uav["location"] = self._n + i
            if len(names) > 1 or rng.random() < 0.3:
                uav["profile"] = rng.choice(names)
            if rng.random() < 0.4:
                uav["home_location"] = rng.randrange(size)
