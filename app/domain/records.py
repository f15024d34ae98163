"""Problems as plain JSON-ready records and back: how they are stored and sent between processes.

A record is complete: every default has been filled in, so that it means the same in a later version.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from operator import attrgetter
from typing import Any

from app.domain.problem import UAV, Objective, Problem, Target

_UAV = tuple(field.name for field in fields(UAV))
_TARGET = tuple(field.name for field in fields(Target))
_PLAIN = (float, int, str, bool)
_uav_values, _target_values = attrgetter(*_UAV), attrgetter(*_TARGET)


def problem_to_record(problem: Problem) -> dict[str, Any]:
    """Turn a problem into a record, with the field names of the specification."""
    return {
        "uavs": [
            dict(zip(_UAV, _uav_values(uav), strict=True), ret=int(uav.ret), loadlist=list(uav.loadlist))
            for uav in problem.uavs
        ],
        "targets": [
            dict(
                zip(_TARGET, _target_values(target), strict=True),
                loadlist=list(target.loadlist),
                requested=None if target.requested is None else list(target.requested),
            )
            for target in problem.targets
        ],
        "max_steps": problem.max_steps,
        "crs": problem.crs,
        "objective": to_record(problem.objective),
    }


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
        names, values_of = _fields(type(value))
        return {
            name: each if each is None or type(each) in _PLAIN else to_record(each)
            for name, each in zip(names, values_of(value), strict=True)
        }
    return value


@cache
def _fields(of: type) -> tuple[tuple[str, ...], Callable[[Any], tuple[Any, ...]]]:
    """Return the names of a dataclass's fields, and what gets all their values at once."""
    names = tuple(field.name for field in fields(of))
    if len(names) == 1:
        return names, lambda value: (getattr(value, names[0]),)
    return names, attrgetter(*names)


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
        targets=tuple(_target(t) for t in record["targets"]),
        max_steps=record["max_steps"],
        crs=record["crs"],
        objective=Objective(**record["objective"]),
    )


def _target(record: Mapping[str, Any]) -> Target:
    # Records from before targets had `requested` lack it.
    requested = record.get("requested")
    return Target(
        **{
            **record,
            "loadlist": tuple(record["loadlist"]),
            "requested": None if requested is None else tuple(requested),
        }
    )
