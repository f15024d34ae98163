"""Stacks of problems made of others: parts of one, several, without reloads; and UAVs that are alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.recfunctions import structured_to_unstructured

from app.simulation.arrays import AXES, NONE, OF_UAVS, Integers, ProblemArrays


def part(arrays: ProblemArrays, uavs: Integers, targets: Integers) -> ProblemArrays:
    """Return a stack of parts of the first problem of a stack.

    Parameters
    ----------
    arrays
        The stack.
    uavs, targets
        (P, M) and (P, N): those that each part has, in their order there.
    """
    # A part has as many classes of legs as there may be among its UAVs, numbered anew.
    classes, number = _classes_of(arrays.uavs["leg_class"][0][uavs])
    rest = np.arange(arrays.shape[1], arrays.between.shape[2])
    stops = np.concatenate([targets, np.broadcast_to(rest, (len(targets), len(rest)))], axis=1)
    bases = np.broadcast_to(np.arange(arrays.n_bases), (len(targets), arrays.n_bases))
    taken = {"M": uavs, "N": targets, "L": stops, "D": bases, "C": classes}
    columns = {}
    for name, axes in AXES.items():
        column = getattr(arrays, name)
        some = [taken[axis] for axis in axes.names if axis != "X"]
        if column.size == 0:
            shape = [each.shape[1] if size else 0 for each, size in zip(some, column.shape[1:], strict=False)]
            columns[name] = np.empty((len(uavs), *shape, *column.shape[1 + len(some) :]), column.dtype)
            continue
        for axis in range(len(some)):
            some[axis] = some[axis].reshape(
                len(uavs), *(-1 if each == axis else 1 for each in range(len(some)))
            )
        column = column[0][tuple(some)] if some else np.repeat(column[:1], len(uavs), axis=0)
        # Compiled code is made anew for every order of memory, and nobody should wait for that.
        columns[name] = np.ascontiguousarray(column)
    columns["uavs"]["leg_class"] = number
    columns["committed"], columns["before"] = (
        _numbered_anew(columns[name], targets, arrays.shape[1]) for name in ("committed", "before")
    )
    return ProblemArrays(**columns)


def without_reloads(arrays: ProblemArrays) -> ProblemArrays:
    """Return a stack of the same problems without reloads; UAVs still land at bases."""
    if not arrays.n_bases:
        return arrays
    stops = slice(0, arrays.shape[1])
    columns = {}
    for name, axes in AXES.items():
        cut = tuple({"L": stops, "D": slice(0, 0)}.get(axis, slice(None)) for axis in axes.names)
        columns[name] = np.ascontiguousarray(getattr(arrays, name)[(slice(None), *cut)])
    return ProblemArrays(**columns)._replace(full=arrays.load)


def _classes_of(given: Integers) -> tuple[Integers, Integers]:
    """Return the classes (P, C) among UAVs of classes (P, M), and each UAV's place among them."""
    number, found = np.empty_like(given), []
    for place, row in enumerate(given):
        classes, number[place] = np.unique(row, return_inverse=True)
        found.append(classes)
    most = max(map(len, found))
    return np.array([np.resize(classes, most) for classes in found], np.int64), number


def _numbered_anew(listed: Integers, targets: Integers, n: int) -> Integers:
    """Return lists of targets (P, M, X) by their places in each part; N of a part stands for others."""
    places = np.full((len(targets), n + 1), targets.shape[1], np.int64)
    np.put_along_axis(places, targets, np.arange(targets.shape[1])[None, :], axis=1)
    places[:, n] = NONE
    return np.take_along_axis(
        places, np.where(listed == NONE, n, listed).reshape(len(places), -1), axis=1
    ).reshape(listed.shape)


def alike(arrays: ProblemArrays) -> Integers:
    """Return for each UAV of a stack's first problem the first one that is like it in everything, (M,)."""
    columns = [getattr(arrays, name)[0] for name in OF_UAVS]
    plain = [structured_to_unstructured(each) if each.dtype.names else each for each in columns]
    told = np.column_stack([each.reshape(len(each), -1) for each in plain])
    first: dict[bytes, int] = {}
    # Adding 0 makes one zero of the two.
    return np.array([first.setdefault(row.tobytes(), i) for i, row in enumerate(told + 0.0)], np.int64)


def stack(problems: Sequence[ProblemArrays]) -> ProblemArrays:
    """Stack problems, padding each to the largest M, N and K among them.

    The action that sends a UAV home is the padded N; actions of padded targets are never allowed.

    Parameters
    ----------
    problems
        At least one.

    Raises
    ------
    ValueError
        If there are bases, whose numbers follow those of the targets, and not everywhere as many of both.
    """
    if len({(each.shape[1], each.n_bases) for each in problems}) > 1 and any(e.n_bases for e in problems):
        raise ValueError("problems with bases are stacked only with as many targets and bases each")
    columns = zip(ProblemArrays._fields, zip(*problems, strict=True), strict=True)
    return ProblemArrays(**{name: _pad(arrays, AXES[name].padding) for name, arrays in columns})


def _pad(arrays: Sequence[npt.NDArray[Any]], value: Any) -> npt.NDArray[Any]:
    largest = [max(sizes) for sizes in zip(*(a.shape[1:] for a in arrays), strict=True)]
    total = sum(len(a) for a in arrays)
    padded = np.empty((total, *largest), dtype=arrays[0].dtype)
    padded[...] = np.array(value, dtype=arrays[0].dtype)
    row = 0
    for a in arrays:
        padded[(slice(row, row + len(a)), *(slice(size) for size in a.shape[1:]))] = a
        row += len(a)
    return padded
