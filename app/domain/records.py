"""Problems as plain JSON-ready records and back: how they are stored and sent between processes.

A record is complete: every default has been filled in, so that it means the same in a later version.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

from app.domain.problem import UAV, Objective, Problem, Target


def problem_to_record(problem: Problem) -> dict[str, Any]:
    """Turn a problem into a record, with the field names of the specification."""
    record: dict[str, Any] = to_record(problem)
    for uav in record["uavs"]:
        uav["ret"] = int(uav["ret"])
    return record


def to_record(value: Any) -> Any:
    """Turn a dataclass, and what it holds, into dictionaries, lists and plain values.

    What :func:`dataclasses.asdict` does, without copying what cannot change: a fraction of its time, which
    counts for problems and plans of a thousand UAVs.
    """
    if value is None or isinstance(value, float | int | str):
        return value
    if isinstance(value, tuple | list):
        flat = not value or isinstance(value[0], float | int | str)
        return list(value) if flat else [to_record(each) for each in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {name: to_record(getattr(value, name)) for name in _names(type(value))}
    return value


@cache
def _names(of: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(of))


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
