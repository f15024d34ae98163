"""What can happen to a mission: each kind of event is a dataclass with declared fields.

Their check, record and place in requests follow from the declarations, as those of a problem do
(:mod:`app.domain.fields`). Areas, UAVs, zones and wind are those of the problem.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from app.domain.errors import Violation
from app.domain.field_checks import violations_of
from app.domain.fields import Amounts, Context, Coordinate, Items, Number, Part, Whole
from app.domain.problem import UAV, Target
from app.domain.records import from_values, item_to_record
from app.domain.surroundings import NoFlyZone, Wind
from app.domain.text_fields import Name
from app.domain.units import DISTANCE, TIME, X, Y

_UAV = "The UAV"
_AREA = "The rescue area"
_BASE = "The base"
_DONE_AT = "When it was done, no later than `at`; default: `at`"


@dataclass(frozen=True, slots=True)
class Position:
    """Where a UAV is, and what it has used."""

    uav_id: Annotated[str, Name(), _UAV]
    time: Annotated[float, Number(low=0.0, unit=TIME), "When it was there, by the mission's clock"]
    x: Annotated[float, Coordinate(axis=X), f"Position: {X}"]
    y: Annotated[float, Coordinate(axis=Y), f"Position: {Y}"]
    dis: Annotated[
        float | None, Number(low=0.0, unit=DISTANCE), "Distance flown in this flight; default: as planned"
    ] = None
    airborne: Annotated[
        float | None, Number(low=0.0, unit=TIME), "Time in the air in this flight; default: as planned"
    ] = None
    location: Annotated[
        int | None, Whole(0), "Where it is, as a row of the `matrices`; default: as planned"
    ] = None


@dataclass(frozen=True, slots=True)
class Telemetry:
    """Positions of UAVs, and what they have used.

    They count from the next event of another type on. One that is older than what is known of its UAV is
    passed over.
    """

    positions: Annotated[tuple[Position, ...], Items(Position, called="positions", least=1), "The positions"]


@dataclass(frozen=True, slots=True)
class Clock:
    """Time has passed, and what is planned until then has happened."""


@dataclass(frozen=True, slots=True)
class VisitDone:
    """A UAV has visited an area."""

    uav_id: Annotated[str, Name(), _UAV]
    target_id: Annotated[str, Name(), _AREA]
    delivered: Annotated[tuple[float, ...], Amounts(), "Amounts that it has really unloaded, one a material"]
    time: Annotated[float | None, Number(low=0.0, unit=TIME), _DONE_AT] = None


@dataclass(frozen=True, slots=True)
class ReloadDone:
    """A UAV has reloaded at a base."""

    uav_id: Annotated[str, Name(), _UAV]
    base_id: Annotated[str, Name(), _BASE]
    loadlist: Annotated[tuple[float, ...], Amounts(), "Amounts that are aboard now, one a material"]
    time: Annotated[float | None, Number(low=0.0, unit=TIME), _DONE_AT] = None


@dataclass(frozen=True, slots=True)
class UavLost:
    """A UAV is lost: it makes no more visits, and what is aboard does not arrive."""

    uav_id: Annotated[str, Name(), _UAV]


@dataclass(frozen=True, slots=True)
class UavsAdded:
    """UAVs are there that were not; each with an id that is new."""

    uavs: Annotated[tuple[UAV, ...], Items(UAV, called="UAVs", least=1), "The UAVs"]


@dataclass(frozen=True, slots=True)
class UavDelayed:
    """A UAV stays where it is for some time; in the air that is time in the air."""

    uav_id: Annotated[str, Name(), _UAV]
    until: Annotated[float, Number(low=0.0, unit=TIME), "When it goes on"]


@dataclass(frozen=True, slots=True)
class AreasAdded:
    """Rescue areas are there that were not known; each with an id that is new."""

    targets: Annotated[tuple[Target, ...], Items(Target, called="targets", least=1), "The areas"]


@dataclass(frozen=True, slots=True)
class AreasChanged:
    """Rescue areas are now as they stand here, each with an id that is known.

    `loadlist` is what is still needed; without `requested` it is that and what was unloaded so far.
    """

    targets: Annotated[tuple[Target, ...], Items(Target, called="targets", least=1), "The areas"]


@dataclass(frozen=True, slots=True)
class AreaCancelled:
    """A rescue area needs nothing any more."""

    target_id: Annotated[str, Name(), _AREA]


@dataclass(frozen=True, slots=True)
class LevelChanged:
    """The emergency level of an area has changed."""

    target_id: Annotated[str, Name(), _AREA]
    level: Annotated[float, Number(low=0.0), "Emergency level; larger is more urgent"]


@dataclass(frozen=True, slots=True)
class StockChanged:
    """The stock of a base is now another one."""

    base_id: Annotated[str, Name(), _BASE]
    stock: Annotated[
        tuple[float, ...] | None,
        Amounts(),
        "Amounts in stock, one a material; default: as much as is asked for",
    ] = None


@dataclass(frozen=True, slots=True)
class ZonesChanged:
    """The no-fly zones are now these, and no others."""

    no_fly_zones: Annotated[
        tuple[NoFlyZone, ...], Items(NoFlyZone, called="no-fly zones"), "All zones there are now"
    ]


@dataclass(frozen=True, slots=True)
class WindChanged:
    """The wind is now another one."""

    wind: Annotated[Wind | None, Part(Wind), "Wind; default: still air"] = None


@dataclass(frozen=True, slots=True)
class ProposalAccepted:
    """A proposal becomes the plan in force."""

    proposal: Annotated[int, Whole(1), "Number of the proposal"]


@dataclass(frozen=True, slots=True)
class ProposalRefused:
    """A proposal is not wanted; the plan in force stays."""

    proposal: Annotated[int, Whole(1), "Number of the proposal"]


Event = (
    Telemetry
    | Clock
    | VisitDone
    | ReloadDone
    | UavLost
    | UavsAdded
    | UavDelayed
    | AreasAdded
    | AreasChanged
    | AreaCancelled
    | LevelChanged
    | StockChanged
    | ZonesChanged
    | WindChanged
    | ProposalAccepted
    | ProposalRefused
)

TYPES: Mapping[str, type[Any]] = {
    "telemetry": Telemetry,
    "clock": Clock,
    "visit_done": VisitDone,
    "reload_done": ReloadDone,
    "uav_lost": UavLost,
    "uavs_added": UavsAdded,
    "uav_delayed": UavDelayed,
    "areas_added": AreasAdded,
    "areas_changed": AreasChanged,
    "area_cancelled": AreaCancelled,
    "level_changed": LevelChanged,
    "stock_changed": StockChanged,
    "zones_changed": ZonesChanged,
    "wind_changed": WindChanged,
    "proposal_accepted": ProposalAccepted,
    "proposal_refused": ProposalRefused,
}
"""The kinds of events that clients send, by the ``type`` that requests and records have."""

BEGUN, PROPOSED = "begun", "plan_proposed"
"""Types of what the service itself writes into the history: the first event, and a new proposal."""

_NAMES = {kind: name for name, kind in TYPES.items()}


def type_of(event: Event) -> str:
    """Return the ``type`` of an event."""
    return _NAMES[type(event)]


def event_to_record(event: Event) -> dict[str, Any]:
    """Turn an event into what JSON can hold, with its ``type``."""
    return {"type": type_of(event), **item_to_record(event)}


def event_from_record(record: Mapping[str, Any]) -> Event:
    """Turn a record of :func:`event_to_record` into the event."""
    values = {name: value for name, value in record.items() if name != "type"}
    event: Event = from_values([values], TYPES[record["type"]])[0]
    return event


def broken_rules(event: Event, context: Context) -> Iterator[Violation]:
    """Yield what is wrong with an event's fields, each for itself; pointers are into the event."""
    return violations_of(event, "", context)
