"""Problems as plain JSON-ready records and back: how they are stored and sent between processes.

A record is complete: every default has been filled in, so that it means the same in a later version.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from app.domain.problem import UAV, Objective, Problem, Target


def problem_to_record(problem: Problem) -> dict[str, Any]:
    """Turn a problem into a record, with the field names of the specification."""
    record = asdict(problem)
    for name in ("uavs", "targets"):
        record[name] = [{**item, "loadlist": list(item["loadlist"])} for item in record[name]]
    for uav in record["uavs"]:
        uav["ret"] = int(uav["ret"])
    return record


def problem_from_record(record: Mapping[str, Any]) -> Problem:
    """Turn a record into a problem.

    Raises
    ------
    InvalidProblem
        If the record breaks a rule of the problem.
    KeyError, TypeError
        If it is no record of :func:`problem_to_record`.
    """
    return Problem(
        uavs=tuple(
            UAV(**{**u, "ret": bool(u["ret"]), "loadlist": tuple(u["loadlist"])}) for u in record["uavs"]
        ),
        targets=tuple(Target(**{**t, "loadlist": tuple(t["loadlist"])}) for t in record["targets"]),
        max_steps=record["max_steps"],
        crs=record["crs"],
        objective=Objective(**record["objective"]),
    )
