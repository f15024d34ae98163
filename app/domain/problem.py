"""A task allocation problem: a swarm of UAVs, rescue areas, materials (the paper's Eqs. 6-9).

Everything is frozen and checked when it is built: an object of these classes satisfies the rules of the
problem, and :class:`~app.domain.errors.InvalidProblem` lists every rule that was broken otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Literal, get_args

from app.domain.errors import InvalidProblem
from app.domain.field_checks import Look, look_at, violations_of, without_tiny
from app.domain.fields import (
    ALWAYS_RECORDED,
    MIN_MAGNITUDE,
    Amounts,
    Choice,
    Context,
    Coordinate,
    Flag,
    Identifier,
    Items,
    Named,
    Number,
    Part,
    Whole,
    declared_fields,
    too_few,
)
from app.domain.geometry import distance, longitude_stretch
from app.domain.matrices import Matrix, longest_leg
from app.domain.problem_rules import broken_rules_between_fields
from app.domain.said import said
from app.domain.surroundings import Base, Material, NoFlyZone, Wind
from app.domain.text_fields import Name, Properties, Words
from app.domain.units import DISTANCE, SPEED, TIME, X, Y
from app.domain.world_fields import JointActions

Crs = Literal["local", "wgs84"]
Unloading = Literal["greedy", "planned"]
Loading = Literal["refill", "planned"]

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
    dis: Annotated[float, Number(low=0.0, unit=DISTANCE), "Distance already flown", ALWAYS_RECORDED] = field(
        default=0.0, kw_only=True
    )
    ret: Annotated[
        bool, Flag(digit=True), "1 when it is returning: it gets no more tasks", ALWAYS_RECORDED
    ] = field(default=False, kw_only=True)
    loadlist: Annotated[tuple[float, ...], Amounts(), "Amounts carried, one a material"]
    endurance: Annotated[
        float | None,
        Number(low=MIN_MAGNITUDE, unit=TIME),
        "Longest time in the air in one flight, waiting and unloading included; default: no limit",
    ] = field(default=None, kw_only=True)
    airborne: Annotated[
        float, Number(low=0.0, unit=TIME), "Time already in the air in this flight, as `dis` is for distance"
    ] = field(default=0.0, kw_only=True)
    reserve: Annotated[
        float,
        Number(low=0.0, high=1.0, below=True),
        "Share of `voyage` and of `endurance` that must be left after landing",
    ] = field(default=0.0, kw_only=True)
    available_from: Annotated[
        float, Number(low=0.0, unit=TIME), "Its clock at the start: it takes off no sooner"
    ] = field(default=0.0, kw_only=True)
    available_until: Annotated[
        float | None, Number(unit=TIME), "Latest time to have landed; default: no limit"
    ] = field(default=None, kw_only=True)
    full_load: Annotated[
        tuple[float, ...] | None,
        Amounts(same_as="loadlist"),
        "Amounts that it leaves a base with, as far as they are in stock; default: its `loadlist`",
    ] = field(default=None, kw_only=True)
    capacity: Annotated[
        float | None,
        Number(low=0.0),
        "Most weight that it carries, in the unit of the weights of `materials`; default: no limit",
    ] = field(default=None, kw_only=True)
    skills: Annotated[tuple[str, ...], Words(), "What it can do, in words of your own"] = field(
        default=(), kw_only=True
    )
    excluded: Annotated[
        tuple[str, ...], Words(ids_of="targets"), "Ids of areas that it must not be sent to"
    ] = field(default=(), kw_only=True)
    committed: Annotated[
        tuple[str, ...],
        Words(ids_of="targets"),
        "Ids of areas that it visits first, in this order: promised, or under way",
    ] = field(default=(), kw_only=True)
    bases: Annotated[
        tuple[str, ...] | None,
        Words(ids_of="bases"),
        "Ids of the bases at which it may land and reload; default: all",
    ] = field(default=None, kw_only=True)
    location: Annotated[int | None, Whole(0), "Where it is, as a row of the `matrices`; needed with them"] = (
        field(default=None, kw_only=True)
    )
    home_location: Annotated[
        int | None, Whole(0, same_as="location"), "Its starting point as a row of the `matrices`"
    ] = field(default=None, kw_only=True)
    profile: Annotated[
        str | None, Name(), "Which of the `matrices` its legs are of; default: the only one"
    ] = field(default=None, kw_only=True)
    name: Annotated[str | None, Name(), "Text for people, which need not be unique; default: the id"] = field(
        default=None, kw_only=True
    )
    properties: Annotated[
        dict[str, Any] | None, Properties(), "An object that is kept and given back unread, at most 4 KB"
    ] = field(default=None, kw_only=True, hash=False)

    @property
    def begins_on_ground(self) -> bool:
        """Whether its flight begins at its starting point: then it waits there for its first visit."""
        there = (self.x_c, self.y_c) == (self.x_s, self.y_s)
        there = there and self.home_location in (None, self.location)
        return there and self.dis == 0.0 and self.airborne == 0.0

    @property
    def full(self) -> tuple[float, ...]:
        """Amounts that it leaves a base with, as far as they are in stock."""
        return self.loadlist if self.full_load is None else self.full_load


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
        float | None,
        Number(unit=TIME),
        f"Latest arrival, in {TIME.local} from now; default: none",
        ALWAYS_RECORDED,
    ] = None
    service_time: Annotated[
        float, Number(low=0.0, unit=TIME), "Time spent unloading at a visit", ALWAYS_RECORDED
    ] = 0.0
    requested: Annotated[
        tuple[float, ...] | None,
        Amounts(same_as="loadlist"),
        "Amounts that it asked for at first, one a material, none below its `loadlist`; what a visit earns "
        "is by shares of these, so an area that has nearly all is not as urgent as one that has nothing. "
        "Default: its `loadlist`",
        ALWAYS_RECORDED,
    ] = None
    earliest: Annotated[
        float, Number(low=0.0, unit=TIME), "A visit begins no sooner: a UAV that arrives before waits there"
    ] = 0.0
    skills: Annotated[tuple[str, ...], Words(), "A UAV must have all of these to be sent here"] = ()
    location: Annotated[int | None, Whole(0), "Where it is, as a row of the `matrices`; needed with them"] = (
        None
    )
    name: Annotated[str | None, Name(), "Text for people, which need not be unique; default: the id"] = None
    properties: Annotated[
        dict[str, Any] | None, Properties(), "An object that is kept and given back unread, at most 4 KB"
    ] = field(default=None, hash=False)

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
        for k, (asked, needed) in enumerate(zip(self.requested or (), self.loadlist, strict=False)):
            if asked < needed * (1.0 - ROUNDING):
                detail = said("{asked} is less than the {needed} still needed", asked=asked, needed=needed)
                yield f"/requested/{k}", detail


@dataclass(frozen=True, slots=True)
class Objective:
    """What a plan is paid for."""

    distance_weight: Annotated[
        float | None,
        Number(low=0.0),
        "λ, reward lost per unit of distance; 1 is Eq. (14) to the letter; null: 1 / extent",
        ALWAYS_RECORDED,
    ] = None
    return_to_base: Annotated[
        bool, Flag(), "A visit is allowed only if the UAV can still fly home", ALWAYS_RECORDED
    ] = True
    charge_return: Annotated[bool, Flag(), "The leg home costs reward too", ALWAYS_RECORDED] = False
    unloading: Annotated[
        Unloading,
        Choice(get_args(Unloading)),
        "greedy: a visit unloads all that is needed and carried, the paper's rule. planned: how much it "
        "unloads is decided with the plan, so that a UAV can keep material for a more urgent area",
        ALWAYS_RECORDED,
    ] = "greedy"
    loading: Annotated[
        Loading,
        Choice(get_args(Loading)),
        "refill: at a base a UAV takes what `full_load` says, as far as it is in stock. planned: what it "
        "takes, at most its `capacity`, is decided with the plan; needs `unloading`: planned",
    ] = "refill"
    half_life: Annotated[
        float | None,
        Number(low=MIN_MAGNITUDE, unit=TIME),
        "Time in which what a delivery earns falls to half; default: it does not fall",
    ] = None
    minimum_share: Annotated[
        float,
        Number(low=0.0, high=1.0),
        "Share of what an area needs of a material that earns `minimum_weight` times as much",
    ] = 0.0
    minimum_weight: Annotated[
        float, Number(low=1.0), "How many times as much the first `minimum_share` earns"
    ] = 1.0
    makespan_weight: Annotated[
        float, Number(low=0.0), "Reward lost per unit of time until the last UAV has landed"
    ] = 0.0
    change_weight: Annotated[
        float,
        Number(low=0.0),
        "Reward lost for each pair of UAV and area that is visited in `start_plan` and not in the plan",
    ] = 0.0


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
    max_steps: Annotated[int, Whole(1, MAX_STEPS), "Most decision steps of a plan, S", ALWAYS_RECORDED] = 5
    crs: Annotated[
        Crs,
        Choice(get_args(Crs)),
        "local: x, y on a plane, Euclidean distances. wgs84: x longitude and y latitude in degrees, great "
        f"circles in {DISTANCE.wgs84}, speeds in {SPEED.wgs84}, times in {TIME.wgs84}",
        ALWAYS_RECORDED,
    ] = "local"
    objective: Annotated[Objective, Part(Objective), "What a plan is paid for", ALWAYS_RECORDED] = field(
        default_factory=Objective
    )
    materials: Annotated[
        tuple[Material, ...],
        Items(Material, called="materials"),
        "The kinds of material, in the order of every `loadlist`; default: material-1, … of weight 1",
    ] = ()
    bases: Annotated[
        tuple[Base, ...],
        Items(Base, called="bases"),
        "Where UAVs land, reload and take off again; at the end each lands at the nearest, or where it began",
    ] = ()
    no_fly_zones: Annotated[
        tuple[NoFlyZone, ...], Items(NoFlyZone, called="no-fly zones"), "What must not be flown through"
    ] = ()
    wind: Annotated[Wind | None, Part(Wind), "Wind; default: still air"] = None
    matrices: Annotated[
        dict[str, Matrix] | None,
        Named(Matrix, called="profiles"),
        "Legs by the names of profiles, in place of distances between positions; then coordinates are for "
        "display alone",
    ] = field(default=None, hash=False)
    start_plan: Annotated[
        tuple[tuple[int, ...], ...] | None,
        JointActions(),
        "An `assignment` to begin from and to compare with; no answer that takes a start earns less",
    ] = None

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
        """Yield that there are no materials, whose number the first UAV says, and rules between fields."""
        if self.uavs and not self.uavs[0].loadlist:
            yield "/uavs/0/loadlist", too_few(0, "materials", 1)
        yield from broken_rules_between_fields(self)

    @property
    def n_uavs(self) -> int:
        """Size of the swarm, M."""
        return len(self.uavs)

    @property
    def n_targets(self) -> int:
        """Number of rescue areas, N; also the action that sends a UAV home."""
        return len(self.targets)

    @property
    def n_bases(self) -> int:
        """Number of bases, D; action N + 1 + d sends a UAV to base d, to reload."""
        return len(self.bases)

    @property
    def n_materials(self) -> int:
        """Number of kinds of material, K."""
        return len(self.uavs[0].loadlist)

    @property
    def plans_unloading(self) -> bool:
        """Whether how much a visit unloads is decided with the plan."""
        return self.objective.unloading == "planned"

    @property
    def plans_loading(self) -> bool:
        """Whether how much a reload takes is decided with the plan."""
        return self.objective.loading == "planned" and bool(self.bases)

    @property
    def weights(self) -> tuple[float, ...]:
        """Weight of one unit of each material, K."""
        return tuple(each.weight for each in self.materials) or (1.0,) * self.n_materials

    @cached_property
    def extent(self) -> float:
        """Diagonal of the bounding box of all positions, in distance units; 1 if it is zero.

        On the globe the box is over the shortest stretch of longitudes that holds them all, so it may cross
        the antimeridian, and less than 1e-9 km is zero. With matrices it is the longest leg instead.
        """
        if self.matrices is not None:
            return longest_leg(self.matrices.values()) or 1.0
        stops: tuple[Target | Base, ...] = (*self.targets, *self.bases)
        xs = [x for u in self.uavs for x in (u.x_s, u.x_c)] + [stop.x for stop in stops]
        ys = [y for u in self.uavs for y in (u.y_s, u.y_c)] + [stop.y for stop in stops]
        on_globe = self.crs == "wgs84"
        west, east = longitude_stretch(xs) if on_globe else (min(xs), max(xs))
        diagonal = distance(self.crs, west, min(ys), east, max(ys))
        return diagonal if diagonal >= (_SAME_PLACE_KM if on_globe else MIN_MAGNITUDE) else 1.0

    @property
    def distance_weight(self) -> float:
        """λ as it is used: the objective's, or 1 / extent."""
        given = self.objective.distance_weight
        return 1.0 / self.extent if given is None else given
