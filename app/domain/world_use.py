"""Whether a problem uses anything of the world beyond places, loads and deadlines.

Fields that came later than the first edition leave no trace where they have their defaults: neither in
records (:class:`app.domain.fields.AlwaysRecorded`) nor, by what is said here, in answers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from app.domain.fields import Part, declared_fields
from app.domain.problem import Problem

_SAYS_NOTHING = frozenset({"name", "properties", "materials"})
"""Fields that change what things are called, and nothing that a plan does."""


def uses_world(problem: Problem) -> bool:
    """Return whether any field of the second edition is used, other than names, properties and materials."""
    return _used([problem], Problem)


def _used(items: Sequence[Any], of: type) -> bool:
    for each in declared_fields(of):
        if each.name in _SAYS_NOTHING:
            continue
        values = [getattr(item, each.name) for item in items]
        if not each.always_recorded:
            default = each.default
            if any(value is not default and (default is None or value != default) for value in values):
                return True
        elif isinstance(each.kind, Part):
            parts = [part for value in values for part in (value if isinstance(value, tuple) else (value,))]
            if _used(parts, each.kind.of):
                return True
    return False
