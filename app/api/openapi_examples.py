"""Example bodies of the OpenAPI page: those of allocations can be sent as they are."""

from __future__ import annotations

import json
from importlib import resources
from typing import Any

from fastapi.openapi.models import Example

from app.solvers.registry import ALGORITHMS

_FOLDER = resources.files("app.examples")
_SUFFIX = ".json"

_SHORT_PARAMETERS: dict[str, dict[str, Any]] = {"qmix": {"n_epochs": 2000}, "dqn": {"n_epochs": 2000}}
"""What takes minutes by the paper's numbers is shortened."""

_SMALL_TASK: dict[str, Any] = {
    "uavs": [
        {"x_s": 0.1, "y_s": 0.2, "speed": 1.0, "voyage": 3.0, "loadlist": [5, 2]},
        {"x_s": 0.8, "y_s": 0.4, "speed": 1.2, "voyage": 2.5, "loadlist": [3, 6]},
    ],
    "targets": [
        {"x": 0.3, "y": 0.9, "level": 1.0, "loadlist": [2, 1]},
        {"x": 0.6, "y": 0.1, "level": 0.4, "loadlist": [1, 3]},
        {"x": 0.9, "y": 0.7, "level": 0.8, "loadlist": [4, 2]},
    ],
    "objective": {"distance_weight": 1.0},
}


EVALUATION_EXAMPLES: dict[str, Example] = {
    "own": Example(
        summary="A plan of one's own, and what remains of the problem after a while",
        value={**_SMALL_TASK, "assignment": [[0, 2], [1, 3]], "at": 0.5},
    )
}


BATCH_EXAMPLES: dict[str, Example] = {
    "two": Example(
        summary="Two small problems",
        value={
            "problems": [
                {"id": "monday", **_SMALL_TASK, "algorithm": "greedy"},
                {"id": "tuesday", **_SMALL_TASK, "algorithm": "local_search", "time_limit_s": 0.5},
            ]
        },
    )
}


def example_names() -> list[str]:
    """List the shipped example problems."""
    return sorted(
        file.name.removesuffix(_SUFFIX) for file in _FOLDER.iterdir() if file.name.endswith(_SUFFIX)
    )


def example_problem(name: str) -> dict[str, Any]:
    """Read a shipped example problem, one of :func:`example_names`."""
    problem: dict[str, Any] = json.loads((_FOLDER / f"{name}{_SUFFIX}").read_text("utf-8"))
    return problem


def _allocation_example(name: str) -> dict[str, Any]:
    # DQN's table has a column for every joint action, so it takes small problems only.
    problem = _SMALL_TASK if name == "dqn" else example_problem("paper-5x10")
    parameters = _SHORT_PARAMETERS.get(name)
    return {"algorithm": name, **({"parameters": parameters} if parameters else {}), **problem}


def _mid_mission() -> dict[str, Any]:
    """A swarm on its way: one UAV between two areas, one that is returning, and what is left of the needs."""
    first, second = _SMALL_TASK["uavs"]
    on_its_way = {**first, "x_c": 0.3, "y_c": 0.9, "dis": 0.73, "loadlist": [3, 1]}
    left = [{"x": 0.6, "y": 0.1, "level": 0.4, "loadlist": [1, 3]}, *_SMALL_TASK["targets"][2:]]
    return {**_SMALL_TASK, "uavs": [on_its_way, {**second, "ret": 1}], "targets": left, "algorithm": "auto"}


ALLOCATION_EXAMPLES: dict[str, Example] = {
    "cyclone-idai": Example(
        summary="A real case: what Cyclone Idai left to be done around Beira, answered within two seconds",
        value={**example_problem("cyclone-idai"), "algorithm": "auto", "time_limit_s": 2},
    ),
    "cyclone-freddy": Example(
        summary="No-fly zones, wind and opening hours: towns of southern Malawi after Cyclone Freddy",
        value={**example_problem("cyclone-freddy"), "algorithm": "auto", "time_limit_s": 2},
    ),
    "rwanda-floods": Example(
        summary="A base with stock and turnaround, several flights a UAV: hospitals after floods in Rwanda",
        value={**example_problem("rwanda-floods"), "algorithm": "auto", "time_limit_s": 2},
    ),
    "planned-unloading": Example(
        summary="How much a visit unloads is decided with the plan; with a bound on what any plan earns",
        value={
            **_SMALL_TASK,
            "objective": {"unloading": "planned", "distance_weight": 1.0},
            "algorithm": "auto",
            "time_limit_s": 1,
            "bound": True,
        },
    ),
    "planned-loading": Example(
        summary="Empty UAVs at a base: what each flight carries, by weight, is decided with the plan",
        value={
            **_SMALL_TASK,
            "uavs": [
                {"x_s": 0.5, "y_s": 0.5, "speed": 1.0, "voyage": 2.0, "loadlist": [0, 0], "capacity": 4.0},
                {"x_s": 0.5, "y_s": 0.5, "speed": 1.2, "voyage": 2.0, "loadlist": [0, 0], "capacity": 3.0},
            ],
            "bases": [{"x": 0.5, "y": 0.5, "stock": [20, 30], "turnaround": 0.1}],
            "materials": [{"name": "water", "weight": 1.0}, {"name": "medicine", "weight": 0.25}],
            "max_steps": 8,
            "objective": {"unloading": "planned", "loading": "planned", "distance_weight": 0.2},
            "algorithm": "auto",
            "time_limit_s": 1,
        },
    ),
    "mid-mission": Example(summary="A swarm that is on its way already", value=_mid_mission()),
    **{
        algorithm.name: Example(summary=algorithm.summary, value=_allocation_example(algorithm.name))
        for algorithm in ALGORITHMS.values()
    },
}

MISSION_EXAMPLES: dict[str, Example] = {
    "proposed": Example(
        summary="A small problem, whose new plans are proposed",
        value={"name": "a small town", "problem": _SMALL_TASK, "time_limit_s": 0.5},
    )
}

EVENT_EXAMPLES: dict[str, Example] = {
    "telemetry": Example(
        summary="Where UAVs are",
        value={
            "type": "telemetry",
            "id": "seen-1",
            "positions": [{"uav_id": "uav-1", "time": 0.2, "x": 0.15, "y": 0.35, "dis": 0.16}],
        },
    ),
    "visit_done": Example(
        summary="A visit, with what was really unloaded",
        value={
            "type": "visit_done",
            "id": "visit-1",
            "at": 0.8,
            "uav_id": "uav-1",
            "target_id": "area-1",
            "delivered": [2, 0.5],
        },
    ),
    "areas_added": Example(
        summary="Another rescue area",
        value={
            "type": "areas_added",
            "id": "call-7",
            "at": 0.8,
            "targets": [{"id": "school", "x": 0.5, "y": 0.5, "level": 2, "loadlist": [1, 1]}],
        },
    ),
    "uav_lost": Example(
        summary="A UAV is lost", value={"type": "uav_lost", "id": "lost-2", "at": 1.1, "uav_id": "uav-2"}
    ),
    "proposal_accepted": Example(
        summary="A proposal becomes the plan in force",
        value={"type": "proposal_accepted", "id": "yes-3", "proposal": 3},
    ),
}

REGISTRATION_EXAMPLES: dict[str, Example] = {
    "train": Example(
        summary="Train a source policy and register it at the end",
        value={
            "name": "a small town",
            "task": _SMALL_TASK,
            "train": {"algorithm": "qmix", "parameters": {"n_epochs": 2000}, "seed": 123},
        },
    ),
    "job_id": Example(
        summary="Register what an earlier job has learned",
        value={"name": "yesterday's town", "job_id": "0123456789abcdef0123456789abcdef"},
    ),
    "checkpoint": Example(
        summary="Register weights that were trained elsewhere (shortened here)",
        value={
            "name": "a town elsewhere",
            "task": _SMALL_TASK,
            "checkpoint": "AgAAAAAAAAB7fQ==",
        },
    ),
}

SIMILAR_EXAMPLES: dict[str, Example] = {
    "paper": Example(
        summary="A task of the paper's size", value={"task": example_problem("paper-5x10"), "k": 5}
    )
}
