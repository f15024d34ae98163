"""Problems as arrays: the one conversion from the domain to what compiled code reads.

Every array has a leading axis of P problems, so that episodes of different problems can advance in lock-step.
Problems of different sizes are stacked by padding: a padded UAV is a returning one, a padded target needs
nothing, so neither is ever part of an allowed visit.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import numpy as np
import numpy.typing as npt

from app.domain.geometry import distance
from app.domain.problem import ROUNDING, Problem
from app.simulation.distances import between_points

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Axes:
    """Axes of a field of :class:`ProblemArrays` after that of the problems; all that copies arrays asks here.

    Attributes
    ----------
    names
        A letter each: M (UAVs), N (targets), K (materials), in this order, but for NN.
    padding
        What a padded UAV or target has.
    """

    names: str = ""
    padding: float = 0.0


class ProblemArrays(NamedTuple):
    """A stack of P problems of one (padded) shape M, N, K.

    Attributes
    ----------
    start_target
        (P, M, N) distance from a UAV's current position in the request to a target.
    between
        (P, N, N) distance between targets.
    home
        (P, M, N) distance from a target to a UAV's starting point.
    start_home
        (P, M) distance from a UAV's current position in the request to its starting point.
    speed, voyage, dis
        (P, M) as in the request.
    ret
        (P, M) UAVs that are returning.
    load
        (P, M, K) amounts carried.
    need
        (P, N, K) amounts needed.
    requested
        (P, N, K) amounts that the needs are a part of; the needs, where the request says nothing else.
    crumb
        (P,) amount below which what is left of another one may be rounding: that share of the largest.
    need_total
        (P, N) sum of the needs over materials; 0 for a target that needs nothing.
    level
        (P, N) what meeting the whole need earns: the emergency level, times the share of what was requested
        that is still needed.
    deadline, service
        (P, N); deadline is infinite where there is none.
    weight
        (P,) distance weight λ as it is used.
    return_to_base, charge_return
        (P,) the objective's switches.
    max_steps
        (P,) S.
    """

    start_target: Annotated[Floats, Axes("MN")]
    between: Annotated[Floats, Axes("NN")]
    home: Annotated[Floats, Axes("MN")]
    start_home: Annotated[Floats, Axes("M")]
    speed: Annotated[Floats, Axes("M", padding=1.0)]
    voyage: Annotated[Floats, Axes("M")]
    dis: Annotated[Floats, Axes("M")]
    ret: Annotated[Flags, Axes("M", padding=True)]
    load: Annotated[Floats, Axes("MK")]
    need: Annotated[Floats, Axes("NK")]
    requested: Annotated[Floats, Axes("NK")]
    crumb: Annotated[Floats, Axes()]
    need_total: Annotated[Floats, Axes("N")]
    level: Annotated[Floats, Axes("N")]
    deadline: Annotated[Floats, Axes("N", padding=np.inf)]
    service: Annotated[Floats, Axes("N")]
    weight: Annotated[Floats, Axes()]
    return_to_base: Annotated[Flags, Axes()]
    charge_return: Annotated[Flags, Axes()]
    max_steps: Annotated[Integers, Axes()]

    @property
    def shape(self) -> tuple[int, int, int]:
        """M, N and K of the stack, padding included."""
        _, m, k = self.load.shape
        return m, self.need.shape[1], k


def compile_problem(problem: Problem) -> ProblemArrays:
    """Turn one problem into a stack of one.

    A problem does not change, and a job asks for the same one again and again, in the search, beside it and
    when the plan is explained: the newest problem's arrays are kept as long as the problem lives. They are
    for reading; copy it before changing it.
    """
    global _newest  # noqa: PLW0603 - one entry, replaced as a whole
    known = _newest
    if known is not None and known[0]() is problem:
        return known[1]
    arrays = _compile(problem)
    _newest = weakref.ref(problem, _forget), arrays
    return arrays


_newest: tuple[weakref.ref[Problem], ProblemArrays] | None = None


def _forget(gone: weakref.ref[Problem]) -> None:
    global _newest  # noqa: PLW0603 - as above
    if _newest is not None and _newest[0] is gone:
        _newest = None


def _compile(problem: Problem) -> ProblemArrays:
    uavs, targets = problem.uavs, problem.targets
    start = np.array([(u.x_s, u.y_s) for u in uavs], dtype=np.float64)
    current = np.array([(u.x_c, u.y_c) for u in uavs], dtype=np.float64)
    area = np.array([(t.x, t.y) for t in targets], dtype=np.float64)
    need = np.array([t.need for t in targets], dtype=np.float64)
    load = np.array([u.loadlist for u in uavs], dtype=np.float64)
    requested = np.array(
        [t.loadlist if t.requested is None else t.requested for t in targets], dtype=np.float64
    )
    start_target = between_points(problem.crs, current, area)
    # Most swarms are where they start, and have the same way to a target as home from it.
    home = start_target.copy() if np.array_equal(start, current) else between_points(problem.crs, start, area)
    return ProblemArrays(
        start_target=start_target[None],
        between=between_points(problem.crs, area, area)[None],
        home=home[None],
        start_home=np.array(
            [[distance(problem.crs, u.x_c, u.y_c, u.x_s, u.y_s) for u in uavs]], dtype=np.float64
        ),
        speed=np.array([[u.speed for u in uavs]], dtype=np.float64),
        voyage=np.array([[u.voyage for u in uavs]], dtype=np.float64),
        dis=np.array([[u.dis for u in uavs]], dtype=np.float64),
        ret=np.array([[u.ret for u in uavs]], dtype=np.bool_),
        load=load[None],
        need=need[None],
        requested=requested[None],
        crumb=np.array([ROUNDING * max(load.max(), requested.max())]),
        need_total=need.sum(axis=1)[None],
        level=np.array([[t.urgency for t in targets]], dtype=np.float64),
        deadline=np.array(
            [[np.inf if t.deadline is None else t.deadline for t in targets]], dtype=np.float64
        ),
        service=np.array([[t.service_time for t in targets]], dtype=np.float64),
        weight=np.array([problem.distance_weight], dtype=np.float64),
        return_to_base=np.array([problem.objective.return_to_base], dtype=np.bool_),
        charge_return=np.array([problem.objective.charge_return], dtype=np.bool_),
        max_steps=np.array([problem.max_steps], dtype=np.int64),
    )


def _axes() -> dict[str, Axes]:
    hints = get_type_hints(ProblemArrays, include_extras=True)
    return {name: get_args(hints[name])[1] for name in ProblemArrays._fields}


AXES = _axes()
"""Axes of every field."""

OF_UAVS = tuple(name for name, axes in AXES.items() if axes.names.startswith("M"))
"""Fields with an axis of UAVs, which is always the second."""


def part(arrays: ProblemArrays, uavs: Integers, targets: Integers) -> ProblemArrays:
    """Return a stack of parts of the first problem of a stack.

    Parameters
    ----------
    arrays
        The stack.
    uavs, targets
        (P, M) and (P, N): those that each part has, in their order there.
    """
    taken = {"M": uavs, "N": targets}
    columns = {}
    for name, axes in AXES.items():
        column = getattr(arrays, name)
        some = [taken[axis] for axis in axes.names if axis != "K"]
        if len(some) == 2:
            column = column[0][some[0][:, :, None], some[1][:, None, :]]
        else:
            column = column[0][some[0]] if some else np.repeat(column[:1], len(uavs))
        # Compiled code is made anew for every order of memory, and nobody should wait for that.
        columns[name] = np.ascontiguousarray(column)
    return ProblemArrays(**columns)


def alike(arrays: ProblemArrays) -> Integers:
    """Return for each UAV of a stack's first problem the first one that is like it in everything, (M,)."""
    told = np.column_stack([getattr(arrays, name)[0] for name in OF_UAVS])
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
    """
    columns = zip(ProblemArrays._fields, zip(*problems, strict=True), strict=True)
    return ProblemArrays(**{name: _pad(arrays, AXES[name].padding) for name, arrays in columns})


def _pad(arrays: Sequence[npt.NDArray[Any]], value: float) -> npt.NDArray[Any]:
    largest = [max(sizes) for sizes in zip(*(a.shape[1:] for a in arrays), strict=True)]
    total = sum(len(a) for a in arrays)
    padded = np.full((total, *largest), value, dtype=arrays[0].dtype)
    row = 0
    for a in arrays:
        padded[(slice(row, row + len(a)), *(slice(size) for size in a.shape[1:]))] = a
        row += len(a)
    return padded
