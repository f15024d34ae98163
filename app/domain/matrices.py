"""Legs that a client gives as tables: of roads, of a planner of its own, of measured flights."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import numpy.typing as npt

from app.domain.world_fields import Table, table_of

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Matrix:
    """The legs of one profile, from each of R locations to each other.

    Built of rows of numbers; None, NaN and infinity say that there is no such leg.

    Attributes
    ----------
    distance
        (R, R) length from a row's location to a column's; infinite where there is no leg. Not writeable.
    duration
        (R, R) time, infinite where there is no leg; None where it follows from the speed. Not writeable.
    """

    distance: Annotated[
        Floats,
        Table(),
        "Rows of lengths, from a row's location to a column's; it need not be symmetric. null: there is no "
        "such leg",
    ]
    duration: Annotated[
        Floats | None,
        Table(),
        "Rows of times, null where there is no such leg. Default: what the length takes at the UAV's speed",
    ] = None

    def __post_init__(self) -> None:
        for name in ("distance", "duration"):
            rows = getattr(self, name)
            if rows is not None:
                object.__setattr__(self, name, table_of(rows))

    def __eq__(self, other: object) -> bool:
        """Whether all legs are the same."""
        if not isinstance(other, Matrix):
            return NotImplemented
        if not np.array_equal(self.distance, other.distance):
            return False
        if self.duration is None or other.duration is None:
            return self.duration is other.duration
        return np.array_equal(self.duration, other.duration)

    def __hash__(self) -> int:
        """Hash its size: the legs decide whether two are equal."""
        return hash(self.size)

    @property
    def size(self) -> int:
        """How many locations there are, R."""
        return len(self.distance)


def longest_leg(matrices: Iterable[Matrix]) -> float:
    """Return the longest leg of any of some matrices; 0 if there is none."""
    tables = [each.distance for each in matrices]
    return max((float(table[np.isfinite(table)].max(initial=0.0)) for table in tables), default=0.0)
