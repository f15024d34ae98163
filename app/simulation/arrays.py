"""Problems as arrays: the one conversion from the domain to what compiled code reads.

Every array has a leading axis of P problems, so that episodes of different problems can advance in lock-step.
Problems of different sizes are stacked by padding: a padded UAV is a returning one, a padded target needs
nothing, so neither is ever part of an allowed visit.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import numpy as np
import numpy.typing as npt

from app.domain.problem import ROUNDING, Problem
from app.domain.supplies import most_loaded
from app.simulation.columns import AREAS, BASES, TERMS, UAVS
from app.simulation.homes import Homes, nearest_homes, usable_bases
from app.simulation.legs import UNREACHABLE, LegArrays, leg_arrays

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Records = npt.NDArray[np.void]

NONE = -1
"""In place of a target in a list: there is none."""


@dataclass(frozen=True, slots=True)
class Axes:
    """Axes of a field of :class:`ProblemArrays` after that of the problems; all that copies arrays asks here.

    Attributes
    ----------
    names
        A letter each: M (UAVs), N (targets), D (bases), L (stops, which are numbered as actions are: N where
        there are no bases, otherwise N + 1 + D), C (classes of legs), and X, the last, for all else.
    padding
        What a padded UAV or target has.
    """

    names: str = ""
    padding: Any = 0.0


class ProblemArrays(NamedTuple):
    """A stack of P problems of one (padded) shape M, N, K.

    Legs are of C classes (:mod:`app.simulation.legs`); one that does not exist is ``UNREACHABLE`` long.
    Where times of legs are lengths over speeds, the arrays of times have no columns.

    Attributes
    ----------
    start_target
        (P, M, L) length of the leg from a UAV's current position in the request to a target or base.
    between
        (P, C, L, L) length of the leg from a target or base to another.
    home
        (P, M, L) length of the leg from a target or base to where a UAV lands; 0 where there is none.
    start_time, between_time, home_time
        (P, M, L), (P, C, L, L), (P, M, L) times of these legs, where they are given.
    kept_range
        (P, M, L) air length that has to be left on arrival: that of the way home, where it is required;
        ``UNREACHABLE`` where the UAV must not be sent there.
    uavs
        (P, M) of :data:`~app.simulation.columns.UAVS`.
    committed, before
        (P, M, V) targets that a UAV visits first, in this order, and (P, M, W) those that it visits in
        ``start_plan``, each once, where changes cost reward; ``NONE`` after the last.
    ret
        (P, M) UAVs that are returning.
    load
        (P, M, K) amounts carried.
    full
        (P, M, K) amounts that it leaves a base with, at most where loading is planned; those carried where
        there are no bases.
    bases
        (P, D) of :data:`~app.simulation.columns.BASES`.
    stock
        (P, D, K) amounts at the bases; infinite where there is as much as is asked for.
    weights
        (P, K) weight of a unit of each material.
    areas
        (P, N) of :data:`~app.simulation.columns.AREAS`.
    need
        (P, N, K) amounts needed.
    requested
        (P, N, K) amounts that the needs are a part of; the needs, where the request says nothing else.
    beyond
        (P, N, K) amounts of the needs beyond the first share: a need above it is partly of the first share.
    terms
        (P,) of :data:`~app.simulation.columns.TERMS`.
    max_steps
        (P,) S.
    """

    start_target: Annotated[Floats, Axes("ML")]
    between: Annotated[Floats, Axes("CLL")]
    home: Annotated[Floats, Axes("ML")]
    start_time: Annotated[Floats, Axes("ML")]
    between_time: Annotated[Floats, Axes("CLL")]
    home_time: Annotated[Floats, Axes("ML")]
    kept_range: Annotated[Floats, Axes("ML")]
    uavs: Annotated[Records, Axes("M", padding=(1.0, *(0.0,) * 9, 0, False, False))]
    committed: Annotated[Integers, Axes("MX", padding=-1)]
    before: Annotated[Integers, Axes("MX", padding=-1)]
    ret: Annotated[Flags, Axes("M", padding=True)]
    load: Annotated[Floats, Axes("MX")]
    full: Annotated[Floats, Axes("MX")]
    bases: Annotated[Records, Axes("D", padding=(0.0,))]
    stock: Annotated[Floats, Axes("DX")]
    weights: Annotated[Floats, Axes("X")]
    areas: Annotated[Records, Axes("N", padding=(0.0, 0.0, 0.0, 0.0, np.inf, 0.0))]
    need: Annotated[Floats, Axes("NX")]
    requested: Annotated[Floats, Axes("NX")]
    beyond: Annotated[Floats, Axes("NX")]
    terms: Annotated[Records, Axes()]
    max_steps: Annotated[Integers, Axes()]

    @property
    def shape(self) -> tuple[int, int, int]:
        """M, N and K of the stack, padding included."""
        _, m, k = self.load.shape
        return m, self.need.shape[1], k

    @property
    def n_bases(self) -> int:
        """Number of bases, D; they are not among those that are padded."""
        return int(self.stock.shape[1])


def compile_problem(problem: Problem) -> ProblemArrays:
    """Turn one problem into a stack of one.

    A problem does not change, and a job asks for the same one again and again, in the search, beside it and
    when the plan is explained: the newest problem's arrays are kept as long as the problem lives. They are
    for reading; copy it before changing it.
    """
    return _compiled(problem)[0]


def homes_of(problem: Problem) -> Homes | None:
    """Return where the UAVs of a problem land; None where there are no bases."""
    return _compiled(problem)[1]


_Compiled = tuple[ProblemArrays, Homes | None]


def _compiled(problem: Problem) -> _Compiled:
    global _newest  # noqa: PLW0603 - one entry, replaced as a whole
    known = _newest
    if known is not None and known[0]() is problem:
        return known[1]
    compiled = _compile(problem)
    _newest = weakref.ref(problem, _forget), compiled
    return compiled


_newest: tuple[weakref.ref[Problem], _Compiled] | None = None


def _forget(gone: weakref.ref[Problem]) -> None:
    global _newest  # noqa: PLW0603 - as above
    if _newest is not None and _newest[0] is gone:
        _newest = None


def _compile(problem: Problem) -> _Compiled:
    uavs, targets, objective = problem.uavs, problem.targets, problem.objective
    need = np.array([t.need for t in targets], dtype=np.float64)
    load = np.array([u.loadlist for u in uavs], dtype=np.float64)
    full = np.array(most_loaded(problem), dtype=np.float64) if problem.bases else load
    unlimited = (np.inf,) * problem.n_materials
    stock = np.array([unlimited if base.stock is None else base.stock for base in problem.bases], np.float64)
    requested = np.array(
        [t.loadlist if t.requested is None else t.requested for t in targets], dtype=np.float64
    )
    share = objective.minimum_share if objective.minimum_weight > 1.0 else 0.0
    bonus = objective.minimum_weight - 1.0 if share > 0.0 else 0.0
    beyond = (1.0 - share) * requested
    legs, homes = leg_arrays(problem), None
    if problem.bases:
        legs, homes = nearest_homes(problem, legs)
    index = {target.id: j for j, target in enumerate(targets)}
    terms = np.zeros(1, TERMS)
    terms["weight"], terms["makespan"] = problem.distance_weight, objective.makespan_weight
    terms["change"], terms["bonus"] = objective.change_weight, bonus
    terms["decay"] = 0.0 if objective.half_life is None else 1.0 / objective.half_life
    terms["crumb"] = ROUNDING * max(load.max(), full.max(), requested.max())
    terms["return_to_base"], terms["charge_return"] = objective.return_to_base, objective.charge_return
    terms["timed"], terms["in_wind"], terms["metric"] = legs.timed, legs.in_wind, legs.metric
    terms["plans_loading"] = problem.plans_loading
    arrays = ProblemArrays(
        start_target=legs.start_target[None],
        between=legs.between[None],
        home=legs.home[None],
        start_time=legs.start_time[None],
        between_time=legs.between_time[None],
        home_time=legs.home_time[None],
        kept_range=_kept_range(problem, legs, index)[None],
        uavs=_uavs(problem, legs)[None],
        committed=_listed([[index[each] for each in u.committed] for u in uavs])[None],
        before=_listed(_visited_before(problem))[None],
        ret=np.array([[u.ret for u in uavs]], dtype=np.bool_),
        load=load[None],
        full=full[None],
        bases=np.array([(base.turnaround,) for base in problem.bases], BASES)[None],
        stock=stock.reshape(1, problem.n_bases, problem.n_materials),
        weights=np.array([problem.weights], dtype=np.float64),
        areas=_areas(problem, need, beyond, bonus)[None],
        need=need[None],
        requested=requested[None],
        beyond=beyond[None],
        terms=terms,
        max_steps=np.array([problem.max_steps], dtype=np.int64),
    )
    return arrays, homes


def _uavs(problem: Problem, legs: LegArrays) -> Records:
    columns = np.zeros(problem.n_uavs, UAVS)
    uavs = problem.uavs
    columns["speed"], columns["dis"] = [u.speed for u in uavs], [u.dis for u in uavs]
    columns["voyage"] = [u.voyage * (1.0 - u.reserve) for u in uavs]
    columns["ready"], columns["airborne"] = [u.available_from for u in uavs], [u.airborne for u in uavs]
    columns["until"] = [np.inf if u.available_until is None else u.available_until for u in uavs]
    columns["endurance"] = [np.inf if u.endurance is None else u.endurance * (1.0 - u.reserve) for u in uavs]
    # It counts nowhere else, so that UAVs which differ in it alone are alike.
    limits = [u.capacity if problem.plans_loading else None for u in uavs]
    columns["capacity"] = [np.inf if limit is None else limit for limit in limits]
    columns["watched"] = np.isfinite(columns["until"]) | np.isfinite(columns["endurance"])
    columns["on_ground"] = [u.begins_on_ground for u in uavs]
    columns["start_home"], columns["start_home_time"] = legs.start_home, legs.start_home_time
    columns["leg_class"] = legs.leg_class
    return columns


def _areas(problem: Problem, need: Floats, beyond: Floats, bonus: float) -> Records:
    columns, total = np.zeros(problem.n_targets, AREAS), need.sum(axis=1)
    level = np.array([t.urgency for t in problem.targets], dtype=np.float64)
    unit = np.where(total > 0.0, level / np.where(total > 0.0, total, 1.0), 0.0)
    if bonus > 0.0:
        level = level + bonus * unit * np.maximum(0.0, need - beyond).sum(axis=1)
    columns["level"], columns["unit"], columns["need_total"] = level, unit, total
    columns["earliest"] = [t.earliest for t in problem.targets]
    columns["deadline"] = [np.inf if t.deadline is None else t.deadline for t in problem.targets]
    columns["service"] = [t.service_time for t in problem.targets]
    return columns


def _kept_range(problem: Problem, legs: LegArrays, index: dict[str, int]) -> Floats:
    """Return the air lengths that have to be left on arrival, (M, N)."""
    kept = np.zeros(legs.home.shape)
    if problem.objective.return_to_base:
        speed = np.array([uav.speed for uav in problem.uavs])[:, None]
        kept[:] = np.where(legs.homeless, UNREACHABLE, legs.home_time * speed if legs.in_wind else legs.home)
    if problem.bases:
        kept[:, problem.n_targets] = UNREACHABLE
        kept[:, problem.n_targets + 1 :] = np.where(usable_bases(problem), 0.0, UNREACHABLE)
    skills = [frozenset(target.skills) for target in problem.targets]
    skilled = np.array([bool(needed) for needed in skills])
    for i, uav in enumerate(problem.uavs):
        kept[i, [index[each] for each in uav.excluded]] = UNREACHABLE
        for j in np.flatnonzero(skilled):
            if not skills[j] <= frozenset(uav.skills):
                kept[i, j] = UNREACHABLE
    return kept


def _visited_before(problem: Problem) -> list[list[int]]:
    """Return for each UAV the targets that it visits in ``start_plan``, where changes cost reward."""
    if not problem.start_plan or problem.objective.change_weight == 0.0:
        return [[] for _ in problem.uavs]
    columns = zip(*problem.start_plan, strict=True)
    return [list(dict.fromkeys(j for j in column if j < problem.n_targets)) for column in columns]


def _listed(lists: list[list[int]]) -> Integers:
    """Return lists as rows that end in ``NONE``; (R, 0) where all are empty."""
    longest = max(map(len, lists))
    return np.array([row + [NONE] * (longest + 1 - len(row)) for row in lists], np.int64)[
        :, : longest + 1 if longest else 0
    ]


def _axes() -> dict[str, Axes]:
    hints = get_type_hints(ProblemArrays, include_extras=True)
    return {name: get_args(hints[name])[1] for name in ProblemArrays._fields}


AXES = _axes()
"""Axes of every field."""

OF_UAVS = tuple(name for name, axes in AXES.items() if axes.names.startswith("M"))
"""Fields with an axis of UAVs, which is always the second."""
