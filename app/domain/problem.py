"""A task allocation problem: a swarm of UAVs, rescue areas, materials (the paper's Eqs. 6-9).

Everything is frozen and checked when it is built: an object of these classes satisfies the rules of the
problem, and :class:`~app.domain.errors.InvalidProblem` lists every rule that was broken otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Literal, get_args

from app.domain.errors import InvalidProblem
from app.domain.field_checks import Look, look_at, violations_of, without_tiny
from app.domain.fields import (
    MIN_MAGNITUDE,
    Amounts,
    Choice,
    Context,
    Coordinate,
    Flag,
    Identifier,
    Items,
    Number,
    Part,
    Whole,
    declared_fields,
    written,
)
from app.domain.geometry import distance, longitude_stretch
from app.domain.units import DISTANCE, SPEED, TIME, X, Y

Crs = Literal["local", "wgs84"]
Unloading = Literal["greedy", "planned"]

MAX_STEPS = 100
"""Largest number of decision steps a problem may ask for."""

TOLERANCE = 1e-6
"""Relative tolerance of the comparisons with range and deadline."""

ROUNDING = 1e-9
"""Share of an amount: a part of it that is smaller is rounding, and counts as nothing."""

_SAME_PLACE_KM = 1e-9
"""Extent on the globe below which all positions are one place."""


@dataclass(frozen=True, slots=True)
class UAV:
    """One UAV (Eq. 7 of the paper)."""

    id: Annotated[
        str,
        Identifier(stem="uav"),
        "Unique in the swarm; default: uav-1, uav-2, … by place in the list",
    ]
    x_s: Annotated[float, Coordinate(axis=X), f"Starting point, where it returns to: {X}"]
    y_s: Annotated[float, Coordinate(axis=Y), f"Starting point: {Y}"]
    x_c: Annotated[float, Coordinate(axis=X, same_as="x_s"), "Current position; default: the starting point"]
    y_c: Annotated[float, Coordinate(axis=Y, same_as="y_s"), "Current position; default: the starting point"]
    speed: Annotated[float, Number(low=MIN_MAGNITUDE, unit=SPEED), f"Average speed: {SPEED}"]
    voyage: Annotated[float, Number(low=0.0, unit=DISTANCE), f"Maximum range of one flight, in {DISTANCE}"]
    dis: Annotated[float, Number(low=0.0, unit=DISTANCE), "Distance already flown"] = field(
        default=0.0, kw_only=True
    )
    ret: Annotated[bool, Flag(digit=True), "1 when it is returning: it gets no more tasks"] = field(
        default=False, kw_only=True
    )
    loadlist: Annotated[tuple[float, ...], Amounts(), "Amounts carried, one a material"]


@dataclass(frozen=True, slots=True)
class Target:
    """One rescue area (Eq. 9 of the paper).

    It has the time window of the paper's future work.
    """

    id: Annotated[
        str,
        Identifier(stem="area"),
        "Unique among the targets; default: area-1, area-2, … by place in the list",
    ]
    x: Annotated[float, Coordinate(axis=X), f"Position: {X}"]
    y: Annotated[float, Coordinate(axis=Y), f"Position: {Y}"]
    level: Annotated[float, Number(low=0.0), "Emergency level; larger is more urgent"]
    loadlist: Annotated[tuple[float, ...], Amounts(), "Amounts still needed, one a material"]
    deadline: Annotated[
        float | None, Number(unit=TIME), f"Latest arrival, in {TIME.local} from now; default: none"
    ] = None
    service_time: Annotated[float, Number(low=0.0, unit=TIME), "Time spent unloading at a visit"] = 0.0
    requested: Annotated[
        tuple[float, ...] | None,
        Amounts(same_as="loadlist"),
        "Amounts that it asked for at first, one a material, none below its `loadlist`; what a visit earns "
        "is by shares of these, so an area that has nearly all is not as urgent as one that has nothing. "
        "Default: its `loadlist`",
    ] = None

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

    def broken_rules(self) -> Iterator[tuple[str, str]]:
        """Yield the amounts of ``requested`` that are less than what is still needed."""
        if self.requested is None:
            return
        for k, (asked, needed) in enumerate(zip(self.requested, self.loadlist, strict=False)):
            if asked < needed * (1.0 - ROUNDING):
                yield (
                    f"/requested/{k}",
                    f"{written(asked)} is less than the {written(needed)} still needed",
                )


@dataclass(frozen=True, slots=True)
class Objective:
    """What a plan is paid for."""

    distance_weight: Annotated[
        float | None,
        Number(low=0.0),
        "λ, reward lost per unit of distance; 1 is Eq. (14) to the letter; null: 1 / extent",
    ] = None
    return_to_base: Annotated[bool, Flag(), "A visit is allowed only if the UAV can still fly home"] = True
    charge_return: Annotated[bool, Flag(), "The leg home costs reward too"] = False
    unloading: Annotated[
        Unloading,
        Choice(get_args(Unloading)),
        "greedy: a visit unloads all that is needed and carried, the paper's rule. planned: how much it "
        "unloads is decided with the plan, so that a UAV can keep material for a more urgent area",
    ] = "greedy"


@dataclass(frozen=True)
class Problem:
    """A swarm, rescue areas, and what a plan is paid for.

    M UAVs, N targets, K materials and at most S decision steps.

    Raises
    ------
    InvalidProblem
        With a violation for every broken rule; pointers are relative to the problem.
    """

    uavs: Annotated[tuple[UAV, ...], Items(UAV, called="UAVs", least=1), "The swarm"]
    targets: Annotated[tuple[Target, ...], Items(Target, called="targets", least=1), "The rescue areas"]
    max_steps: Annotated[int, Whole(1, MAX_STEPS), "Most decision steps of a plan, S"] = 5
    crs: Annotated[
        Crs,
        Choice(get_args(Crs)),
        "local: x, y on a plane, Euclidean distances. wgs84: x longitude and y latitude in degrees, great "
        f"circles in {DISTANCE.wgs84}, speeds in {SPEED.wgs84}, times in {TIME.wgs84}",
    ] = "local"
    objective: Annotated[Objective, Part(Objective), "What a plan is paid for"] = field(
        default_factory=Objective
    )

    def __post_init__(self) -> None:
        context = Context(self.crs, len(self.uavs[0].loadlist) if self.uavs else None)
        found = look_at([self], Problem, context)
        if found is Look.WRONG:
            violations = list(violations_of(self, "", context))
            if violations:
                raise InvalidProblem.of(violations)
        if found is not Look.SOUND:
            for each in declared_fields(Problem):
                object.__setattr__(self, each.name, without_tiny(getattr(self, each.name)))

    def broken_rules(self) -> Iterator[tuple[str, str]]:
        """Yield that there are no materials; how many there are, the first UAV says."""
        if self.uavs and not self.uavs[0].loadlist:
            yield "/uavs/0/loadlist", "0 materials; at least 1 is needed"

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
