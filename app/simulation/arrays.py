"""Problems as arrays: the one conversion from the domain to what compiled code reads.

Every array has a leading axis of P problems, so that episodes of different problems can advance in lock-step.
Problems of different sizes are stacked by padding: a padded UAV is a returning one, a padded target needs
nothing, so neither is ever part of an allowed visit.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import numpy as np
import numpy.typing as npt

from app.domain.problem import ROUNDING, Problem
from app.simulation.legs import UNREACHABLE, LegArrays, leg_arrays

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

NONE = -1
"""In place of a target in a list: there is none."""


@dataclass(frozen=True, slots=True)
class Axes:
    """Axes of a field of :class:`ProblemArrays` after that of the problems; all that copies arrays asks here.

    Attributes
    ----------
    names
        A letter each: M (UAVs), N (targets), C (classes of legs), and X, the last, for what else there is.
    padding
        What a padded UAV or target has.
    """

    names: str = ""
    padding: float = 0.0


class Term(IntEnum):
    """Columns of ``ProblemArrays.terms``, what holds for a whole problem.

    Attributes
    ----------
    TIMED
        1 where times of legs are given, 0 where they are lengths over speeds.
    IN_WIND
        1 where the air length of a leg is time · speed, 0 where it is the length over ground.
    DECAY
        1 / half_life, 0 where nothing decays.
    BONUS
        What the first share of a need earns above the rest, minimum_weight - 1; 0 where there is none.
    MAKESPAN, CHANGE
        Weights of the makespan and of changes.
    METRIC
        1 where no way over a third place is shorter, or takes less time, than the leg itself.
    """

    TIMED = 0
    IN_WIND = 1
    DECAY = 2
    BONUS = 3
    MAKESPAN = 4
    CHANGE = 5
    METRIC = 6


class Limit(IntEnum):
    """Columns of ``ProblemArrays.limits``, what a UAV has besides its range.

    Attributes
    ----------
    READY, UNTIL
        Its clock at the start, and the latest time to have landed; infinite where there is none.
    AIRBORNE, ENDURANCE
        Time in the air at the start, and how much may be; infinite where there is no limit.
    WATCHED
        1 where ``UNTIL`` or ``ENDURANCE`` is a limit.
    ON_GROUND
        1 where it waits for its first visit on the ground.
    START_HOME_TIME
        Time of the leg from its place to its starting point, where times are given.
    """

    READY = 0
    UNTIL = 1
    AIRBORNE = 2
    ENDURANCE = 3
    WATCHED = 4
    ON_GROUND = 5
    START_HOME_TIME = 6


class ProblemArrays(NamedTuple):
    """A stack of P problems of one (padded) shape M, N, K.

    Legs are of C classes (:mod:`app.simulation.legs`); one that does not exist is ``UNREACHABLE`` long.
    Where times of legs are lengths over speeds, the arrays of times have no columns.

    Attributes
    ----------
    start_target
        (P, M, N) length of the leg from a UAV's current position in the request to a target.
    between
        (P, C, N, N) length of the leg from a target to another.
    home
        (P, M, N) length of the leg from a target to a UAV's starting point; 0 where there is none.
    start_home
        (P, M) length of the leg from a UAV's current position in the request to its starting point, likewise.
    start_time, between_time, home_time
        (P, M, N), (P, C, N, N), (P, M, N) times of these legs, where they are given.
    leg_class
        (P, M) class of each UAV's legs.
    speed, dis
        (P, M) as in the request.
    voyage
        (P, M) range, without what has to be left after landing.
    kept_range
        (P, M, N) air length that has to be left on arrival at a target: that of the way home, where it is
        required; ``UNREACHABLE`` where the UAV must not be sent there.
    limits
        (P, M, ``Limit``)
    committed
        (P, M, V) targets that a UAV visits first, in this order; ``NONE`` after the last.
    ret
        (P, M) UAVs that are returning.
    load
        (P, M, K) amounts carried.
    need
        (P, N, K) amounts needed.
    requested
        (P, N, K) amounts that the needs are a part of; the needs, where the request says nothing else.
    beyond
        (P, N, K) amounts of the needs beyond the first share: a need above it is partly of the first share.
    crumb
        (P,) amount below which what is left of another one may be rounding: that share of the largest.
    need_total
        (P, N) sum of the needs over materials; 0 for a target that needs nothing.
    level
        (P, N) what meeting the whole need at once earns: the emergency level, times the share of what was
        requested that is still needed, and what the first share earns above.
    unit
        (P, N) what a unit of material beyond the first share earns.
    earliest, deadline, service
        (P, N); deadline is infinite where there is none.
    weight
        (P,) distance weight λ as it is used.
    terms
        (P, ``Term``)
    before
        (P, M, W) targets that a UAV visits in ``start_plan``, each once, where changes cost reward; ``NONE``
        after the last.
    return_to_base, charge_return
        (P,) the objective's switches.
    max_steps
        (P,) S.
    """

    start_target: Annotated[Floats, Axes("MN")]
    between: Annotated[Floats, Axes("CNN")]
    home: Annotated[Floats, Axes("MN")]
    start_home: Annotated[Floats, Axes("M")]
    start_time: Annotated[Floats, Axes("MN")]
    between_time: Annotated[Floats, Axes("CNN")]
    home_time: Annotated[Floats, Axes("MN")]
    leg_class: Annotated[Integers, Axes("M")]
    speed: Annotated[Floats, Axes("M", padding=1.0)]
    voyage: Annotated[Floats, Axes("M")]
    dis: Annotated[Floats, Axes("M")]
    kept_range: Annotated[Floats, Axes("MN")]
    limits: Annotated[Floats, Axes("MX")]
    committed: Annotated[Integers, Axes("MX", padding=-1)]
    ret: Annotated[Flags, Axes("M", padding=True)]
    load: Annotated[Floats, Axes("MX")]
    need: Annotated[Floats, Axes("NX")]
    requested: Annotated[Floats, Axes("NX")]
    beyond: Annotated[Floats, Axes("NX")]
    crumb: Annotated[Floats, Axes()]
    need_total: Annotated[Floats, Axes("N")]
    level: Annotated[Floats, Axes("N")]
    unit: Annotated[Floats, Axes("N")]
    earliest: Annotated[Floats, Axes("N")]
    deadline: Annotated[Floats, Axes("N", padding=np.inf)]
    service: Annotated[Floats, Axes("N")]
    weight: Annotated[Floats, Axes()]
    terms: Annotated[Floats, Axes("X")]
    before: Annotated[Integers, Axes("MX", padding=-1)]
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
    uavs, targets, objective = problem.uavs, problem.targets, problem.objective
    need = np.array([t.need for t in targets], dtype=np.float64)
    load = np.array([u.loadlist for u in uavs], dtype=np.float64)
    requested = np.array(
        [t.loadlist if t.requested is None else t.requested for t in targets], dtype=np.float64
    )
    need_total = need.sum(axis=1)
    share = objective.minimum_share if objective.minimum_weight > 1.0 else 0.0
    bonus = objective.minimum_weight - 1.0 if share > 0.0 else 0.0
    beyond = (1.0 - share) * requested
    level = np.array([t.urgency for t in targets], dtype=np.float64)
    unit = np.where(need_total > 0.0, level / np.where(need_total > 0.0, need_total, 1.0), 0.0)
    if bonus > 0.0:
        level = level + bonus * unit * np.maximum(0.0, need - beyond).sum(axis=1)
    index = {target.id: j for j, target in enumerate(targets)}
    legs = leg_arrays(problem)
    return ProblemArrays(
        start_target=legs.start_target[None],
        between=legs.between[None],
        home=legs.home[None],
        start_home=legs.start_home[None],
        start_time=legs.start_time[None],
        between_time=legs.between_time[None],
        home_time=legs.home_time[None],
        leg_class=legs.leg_class[None],
        speed=np.array([[u.speed for u in uavs]], dtype=np.float64),
        voyage=np.array([[u.voyage * (1.0 - u.reserve) for u in uavs]], dtype=np.float64),
        dis=np.array([[u.dis for u in uavs]], dtype=np.float64),
        kept_range=_kept_range(problem, legs, index)[None],
        limits=_limits(problem, legs)[None],
        committed=_listed([[index[each] for each in u.committed] for u in uavs])[None],
        ret=np.array([[u.ret for u in uavs]], dtype=np.bool_),
        load=load[None],
        need=need[None],
        requested=requested[None],
        beyond=beyond[None],
        crumb=np.array([ROUNDING * max(load.max(), requested.max())]),
        need_total=need_total[None],
        level=level[None],
        unit=unit[None],
        earliest=np.array([[t.earliest for t in targets]], dtype=np.float64),
        deadline=np.array(
            [[np.inf if t.deadline is None else t.deadline for t in targets]], dtype=np.float64
        ),
        service=np.array([[t.service_time for t in targets]], dtype=np.float64),
        weight=np.array([problem.distance_weight], dtype=np.float64),
        terms=np.array(
            [
                [
                    float(legs.timed),
                    float(legs.in_wind),
                    0.0 if objective.half_life is None else 1.0 / objective.half_life,
                    bonus,
                    objective.makespan_weight,
                    objective.change_weight,
                    float(legs.metric),
                ]
            ]
        ),
        before=_listed(_visited_before(problem))[None],
        return_to_base=np.array([objective.return_to_base], dtype=np.bool_),
        charge_return=np.array([objective.charge_return], dtype=np.bool_),
        max_steps=np.array([problem.max_steps], dtype=np.int64),
    )


def _limits(problem: Problem, legs: LegArrays) -> Floats:
    """Return the columns of :class:`Limit` for every UAV."""
    limits = np.zeros((problem.n_uavs, len(Limit)))
    for i, uav in enumerate(problem.uavs):
        own = limits[i]
        own[Limit.READY] = uav.available_from
        own[Limit.UNTIL] = np.inf if uav.available_until is None else uav.available_until
        own[Limit.AIRBORNE] = uav.airborne
        own[Limit.ENDURANCE] = np.inf if uav.endurance is None else uav.endurance * (1.0 - uav.reserve)
        own[Limit.WATCHED] = uav.available_until is not None or uav.endurance is not None
        at_start = (uav.x_c, uav.y_c) == (uav.x_s, uav.y_s) and uav.home_location in (None, uav.location)
        own[Limit.ON_GROUND] = at_start and uav.dis == 0.0 and uav.airborne == 0.0
        own[Limit.START_HOME_TIME] = legs.start_home_time[i]
    return limits


def _kept_range(problem: Problem, legs: LegArrays, index: dict[str, int]) -> Floats:
    """Return the air lengths that have to be left on arrival, (M, N)."""
    kept = np.zeros(legs.home.shape)
    if problem.objective.return_to_base:
        speed = np.array([uav.speed for uav in problem.uavs])[:, None]
        kept[:] = np.where(legs.homeless, UNREACHABLE, legs.home_time * speed if legs.in_wind else legs.home)
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
    """Return lists as rows that end in ``NONE``, at least one where any list has an entry; (R, 0) if none has."""
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
    classes, number = _classes_of(arrays.leg_class[0][uavs])
    taken = {"M": uavs, "N": targets, "C": classes}
    columns = {}
    for name, axes in AXES.items():
        column = getattr(arrays, name)
        some = [taken[axis] for axis in axes.names if axis != "X"]
        if column.size == 0:
            shape = [each.shape[1] if size else 0 for each, size in zip(some, column.shape[1:], strict=False)]
            columns[name] = np.empty((len(uavs), *shape, *column.shape[1 + len(some) :]), column.dtype)
            continue
        for axis in range(len(some)):
            some[axis] = some[axis].reshape(len(uavs), *(-1 if each == axis else 1 for each in range(len(some))))
        column = column[0][tuple(some)] if some else np.repeat(column[:1], len(uavs), axis=0)
        # Compiled code is made anew for every order of memory, and nobody should wait for that.
        columns[name] = np.ascontiguousarray(column)
    columns["leg_class"] = number
    columns["committed"], columns["before"] = (
        _numbered_anew(columns[name], targets, arrays.shape[1]) for name in ("committed", "before")
    )
    return ProblemArrays(**columns)


def _classes_of(given: Integers) -> tuple[Integers, Integers]:
    """Return the classes (P, C) among UAVs of classes (P, M), and each UAV's place among them."""
    number, found = np.empty_like(given), []
    for place, row in enumerate(given):
        classes, number[place] = np.unique(row, return_inverse=True)
        found.append(classes)
    most = max(map(len, found))
    return np.array([np.resize(classes, most) for classes in found], np.int64), number


def _numbered_anew(listed: Integers, targets: Integers, n: int) -> Integers:
    """Return lists of targets (P, M, X) by their places in each part; one that it lacks is none that it has."""
    places = np.full((len(targets), n + 1), targets.shape[1], np.int64)
    np.put_along_axis(places, targets, np.arange(targets.shape[1])[None, :], axis=1)
    places[:, n] = NONE
    return np.take_along_axis(places, np.where(listed == NONE, n, listed).reshape(len(places), -1), axis=1).reshape(
        listed.shape
    )


def alike(arrays: ProblemArrays) -> Integers:
    """Return for each UAV of a stack's first problem the first one that is like it in everything, (M,)."""
    of = len(arrays.speed[0])
    told = np.column_stack([getattr(arrays, name)[0].reshape(of, -1) for name in OF_UAVS])
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
