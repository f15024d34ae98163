"""What surrounds a swarm and its areas: kinds of material, bases, no-fly zones, wind."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

from app.domain.fields import Amounts, Coordinate, Identifier, Number, Whole
from app.domain.text_fields import Name, Properties
from app.domain.units import SPEED, TIME, X, Y
from app.domain.world_fields import Corners


@dataclass(frozen=True, slots=True)
class Material:
    """A kind of relief material."""

    name: Annotated[
        str,
        Identifier(stem="material", unique=False),
        "Text for people; default: material-1, material-2, … by place in the list",
    ]
    weight: Annotated[float, Number(low=0.0), "Weight of one unit"] = 1.0


@dataclass(frozen=True, slots=True)
class Base:
    """A place where UAVs land, reload, and take off again."""

    id: Annotated[
        str,
        Identifier(stem="base"),
        "Unique among the bases; default: base-1, base-2, … by place in the list",
    ]
    x: Annotated[float, Coordinate(axis=X), f"Position: {X}"]
    y: Annotated[float, Coordinate(axis=Y), f"Position: {Y}"]
    stock: Annotated[
        tuple[float, ...] | None,
        Amounts(),
        "Amounts in stock, one a material; default: as much as is asked for",
    ] = None
    turnaround: Annotated[float, Number(low=0.0, unit=TIME), "Time from landing until it takes off again"] = (
        0.0
    )
    location: Annotated[int | None, Whole(0), "Where it is, as a row of the `matrices`; needed with them"] = (
        None
    )
    name: Annotated[str | None, Name(), "Text for people, which need not be unique; default: the id"] = None
    properties: Annotated[
        dict[str, Any] | None, Properties(), "An object that is kept and given back unread, at most 4 KB"
    ] = field(default=None, hash=False)


@dataclass(frozen=True, slots=True)
class NoFlyZone:
    """A polygon that must not be flown through; its border may be touched.

    A last corner that is the first one again, which closes the polygon in some formats, is dropped.
    """

    id: Annotated[
        str,
        Identifier(stem="zone"),
        "Unique among the zones; default: zone-1, zone-2, … by place in the list",
    ]
    polygon: Annotated[
        tuple[tuple[float, float], ...],
        Corners(),
        "Corners `[x, y]` in either direction, at least 3; no two sides cross. A last corner that is the "
        "first one again is dropped",
    ]
    name: Annotated[str | None, Name(), "Text for people, which need not be unique; default: the id"] = None
    properties: Annotated[
        dict[str, Any] | None, Properties(), "An object that is kept and given back unread, at most 4 KB"
    ] = field(default=None, hash=False)

    def __post_init__(self) -> None:
        if len(self.polygon) > 1 and self.polygon[0] == self.polygon[-1]:
            object.__setattr__(self, "polygon", self.polygon[:-1])


@dataclass(frozen=True, slots=True)
class Wind:
    """A wind that is the same everywhere."""

    speed: Annotated[float, Number(low=0.0, unit=SPEED), f"Its speed: {SPEED}"]
    towards: Annotated[
        float,
        Number(low=-360.0, high=360.0),
        "Where it blows to, in degrees clockwise from north, which is +y",
    ]
