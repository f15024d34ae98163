"""A task allocation problem: a swarm of UAVs, rescue areas, materials (the paper's Eqs. 6-9).

Everything is frozen and checked when it is built: an object of these classes satisfies the rules of the
problem, and :class:`~app.domain.errors.InvalidProblem` lists every rule that was broken otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from app.domain.errors import InvalidProblem, Violation
from app.domain.geometry import distance

Crs = Literal["local", "wgs84"]
Unloading = Literal["greedy", "planned"]

MAX_STEPS = 100
"""Largest number of decision steps a problem may ask for."""

MAX_MAGNITUDE = 1e12
"""Largest absolute value of any number of a problem: keeps every sum and product of the simulator finite."""

MIN_SPEED = 1e-9
"""Smallest speed; below it arrival times would leave the range of floating-point numbers."""

MAX_ID_LENGTH = 100
"""Longest identifier of a UAV or a target, in characters."""


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
    """

    id: str
    x: float
    y: float
    level: float
    loadlist: tuple[float, ...]
    deadline: float | None = None
    service_time: float = 0.0


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
        """Diagonal of the bounding box of all positions, in distance units; 1 if it is zero."""
        xs = [x for u in self.uavs for x in (u.x_s, u.x_c)] + [t.x for t in self.targets]
        ys = [y for u in self.uavs for y in (u.y_s, u.y_c)] + [t.y for t in self.targets]
        diagonal = distance(self.crs, min(xs), min(ys), max(xs), max(ys))
        return diagonal if diagonal > 0 else 1.0

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
            and MIN_SPEED <= uav.speed <= MAX_MAGNITUDE
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
        yield from _number(f"{at}/speed", uav.speed, low=MIN_SPEED)
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


def _number(
    pointer: str, value: float, low: float = -MAX_MAGNITUDE, high: float = MAX_MAGNITUDE
) -> Iterator[Violation]:
    if not math.isfinite(value):
        yield Violation(pointer, f"{value} is not a finite number")
    elif not low <= value <= high:
        yield Violation(pointer, f"{value:g} is not in {low:g}..{high:g}")


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


def _is_new(identifier: str, seen: dict[str, int], index: int) -> bool:
    """Whether :func:`_identifier` has nothing to say; the id is known from then on."""
    sound = 1 <= len(identifier) <= MAX_ID_LENGTH and identifier.isprintable() and identifier not in seen
    if sound:
        seen[identifier] = index
    return sound


def _amounts(pointer: str, amounts: tuple[float, ...], materials: int | None) -> Iterator[Violation]:
    if materials is not None and len(amounts) != materials:
        yield Violation(pointer, f"{len(amounts)} amounts, but the first UAV carries {materials} materials")
    for k, amount in enumerate(amounts):
        yield from _number(f"{pointer}/{k}", amount, low=0.0)


def _identifier(at: str, identifier: str, seen: dict[str, int], index: int) -> Iterator[Violation]:
    if not 1 <= len(identifier) <= MAX_ID_LENGTH:
        yield Violation(f"{at}/id", f"{len(identifier)} characters, not in 1..{MAX_ID_LENGTH}")
    elif not identifier.isprintable():
        yield Violation(f"{at}/id", f"{identifier!a} has characters that cannot be printed")
    elif identifier in seen:
        yield Violation(f"{at}/id", f"{identifier!r} is already the id of number {seen[identifier]}")
    else:
        seen[identifier] = index
