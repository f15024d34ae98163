"""Kinds of fields of the world around a flight: corners of a zone, a plan to begin from, a table of legs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from app.domain.errors import Violation
from app.domain.fields import (
    MAX_MAGNITUDE,
    MIN_MAGNITUDE,
    Context,
    Conversion,
    Coordinate,
    Kind,
    out_of_limits,
    too_few,
)
from app.domain.said import said
from app.domain.units import X, Y

FEWEST_CORNERS = 3
"""Of a polygon."""

_AXES = (Coordinate(axis=X), Coordinate(axis=Y))


@dataclass(frozen=True)
class Corners(Kind):
    """The corners of a polygon in either direction, each a pair of coordinates."""

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:
        """Yield that they are too few, and what is wrong with their coordinates."""
        if len(value) < FEWEST_CORNERS:
            yield Violation(
                pointer,
                said("{count} corners; at least {least} are needed", count=len(value), least=FEWEST_CORNERS),
            )
        for index, corner in enumerate(value):
            if len(corner) != len(_AXES):
                yield Violation(
                    f"{pointer}/{index}", said("{count} numbers; a corner has 2, x and y", count=len(corner))
                )
                continue
            for at, (axis, number) in enumerate(zip(_AXES, corner, strict=True)):
                yield from axis.violations(f"{pointer}/{index}/{at}", number, context)

    @property
    def conversions(self) -> tuple[Conversion, Conversion] | None:
        """Return what makes a list of lists of the corners, and corners of it."""
        return _lists, _tuples


@dataclass(frozen=True)
class JointActions(Kind):
    """A plan: joint actions, one a step; whether they fit the problem is a rule between fields."""

    @property
    def conversions(self) -> tuple[Conversion, Conversion] | None:
        """Return what makes a list of lists of the actions, and actions of it."""
        return _lists, _tuples


@dataclass(frozen=True)
class Table(Kind):
    """A square table of numbers, none below 0; infinite where there is none.

    What is no such table is a sequence of rows as it was given.
    """

    def limits(self, context: Context) -> tuple[float, float]:  # noqa: ARG002 - as those of numbers
        """Return the smallest and the largest number that is allowed."""
        return 0.0, MAX_MAGNITUDE

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:
        """Yield what is wrong with its shape, or with its entries."""
        low, high = self.limits(context)
        if not isinstance(value, np.ndarray) or value.ndim != 2 or value.shape[0] != value.shape[1]:
            yield from _misshapen(pointer, value)
            return
        wrong = ~((value >= low) & ((value <= high) | np.isposinf(value)))
        for row, column in np.argwhere(wrong).tolist():
            yield from out_of_limits(f"{pointer}/{row}/{column}", float(value[row, column]), low, high)

    @property
    def conversions(self) -> tuple[Conversion, Conversion] | None:
        """Return what makes rows of it, None where there is no number; rows are read as a table later."""
        return _rows, lambda rows: rows


def table_of(rows: Any) -> Any:
    """Make a table that cannot be changed of rows, None or infinite where there is no number.

    Returns
    -------
    ndarray
        Of float64, or the rows as they are where they are no table.
    """
    try:
        table = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError):
        return rows
    if table.ndim != 2 or not table.size:
        return rows
    # A number that is missing is NaN by now.
    table[np.isnan(table)] = np.inf
    table[np.abs(table) < MIN_MAGNITUDE] = 0.0
    table.flags.writeable = False
    return table


def _misshapen(pointer: str, rows: Any) -> Iterator[Violation]:
    """Yield the rows that are not as long as there are rows, and entries that are no numbers."""
    if not _is_sequence(rows) or not len(rows):
        none = too_few(0, "rows", 1)
        yield Violation(pointer, none if _is_sequence(rows) else said("is no list of rows"))
        return
    for index, row in enumerate(rows):
        if not _is_sequence(row):
            yield Violation(f"{pointer}/{index}", said("is no list of numbers"))
        elif len(row) != len(rows):
            yield Violation(
                f"{pointer}/{index}",
                said("{count} entries, but there are {rows} rows", count=len(row), rows=len(rows)),
            )
        else:
            for column, entry in enumerate(row):
                if not isinstance(entry, float | int | None):
                    yield Violation(
                        f"{pointer}/{index}/{column}", said("{entry} is no number", entry=repr(entry))
                    )


def _is_sequence(value: Any) -> bool:
    return hasattr(value, "__len__") and hasattr(value, "__iter__") and not isinstance(value, str)


def _rows(table: npt.NDArray[np.float64]) -> list[list[float | None]]:
    rows: list[list[float | None]] = table.tolist()
    for row, column in np.argwhere(np.isinf(table)).tolist():
        rows[row][column] = None
    return rows


def _lists(rows: Any) -> list[list[Any]]:
    return list(map(list, rows))


def _tuples(rows: Any) -> tuple[tuple[Any, ...], ...]:
    return tuple(map(tuple, rows))
