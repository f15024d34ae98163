"""A problem on the wire, and its conversion to the domain; the rules between fields are the domain's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from app.api.wire_fields import WireModel, from_wire, wire_model
from app.domain.errors import InvalidProblem, ProblemTooLarge, Violation
from app.domain.fields import Items, declared_fields
from app.domain.problem import Problem
from app.settings import Settings


class ProblemModel(wire_model(Problem), WireModel):  # type: ignore[misc]  # its fields are declared in the domain
    """A swarm, rescue areas, and what a plan is paid for."""

    @classmethod
    def require_sizes(cls, body: Mapping[str, Any], settings: Settings, at: str) -> None:
        """Refuse a problem that is too large before its items are looked at.

        Raises
        ------
        ProblemTooLarge
            As :func:`to_problem` does.
        """
        lists = {name: _items(body.get(name)) for name in _LISTS}
        first = lists["uavs"][0] if lists["uavs"] else None
        carried = _items(first.get("loadlist")) if isinstance(first, Mapping) else []
        _refuse_oversize(lists, len(carried), settings, at)


_LISTS = {each.name: each.kind for each in declared_fields(Problem) if isinstance(each.kind, Items)}
"""The kinds of the lists of a problem by their names."""


def largest(name: str, settings: Settings) -> int:
    """Return how many items a list of a problem may have here; the setting has the list's name."""
    limit: int = getattr(settings, f"max_{name}")
    return limit


def to_problem(body: ProblemModel, settings: Settings, at: str = "") -> Problem:
    """Convert a problem to the domain.

    Parameters
    ----------
    body
        The problem as it was sent.
    settings
        The sizes that are taken.
    at
        JSON pointer of the problem in the request's body.

    Raises
    ------
    ProblemTooLarge
        If it has more UAVs, targets or materials than are taken.
    InvalidProblem
        If it breaks a rule between fields. Pointers of both are into the request's body.
    """
    lists = {name: getattr(body, name) for name in _LISTS}
    _refuse_oversize(lists, len(body.uavs[0].loadlist), settings, at)
    try:
        problem: Problem = from_wire(body, Problem)
    except InvalidProblem as error:
        raise InvalidProblem.of([Violation(at + v.pointer, v.detail) for v in error.violations]) from None
    return problem


def _refuse_oversize(
    lists: Mapping[str, Sequence[Any]], n_materials: int, settings: Settings, at: str
) -> None:
    sizes = [
        (f"/{name}", kind.called, len(lists[name]), largest(name, settings)) for name, kind in _LISTS.items()
    ]
    # The first UAV says how many materials there are.
    sizes.append(("/uavs/0/loadlist", "materials", n_materials, settings.max_materials))
    violations = [
        Violation(at + pointer, f"{size} {what}, at most {limit} are taken")
        for pointer, what, size, limit in sizes
        if size > limit
    ]
    if violations:
        detail = "; ".join(violation.detail for violation in violations)
        raise ProblemTooLarge(detail, violations)


def _items(value: object) -> list[Any]:
    return value if isinstance(value, list) else []
