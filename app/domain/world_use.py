"""What a problem uses of the world beyond places, loads and deadlines.

Fields that came later than the first edition leave no trace where they have their defaults: neither in
records (:class:`app.domain.fields.AlwaysRecorded`) nor, by what is said here, in answers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from app.domain.errors import InvalidProblem, Violation
from app.domain.fields import Items, Part, declared_fields
from app.domain.problem import Problem

_SAYS_NOTHING = frozenset({"name", "properties", "materials"})
"""Fields that change what things are called, and nothing that a plan does."""


class UsedField(NamedTuple):
    """A field that has another value than its default.

    Attributes
    ----------
    name
        As the specification writes it: ``no_fly_zones``, ``uavs.endurance``, ``objective.half_life``.
    pointer
        JSON pointer to the first place where it is used.
    """

    name: str
    pointer: str


def uses_world(problem: Problem) -> bool:
    """Return whether any field of the second edition is used, other than names, properties and materials."""
    return next(used_fields(problem), None) is not None


def used_fields(problem: Problem) -> Iterator[UsedField]:
    """Yield the fields of the second edition that are used, other than names, properties and materials."""
    return _used([""], [problem], Problem, "")


def later_fields() -> Iterator[str]:
    """Yield the names of all that :func:`used_fields` could yield."""
    return _later(Problem, "")


def require_unused(problem: Problem, reasons: Mapping[str, str]) -> None:
    """Refuse a problem that uses a field of the second edition that something cannot take.

    Parameters
    ----------
    problem
        The problem.
    reasons
        Why not, by names as :class:`UsedField` has them.

    Raises
    ------
    InvalidProblem
        With a violation for every such field, at the first place where it is used.
    """
    violations = [
        Violation(used.pointer, reasons[used.name]) for used in used_fields(problem) if used.name in reasons
    ]
    if violations:
        raise InvalidProblem.of(violations)


def _used(pointers: Sequence[str], items: Sequence[Any], of: type, prefix: str) -> Iterator[UsedField]:
    for each in declared_fields(of):
        if each.name in _SAYS_NOTHING:
            continue
        values = [getattr(item, each.name) for item in items]
        if not each.always_recorded:
            default = each.default
            for at, value in enumerate(values):
                if value is not default and (default is None or value != default):
                    yield UsedField(prefix + each.name, f"{pointers[at]}/{each.name}")
                    break
        elif isinstance(each.kind, Part):
            places: list[str] = []
            parts: list[Any] = []
            for pointer, value in zip(pointers, values, strict=True):
                listed = isinstance(each.kind, Items)
                parts += value if listed else [value]
                at_list = f"{pointer}/{each.name}"
                places += [f"{at_list}/{i}" for i in range(len(value))] if listed else [at_list]
            yield from _used(places, parts, each.kind.of, f"{prefix}{each.name}.")


def _later(of: type, prefix: str) -> Iterator[str]:
    for each in declared_fields(of):
        if each.name in _SAYS_NOTHING:
            continue
        if not each.always_recorded:
            yield prefix + each.name
        elif isinstance(each.kind, Part):
            yield from _later(each.kind.of, f"{prefix}{each.name}.")
