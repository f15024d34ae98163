"""The tables of features in ``ON_BOARD.md``, written from the declaration.

``python -m app.learning.pairwise.reference`` writes them anew between their marks. A test compares the two.
"""

from __future__ import annotations

import re
from pathlib import Path

from app.learning.pairwise.features import (
    AreaFeature,
    BaseFeature,
    ReloadFeature,
    UavFeature,
    VisitFeature,
)

PAGE = Path(__file__).parent.with_name("ON_BOARD.md")

_KINDS = {each.__name__: each for each in (UavFeature, AreaFeature, BaseFeature, VisitFeature, ReloadFeature)}
_TABLE = re.compile(r"(?<=<!-- features of )(\w+)( -->\n).*?(?=<!-- end of features -->)", re.DOTALL)


def with_tables(page: str) -> str:
    """Return a page with the tables between its marks as the declaration has them."""
    return _TABLE.sub(lambda mark: f"{mark[1]}{mark[2]}\n{table_of(mark[1])}\n", page)


def table_of(kind: str) -> str:
    """Write the table of a kind of features, by its name: a line a column, in Markdown."""
    rows = [(str(int(each)), f"`{each.name.lower()}`", each.meaning) for each in _KINDS[kind]]
    lines = [("column", "name", "meaning"), ("---",) * 3, *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
