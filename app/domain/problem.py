"""A task allocation problem: a swarm of UAVs, rescue areas, materials (the paper's Eqs. 6-9).

Everything is frozen and checked when it is built: an object of these classes satisfies the rules of the
problem, and :class:`~app.domain.errors.InvalidProblem` lists every rule that was broken otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Literal, TypeVar

import numpy as np

from app.domain.errors import InvalidProblem, Violation
from app.domain.geometry import distance, longitude_stretch
from app.domain.identifiers import fault_of

Crs = Literal["local", "wgs84"]
Unloading = Literal["greedy", "planned"]

MAX_STEPS = 100
"""Largest number of decision steps a problem may ask for."""

MAX_MAGNITUDE = 1e12
"""Largest absolute value of any number of a problem: keeps every sum and product of the simulator finite."""

MIN_MAGNITUDE = 1e-100
"""Smallest absolute value of a number that is not 0: smaller ones are taken as 0.

Products of three such numbers, and quotients of them and ``MAX_MAGNITUDE``, are still ordinary numbers. A
speed, which must not be 0, is refused below it.
"""

TOLERANCE = 1e-6
"""Relative tolerance of the comparisons with range and deadline."""

ROUNDING = 1e-9
"""Share of an amount: a part of it that is smaller is rounding, and counts as nothing."""

_SAME_PLACE_KM = 1e-9
"""Extent on the globe below which all positions are one place."""

_Item = TypeVar("_Item")


@dataclass(frozen=True, slots=True)
class UAV:
    """One UAV (Eq. 7).

    Attributes
    ----------
    id
        Unique in the swarm.
    x_s, y_s
        Starting point, where it returns to.
    x_c, y_c
        Current position.
    speed
        Average speed, distance units per time unit, > 0.
    voyage
        Maximum range of one flight, in distance units.
    dis
        Distance already flown.
    ret
        True when it is returning and gets no more tasks.
    loadlist
        Amounts carried, one a material, K of them.
    """

    id: str
    x_s: float
    y_s: float
    x_c: float
    y_c: float
    speed: float
    voyage: float
    loadlist: tuple[float, ...]
    dis: float = 0.0
    ret: bool = False


@dataclass(frozen=True, slots=True)
class Target:
    """One rescue area (Eq. 9), with the time window of the paper's future work.

    Attributes
    ----------
    id
        Unique among the targets.
    x, y
        Position.
    level
        Emergency level; larger is more urgent.
    loadlist
        Amounts still needed, one a material, K of them.
    deadline
        Latest arrival in time units from now, or None.
    service_time
        Time spent unloading at a visit.
    requested
        Amounts that it asked for at first, K of them, none below its ``loadlist``; None stands for that. What
        a visit earns is by shares of these, so an area that is nearly served is not as urgent as one that has
        nothing.
    """

    id: str
    x: float
    y: float
    level: float
    loadlist: tuple[float, ...]
    deadline: float | None = None
    service_time: float = 0.0
    requested: tuple[float, ...] | None = None

    @property
    def need(self) -> tuple[float, ...]:
        """Amounts still needed, without those that are only the rounding of what was requested."""
        if self.requested is None:
            return self.loadlist
        return tuple(
            needed if needed >= ROUNDING * asked else 0.0
            for needed, asked in zip(self.loadlist, self.requested, strict=True)
        )

    @property
    def urgency(self) -> float:
        """What meeting the whole need earns: level · needed / requested."""
        if self.requested is None or not any(self.requested):
            return self.level
        return self.level * (sum(self.need) / sum(self.requested))


@dataclass(frozen=True, slots=True)
class Objective:
    """What a plan is paid for.

    Attributes
    ----------
    distance_weight
        λ, reward lost per unit of distance; None stands for 1 / extent, 1 is Eq. 14 to the letter.
    return_to_base
        A visit is allowed only if the UAV can still fly home.
    charge_return
        The leg home costs reward too.
    unloading
        ``"greedy"``: a visit unloads all that is needed and carried, the paper's rule. ``"planned"``: how
        much it unloads is decided with the plan.
    """

    distance_weight: float | None = None
    return_to_base: bool = True
    charge_return: bool = False
    unloading: Unloading = "greedy"


@dataclass(frozen=True)
class Problem:
    """M UAVs, N targets, K materials and at most S decision steps.

    Raises
    ------
    InvalidProblem
        With a violation for every broken rule; pointers are relative to the problem.
    """

    uavs: tuple[UAV, ...]
    targets: tuple[Target, ...]
    max_steps: int = 5
    crs: Crs = "local"
    objective: Objective = field(default_factory=Objective)

    def __post_init__(self) -> None:
        violations = list(_violations(self))
        if violations:
            raise InvalidProblem.of(violations)
        if _has_tiny(self):
            object.__setattr__(self, "uavs", tuple(_without_tiny(uav) for uav in self.uavs))
            object.__setattr__(self, "targets", tuple(_without_tiny(target) for target in self.targets))
            object.__setattr__(self, "objective", _without_tiny(self.objective))

    @property
    def n_uavs(self) -> int:
        """Size of the swarm, M."""
        return len(self.uavs)

    @property
    def n_targets(self) -> int:
        """Number of rescue areas, N; also the action that sends a UAV home."""
        return len(self.targets)

    @property
    def n_materials(self) -> int:
        """Number of kinds of material, K."""
        return len(self.uavs[0].loadlist)

    @cached_property
    def extent(self) -> float:
        """Diagonal of the bounding box of all positions, in distance units; 1 if it is zero.

        On the globe the box is over the shortest stretch of longitudes that holds them all, so it may cross
        the antimeridian, and less than 1e-9 km is zero.
        """
        xs = [x for u in self.uavs for x in (u.x_s, u.x_c)] + [t.x for t in self.targets]
        ys = [y for u in self.uavs for y in (u.y_s, u.y_c)] + [t.y for t in self.targets]
        on_globe = self.crs == "wgs84"
        west, east = longitude_stretch(xs) if on_globe else (min(xs), max(xs))
        diagonal = distance(self.crs, west, min(ys), east, max(ys))
        return diagonal if diagonal >= (_SAME_PLACE_KM if on_globe else MIN_MAGNITUDE) else 1.0

    @property
    def distance_weight(self) -> float:
        """λ as it is used: the objective's, or 1 / extent."""
        given = self.objective.distance_weight
        return 1.0 / self.extent if given is None else given


def _violations(problem: Problem) -> Iterator[Violation]:
    if not problem.uavs:
        yield Violation("/uavs", "0 UAVs; at least 1 is needed")
    if not problem.targets:
        yield Violation("/targets", "0 targets; at least 1 is needed")
    if not 1 <= problem.max_steps <= MAX_STEPS:
        yield Violation("/max_steps", f"{problem.max_steps} is not in 1..{MAX_STEPS}")
    if problem.crs not in ("local", "wgs84"):
        yield Violation("/crs", f"{problem.crs!r} is neither 'local' nor 'wgs84'")
    if problem.objective.unloading not in ("greedy", "planned"):
        yield Violation(
            "/objective/unloading", f"{problem.objective.unloading!r} is neither 'greedy' nor 'planned'"
        )
    weight = problem.objective.distance_weight
    if weight is not None:
        yield from _number("/objective/distance_weight", weight, low=0.0)
    materials = len(problem.uavs[0].loadlist) if problem.uavs else None
    if materials == 0:
        yield Violation("/uavs/0/loadlist", "0 materials; at least 1 is needed")
    yield from _uav_violations(problem, materials)
    yield from _target_violations(problem, materials)


def _uav_violations(problem: Problem, materials: int | None) -> Iterator[Violation]:
    seen: dict[str, int] = {}
    x_limit, y_limit = _limits(problem.crs)
    for i, uav in enumerate(problem.uavs):
        # A problem of thousands is sound nearly always: what is wrong is looked for where anything is.
        if (
            -x_limit <= uav.x_s <= x_limit
            and -y_limit <= uav.y_s <= y_limit
            and -x_limit <= uav.x_c <= x_limit
            and -y_limit <= uav.y_c <= y_limit
            and MIN_MAGNITUDE <= uav.speed <= MAX_MAGNITUDE
            and 0.0 <= uav.voyage <= MAX_MAGNITUDE
            and 0.0 <= uav.dis <= MAX_MAGNITUDE
            and _are_amounts(uav.loadlist, materials)
            and _is_new(uav.id, seen, i)
        ):
            continue
        at = f"/uavs/{i}"
        yield from _identifier(at, uav.id, seen, i)
        yield from _position(at, problem.crs, uav.x_s, uav.y_s, "x_s", "y_s")
        yield from _position(at, problem.crs, uav.x_c, uav.y_c, "x_c", "y_c")
        yield from _number(f"{at}/speed", uav.speed, low=MIN_MAGNITUDE)
        yield from _number(f"{at}/voyage", uav.voyage, low=0.0)
        yield from _number(f"{at}/dis", uav.dis, low=0.0)
        yield from _amounts(f"{at}/loadlist", uav.loadlist, materials)


def _target_violations(problem: Problem, materials: int | None) -> Iterator[Violation]:
    seen: dict[str, int] = {}
    x_limit, y_limit = _limits(problem.crs)
    for j, target in enumerate(problem.targets):
        if (
            -x_limit <= target.x <= x_limit
            and -y_limit <= target.y <= y_limit
            and 0.0 <= target.level <= MAX_MAGNITUDE
            and (target.deadline is None or -MAX_MAGNITUDE <= target.deadline <= MAX_MAGNITUDE)
            and 0.0 <= target.service_time <= MAX_MAGNITUDE
            and _are_amounts(target.loadlist, materials)
            and (target.requested is None or _are_enough(target.requested, target.loadlist))
            and _is_new(target.id, seen, j)
        ):
            continue
        at = f"/targets/{j}"
        yield from _identifier(at, target.id, seen, j)
        yield from _position(at, problem.crs, target.x, target.y, "x", "y")
        yield from _number(f"{at}/level", target.level, low=0.0)
        if target.deadline is not None:
            yield from _number(f"{at}/deadline", target.deadline)
        yield from _number(f"{at}/service_time", target.service_time, low=0.0)
        yield from _amounts(f"{at}/loadlist", target.loadlist, materials)
        if target.requested is not None:
            yield from _requested(f"{at}/requested", target.requested, target.loadlist, materials)


def _number(
    pointer: str, value: float, low: float = -MAX_MAGNITUDE, high: float = MAX_MAGNITUDE
) -> Iterator[Violation]:
    if not math.isfinite(value):
        yield Violation(pointer, f"{value} is not a finite number")
    elif not low <= value <= high:
        yield Violation(pointer, f"{_written(value)} is not in {low:g}..{high:g}")


def _written(value: float) -> str:
    """Write a number briefly, but never as another one: 180.0000001 is not 180."""
    brief = f"{value:g}"
    return brief if float(brief) == value else repr(float(value))


def _position(at: str, crs: str, x: float, y: float, x_name: str, y_name: str) -> Iterator[Violation]:
    x_limit, y_limit = _limits(crs)
    yield from _number(f"{at}/{x_name}", x, -x_limit, x_limit)
    yield from _number(f"{at}/{y_name}", y, -y_limit, y_limit)


def _limits(crs: str) -> tuple[float, float]:
    return (180.0, 90.0) if crs == "wgs84" else (MAX_MAGNITUDE, MAX_MAGNITUDE)


def _are_amounts(amounts: tuple[float, ...], materials: int | None) -> bool:
    """Whether :func:`_amounts` has nothing to say; the sum finds what is not a number in any place."""
    return bool(
        amounts
        and (materials is None or len(amounts) == materials)
        and min(amounts) >= 0.0
        and max(amounts) <= MAX_MAGNITUDE
        and math.isfinite(sum(amounts))
    )


def _are_enough(requested: tuple[float, ...], needed: tuple[float, ...]) -> bool:
    """Whether :func:`_requested` has nothing to say, where the needs are sound."""
    return _are_amounts(requested, len(needed)) and not any(
        ask < need * (1.0 - ROUNDING) for ask, need in zip(requested, needed, strict=True)
    )


def _is_new(identifier: str, seen: dict[str, int], index: int) -> bool:
    """Whether :func:`_identifier` has nothing to say; the id is known from then on."""
    sound = identifier not in seen and fault_of(identifier) is None
    if sound:
        seen[identifier] = index
    return sound


def _amounts(pointer: str, amounts: tuple[float, ...], materials: int | None) -> Iterator[Violation]:
    if materials is not None and len(amounts) != materials:
        yield Violation(pointer, f"{len(amounts)} amounts, but the first UAV carries {materials} materials")
    for k, amount in enumerate(amounts):
        yield from _number(f"{pointer}/{k}", amount, low=0.0)


def _requested(
    pointer: str, requested: tuple[float, ...], needed: tuple[float, ...], materials: int | None
) -> Iterator[Violation]:
    yield from _amounts(pointer, requested, materials)
    for k, (ask, need) in enumerate(zip(requested, needed, strict=False)):
        if ask < need * (1.0 - ROUNDING):
            yield Violation(
                f"{pointer}/{k}", f"{_written(ask)} is less than the {_written(need)} still needed"
            )


def _identifier(at: str, identifier: str, seen: dict[str, int], index: int) -> Iterator[Violation]:
    fault = fault_of(identifier)
    if fault is not None:
        yield Violation(f"{at}/id", fault)
    elif identifier in seen:
        yield Violation(f"{at}/id", f"{identifier!r} is already the id of number {seen[identifier]}")
    else:
        seen[identifier] = index


def _has_tiny(problem: Problem) -> bool:
    """Whether any number of a sound problem is too small to count; one look at all of them."""
    of_uavs = [(u.x_s, u.y_s, u.x_c, u.y_c, u.voyage, u.dis, *u.loadlist) for u in problem.uavs]
    of_targets = [
        (t.x, t.y, t.level, t.deadline or 0.0, t.service_time, *t.loadlist, *(t.requested or t.loadlist))
        for t in problem.targets
    ]
    numbers = np.concatenate(
        [np.ravel(of_uavs), np.ravel(of_targets), [problem.objective.distance_weight or 0.0]]
    )
    return bool(((np.abs(numbers) < MIN_MAGNITUDE) & (numbers != 0.0)).any())


def _without_tiny(item: _Item) -> _Item:
    """Return a UAV, a target or an objective in which every number that is too small to count is 0."""
    changes = {each.name: _settled(getattr(item, each.name)) for each in fields(item)}  # type: ignore[arg-type]  # one of three dataclasses
    return replace(item, **changes)  # type: ignore[type-var]  # as above


def _settled(value: object) -> object:
    if isinstance(value, tuple):
        return tuple(_settled(each) for each in value)
    return 0.0 if isinstance(value, float) and abs(value) < MIN_MAGNITUDE else value
