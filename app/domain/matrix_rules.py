"""Rules of legs that are given as matrices: sizes that agree, and a row for every place."""

from __future__ import annotations

from collections.abc import Iterator
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from app.domain.errors import escaped
from app.domain.said import said

if TYPE_CHECKING:
    from app.domain.matrices import Matrix
    from app.domain.problem import UAV, Problem

Rules = Iterator[tuple[str, str]]

_PLACES = (("uavs", "location"), ("uavs", "home_location"), ("targets", "location"), ("bases", "location"))
"""Fields that are rows of the matrices, by the list of their items."""

_NAMED = 10
"""Profiles that a message names."""


def broken_rules_of_matrices(problem: Problem) -> Rules:
    """Yield every rule of matrices that a problem breaks."""
    if problem.matrices is None:
        for name, field in (*_PLACES, ("uavs", "profile")):
            values = list(map(attrgetter(field), getattr(problem, name)))
            if values.count(None) < len(values):
                for index, value in enumerate(values):
                    if value is not None:
                        yield (
                            f"/{name}/{index}/{field}",
                            said("{value!r} needs `matrices`, and there are none", value=value),
                        )
        return
    if not problem.matrices:
        return
    yield from _sizes(problem.matrices)
    for i, uav in enumerate(problem.uavs):
        yield from _profile(f"/uavs/{i}/profile", uav, problem.matrices)
    size = _rows(next(iter(problem.matrices.values())).distance)
    for name, field in _PLACES:
        for index, item in enumerate(getattr(problem, name)):
            row, at = getattr(item, field), f"/{name}/{index}/{field}"
            if row is None:
                if field == "location":
                    yield at, said("is missing; with `matrices` every UAV, target and base has one")
            elif size is not None and not 0 <= row < size:
                yield (
                    at,
                    said(
                        "{value} is not in {low}..{high}, the rows of the `matrices`",
                        value=row,
                        low=0,
                        high=size - 1,
                    ),
                )


def _rows(table: object) -> int | None:
    """Return how many rows a table has; None where it is none."""
    return len(table) if isinstance(table, np.ndarray) else None


def _sizes(matrices: dict[str, Matrix]) -> Rules:
    first = next(iter(matrices))
    size = _rows(matrices[first].distance)
    for name, matrix in matrices.items():
        rows, durations = _rows(matrix.distance), _rows(matrix.duration)
        if None not in (rows, size) and rows != size:
            yield (
                f"/matrices/{escaped(name)}/distance",
                said("{rows} rows, but {other!r} has {size}", rows=rows, other=first, size=size),
            )
        if None not in (rows, durations) and durations != rows:
            detail = said("{rows} rows, but its `distance` has {size}", rows=durations, size=rows)
            yield f"/matrices/{escaped(name)}/duration", detail


def _profile(at: str, uav: UAV, matrices: dict[str, Matrix]) -> Rules:
    names = [repr(name) for name in matrices][:_NAMED]
    there = ", ".join(names) + (", …" if len(matrices) > _NAMED else "")
    if uav.profile is None:
        if len(matrices) > 1:
            yield at, said("is missing; the `matrices` have several: {there}", there=there)
    elif uav.profile not in matrices:
        yield (
            at,
            said(
                "{profile!r} is no profile of the `matrices`, which have {there}",
                profile=uav.profile,
                there=there,
            ),
        )
