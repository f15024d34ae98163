"""The tables of fields in the reference, written from the declaration.

``python -m app.domain.reference`` writes them anew between their marks in ``README.md`` of this folder, which
is the reference. A test compares the two.
"""

from __future__ import annotations

import json
import re
from dataclasses import MISSING
from pathlib import Path
from typing import Any

from app.domain.fields import (
    MAX_MAGNITUDE,
    Amounts,
    DeclaredField,
    Identifier,
    Items,
    Number,
    Part,
    Whole,
    declared_fields,
)
from app.domain.matrices import Matrix
from app.domain.problem import UAV, Objective, Problem, Target
from app.domain.surroundings import Base, Material, NoFlyZone, Wind
from app.domain.world_fields import FEWEST_CORNERS, Corners, Table

PAGE = Path(__file__).with_name("README.md")

_DECLARED: dict[str, type] = {
    each.__name__: each for each in (UAV, Target, Problem, Objective, Material, Base, NoFlyZone, Wind, Matrix)
}
_HEAD = ("field", "meaning", "unit", "limits", "default")
_TABLE = re.compile(r"(?<=<!-- fields of )(\w+)( -->\n).*?(?=<!-- end of fields -->)", re.DOTALL)


def with_tables(page: str) -> str:
    """Return a page with the tables between its marks as the declaration has them."""
    return _TABLE.sub(lambda mark: f"{mark[1]}{mark[2]}\n{table_of(_DECLARED[mark[1]])}\n", page)


def table_of(of: type) -> str:
    """Write the table of a dataclass with declared fields: a line a field, in Markdown."""
    rows = [_row(each) for each in declared_fields(of)]
    lines = [_HEAD, ("---",) * len(_HEAD), *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def _row(field: DeclaredField) -> tuple[str, ...]:
    unit = getattr(field.kind, "unit", None)
    unit_text = "" if unit is None else str(unit)
    return f"`{field.name}`", field.sentence, unit_text, _limits(field), _default(field)


def _limits(field: DeclaredField) -> str:
    kind = field.kind
    if isinstance(kind, Number | Whole):
        if kind.low == -MAX_MAGNITUDE:
            return ""
        below = "below " if isinstance(kind, Number) and kind.below else ""
        return f"from {kind.low:g}" if kind.high == MAX_MAGNITUDE else f"{kind.low:g} to {below}{kind.high:g}"
    if isinstance(kind, Amounts | Table):
        return "each from 0"
    if isinstance(kind, Corners):
        return f"at least {FEWEST_CORNERS} corners"
    if isinstance(kind, Items):
        return f"at least {kind.least}" if kind.least else ""
    return ""


def _default(field: DeclaredField) -> str:
    kind, same_as = field.kind, getattr(field.kind, "same_as", None)
    if isinstance(kind, Identifier):
        return f"`{kind.by_place(1)}`, `{kind.by_place(2)}`, …"
    if same_as is not None:
        return f"its `{same_as}`"
    if field.default is MISSING:
        return "required"
    if isinstance(kind, Part) and not field.optional and not isinstance(kind, Items):
        return "its defaults"
    return f"`{_written(kind.to_record(field.default))}`"


def _written(value: Any) -> str:
    if isinstance(value, str):
        return value
    return f"{value:g}" if type(value) in (int, float) else json.dumps(value)


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
