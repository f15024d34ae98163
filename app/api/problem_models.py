"""A problem on the wire, and its conversion to the domain; the rules between fields are the domain's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from app.domain.errors import InvalidProblem, ProblemTooLarge, Violation
from app.domain.identifiers import ID_PATTERN, MAX_ID_LENGTH
from app.domain.problem import (
    MAX_MAGNITUDE,
    MAX_STEPS,
    MIN_MAGNITUDE,
    UAV,
    Objective,
    Problem,
    Target,
)
from app.settings import Settings


def _without_point(given: object) -> object:
    return int(given) if isinstance(given, float) and given.is_integer() else given


Coordinate = Annotated[float, Field(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]
Amount = Annotated[float, Field(ge=0, le=MAX_MAGNITUDE)]
Whole = Annotated[int, BeforeValidator(_without_point)]
"""An integer as JSON Schema has it: 1.0 is one too, which is what some languages write."""
Identifier = Annotated[
    str,
    # The domain checks the pattern, and names the character that breaks it.
    Field(min_length=1, max_length=MAX_ID_LENGTH, json_schema_extra={"pattern": ID_PATTERN}),
]


class WireModel(BaseModel):
    """Base of everything a request can hold: no unknown fields, no conversions, no NaN, no infinity."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


class UAVModel(WireModel):
    """One UAV (Eq. 7 of the paper)."""

    id: Identifier | None = Field(
        default=None, description="Unique in the swarm; default: uav-1, uav-2, … by place in the list"
    )
    x_s: Coordinate = Field(description="Starting point, where it returns to: x, or longitude in degrees")
    y_s: Coordinate = Field(description="Starting point: y, or latitude in degrees")
    x_c: Coordinate | None = Field(default=None, description="Current position; default: the starting point")
    y_c: Coordinate | None = Field(default=None, description="Current position; default: the starting point")
    speed: float = Field(
        ge=MIN_MAGNITUDE,
        le=MAX_MAGNITUDE,
        description="Average speed: distance units per time unit, or km/h",
    )
    voyage: Amount = Field(description="Maximum range of one flight, in distance units, or km")
    dis: Amount = Field(default=0.0, description="Distance already flown")
    ret: Whole = Field(default=0, ge=0, le=1, description="1 when it is returning: it gets no more tasks")
    loadlist: list[Amount] = Field(min_length=1, description="Amounts carried, one a material")


class TargetModel(WireModel):
    """One rescue area (Eq. 9 of the paper)."""

    id: Identifier | None = Field(
        default=None, description="Unique among the targets; default: area-1, area-2, … by place in the list"
    )
    x: Coordinate = Field(description="Position: x, or longitude in degrees")
    y: Coordinate = Field(description="Position: y, or latitude in degrees")
    level: Amount = Field(description="Emergency level; larger is more urgent")
    loadlist: list[Amount] = Field(min_length=1, description="Amounts still needed, one a material")
    deadline: Coordinate | None = Field(
        default=None, description="Latest arrival, in time units from now; default: none"
    )
    service_time: Amount = Field(default=0.0, description="Time spent unloading at a visit")
    requested: list[Amount] | None = Field(
        default=None,
        min_length=1,
        description="Amounts that it asked for at first, one a material, none below its `loadlist`; what a "
        "visit earns is by shares of these, so an area that has nearly all is not as urgent as one that has "
        "nothing. Default: its `loadlist`",
    )


class ObjectiveModel(WireModel):
    """What a plan is paid for."""

    distance_weight: Amount | None = Field(
        default=None,
        description="λ, reward lost per unit of distance; 1 is Eq. (14) to the letter; null: 1 / extent",
    )
    return_to_base: bool = Field(
        default=True, description="A visit is allowed only if the UAV can still fly home"
    )
    charge_return: bool = Field(default=False, description="The leg home costs reward too")
    unloading: Literal["greedy", "planned"] = Field(
        default="greedy",
        description="greedy: a visit unloads all that is needed and carried, the paper's rule. planned: how "
        "much it unloads is decided with the plan, so that a UAV can keep material for a more urgent area",
    )


class ProblemModel(WireModel):
    """A swarm, rescue areas, and what a plan is paid for."""

    uavs: list[UAVModel] = Field(min_length=1, description="The swarm")
    targets: list[TargetModel] = Field(min_length=1, description="The rescue areas")
    max_steps: Whole = Field(default=5, ge=1, le=MAX_STEPS, description="Most decision steps of a plan, S")
    crs: Literal["local", "wgs84"] = Field(
        default="local",
        description="local: x, y on a plane, Euclidean distances. wgs84: x longitude and y latitude in "
        "degrees, great circles in km, speeds in km/h, times in h",
    )
    objective: ObjectiveModel = Field(default_factory=ObjectiveModel, description="What a plan is paid for")

    @classmethod
    def require_sizes(cls, body: Mapping[str, Any], settings: Settings, at: str) -> None:
        """Refuse a problem that is too large before its items are looked at.

        Raises
        ------
        ProblemTooLarge
            As :func:`to_problem` does.
        """
        uavs, targets = (_items(body.get(name)) for name in ("uavs", "targets"))
        first = uavs[0] if uavs and isinstance(uavs[0], Mapping) else {}
        _refuse_oversize(len(uavs), len(targets), len(_items(first.get("loadlist"))), settings, at)


def _items(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def to_problem(body: ProblemModel, settings: Settings, at: str = "") -> Problem:
    """Convert a problem to the domain.

    Parameters
    ----------
    body
        The problem as it was sent.
    settings
        The sizes that are taken.
    at
        JSON pointer of the problem in the request's body.

    Raises
    ------
    ProblemTooLarge
        If it has more UAVs, targets or materials than are taken.
    InvalidProblem
        If it breaks a rule between fields. Pointers of both are into the request's body.
    """
    _refuse_oversize(len(body.uavs), len(body.targets), len(body.uavs[0].loadlist), settings, at)
    try:
        return Problem(
            uavs=tuple(_uav(uav, number) for number, uav in enumerate(body.uavs, 1)),
            targets=tuple(_target(target, number) for number, target in enumerate(body.targets, 1)),
            max_steps=body.max_steps,
            crs=body.crs,
            objective=Objective(**body.objective.model_dump()),
        )
    except InvalidProblem as error:
        raise InvalidProblem.of([Violation(at + v.pointer, v.detail) for v in error.violations]) from None


def _refuse_oversize(n_uavs: int, n_targets: int, n_materials: int, settings: Settings, at: str) -> None:
    sizes = (
        ("/uavs", "UAVs", n_uavs, settings.max_uavs),
        ("/targets", "targets", n_targets, settings.max_targets),
        ("/uavs/0/loadlist", "materials", n_materials, settings.max_materials),
    )
    violations = [
        Violation(at + pointer, f"{size} {what}, at most {limit} are taken")
        for pointer, what, size, limit in sizes
        if size > limit
    ]
    if violations:
        detail = "; ".join(violation.detail for violation in violations)
        raise ProblemTooLarge(detail, violations)


def _uav(body: UAVModel, number: int) -> UAV:
    return UAV(
        id=f"uav-{number}" if body.id is None else body.id,
        x_s=body.x_s,
        y_s=body.y_s,
        x_c=body.x_s if body.x_c is None else body.x_c,
        y_c=body.y_s if body.y_c is None else body.y_c,
        speed=body.speed,
        voyage=body.voyage,
        dis=body.dis,
        ret=bool(body.ret),
        loadlist=tuple(body.loadlist),
    )


def _target(body: TargetModel, number: int) -> Target:
    return Target(
        id=f"area-{number}" if body.id is None else body.id,
        x=body.x,
        y=body.y,
        level=body.level,
        loadlist=tuple(body.loadlist),
        deadline=body.deadline,
        service_time=body.service_time,
        # What is the default is the same problem, written out or not.
        requested=None if body.requested in (None, body.loadlist) else tuple(body.requested),
    )
