"""Missions on the wire: what is asked, what happens, and what is answered."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from inspect import getdoc
from typing import Annotated, Any, Literal, Union

from pydantic import Discriminator, Field, Tag, create_model

from app.api.allocation_models import MAX_SEED, MAX_TIME_LIMIT_S, AnswerModel, RouteModel
from app.api.job_models import JobErrorModel
from app.api.library_models import PolicyName
from app.api.problem_models import ProblemModel
from app.api.wire_fields import Identifier, Whole, WireModel, wire_model
from app.domain.fields import MAX_MAGNITUDE
from app.missions import events
from app.missions.effects import GONE
from app.missions.model import Plans, ProposalStatus
from app.solvers.registry import ALGORITHMS

MISSION_ID_PATTERN = "^[0-9a-f]{32}$"
MAX_NUMBER = 2**31 - 1
Number = Annotated[Whole, Field(ge=0, le=MAX_NUMBER)]


class MissionRequest(WireModel):
    """A problem, and how to plan it in the course of a day."""

    name: PolicyName | None = Field(default=None, description="For people; need not be unique")
    problem: ProblemModel = Field(
        description="The problem as it stands at the beginning; its `start_plan` is the first plan in force"
    )
    algorithm: str = Field(
        default="auto", description="See `GET /algorithms`", json_schema_extra={"enum": list(ALGORITHMS)}
    )
    parameters: dict[str, Any] = Field(
        default_factory=dict, description="The algorithm's own; the others keep their defaults"
    )
    seed: Whole = Field(default=123, ge=0, le=MAX_SEED, description="Source of all randomness")
    time_limit_s: float = Field(
        default=1.0, gt=0, le=MAX_TIME_LIMIT_S, description="Seconds that each search for a plan has"
    )
    change_weight: float | None = Field(
        default=None,
        ge=0,
        le=MAX_MAGNITUDE,
        description="Reward lost for each visit of the plan in force that a new one does not make; default: "
        "the objective's",
    )
    plans: Plans = Field(
        default="proposed",
        description="automatic: new plans take effect by themselves. proposed: when they are accepted",
    )


def _event_model(name: str, of: type) -> type[WireModel]:
    about = (getdoc(of) or "").partition("\n\n")[0]
    given: dict[str, Any] = {
        "type": (Literal[name], Field(description="What has happened")),
        "id": (
            Identifier,
            Field(
                description="A name of your own for this event; told again with it, it is not a second one"
            ),
        ),
    }
    if of is not events.Telemetry:
        given["at"] = (
            float | None,
            Field(
                default=None,
                ge=0,
                le=MAX_MAGNITUDE,
                description="When it became known, by the mission's clock, and not before that; default: "
                "at that clock, or when a UAV was seen last",
            ),
        )
    return create_model(f"{of.__name__}Event", __base__=wire_model(of), __doc__=about, **given)


EVENT_MODELS: Mapping[str, type[WireModel]] = {
    name: _event_model(name, of) for name, of in events.TYPES.items()
}
"""The models of events by their types."""


def _type_of(body: Any) -> str | None:
    given = body.get("type") if isinstance(body, Mapping) else getattr(body, "type", None)
    return given if isinstance(given, str) and given in EVENT_MODELS else None


EventRequest: Any = Annotated[
    Union[tuple(Annotated[model, Tag(name)] for name, model in EVENT_MODELS.items())],  # noqa: UP007 - of many
    Discriminator(
        _type_of,
        custom_error_type="event_type",
        custom_error_message=f"`type` has to be one of {', '.join(EVENT_MODELS)}",
    ),
]


class PlanningModel(AnswerModel):
    """How a mission is planned."""

    algorithm: str = Field(description="What looks for plans")
    parameters: dict[str, Any] = Field(description="Its parameters, defaults filled in")
    seed: int = Field(description="The seed of each search")
    time_limit_s: float = Field(description="Seconds that each search has")
    plans: Plans = Field(description="Whether new plans take effect by themselves, or are proposed")


class MissionModel(AnswerModel):
    """A mission without its state."""

    id: str = Field(description="32 hexadecimal digits")
    name: str | None = Field(description="For people")
    clock: float = Field(description="The mission's clock: that of the newest event that made a state")
    last_number: int = Field(description="Number of the newest event")
    state_number: int = Field(description="Number of the newest event that made a state")
    searching: bool = Field(
        description="Whether a plan is looked for, or soon will be, or is about to take effect"
    )
    planning: PlanningModel = Field(description="How it is planned")
    trouble: JobErrorModel | None = Field(description="Why the newest search failed, if it did")
    created_at: datetime = Field(description="When it was begun, UTC")


class MissionList(AnswerModel):
    """A page of missions."""

    missions: list[MissionModel] = Field(description="Newest first")
    next_cursor: str | None = Field(description="`cursor` of the next page; null on the last")


class StopRef(AnswerModel):
    """A stop: an area that is visited, or a base where a UAV reloads."""

    target_id: str | None = Field(default=None, description="The area; absent for a reload")
    base_id: str | None = Field(default=None, description="The base; absent for a visit")


class DoneModel(StopRef):
    """A stop that is over."""

    uav_id: str = Field(description="The UAV")
    time: float = Field(description="When, by the mission's clock")
    amounts: list[float] = Field(description="What was unloaded, or taken up, one a material")
    reported: bool = Field(description="Whether an event has said so; otherwise it is what was planned")


class StateModel(AnswerModel):
    """What remains of a mission at a moment."""

    clock: float = Field(description="The moment")
    problem: dict[str, Any] = Field(
        description="What remains, as `POST /allocate` takes it but for matrices; `start_plan` is the plan "
        "in force"
    )
    done: list[DoneModel] = Field(description="What was done, in the order in which it became known")
    lost: list[str] = Field(description="Ids of UAVs that are lost")
    cancelled: list[str] = Field(description="Ids of areas that were cancelled")


class PlanInForce(AnswerModel):
    """A plan with its times."""

    assignment: list[list[int]] = Field(description="One joint action a step, as of `POST /allocate`")
    reward: float = Field(description="What it earns from the state's clock on")
    routes: list[RouteModel] = Field(description="One a UAV; times are by the mission's clock")


class SeenModel(AnswerModel):
    """Where a UAV was seen last."""

    time: float = Field(description="When, by the mission's clock")
    x: float = Field(description="Where")
    y: float = Field(description="Where")
    dis: float | None = Field(default=None, description="Distance flown, where it was told")
    airborne: float | None = Field(default=None, description="Time in the air, where it was told")
    location: int | None = Field(default=None, description="Row of the matrices, where it was told")
    number: int = Field(description="The event that it came with")


class MissionAsItStands(MissionModel):
    """A mission with its state."""

    state: StateModel = Field(description="After the newest event that made a state")
    positions: dict[str, SeenModel] = Field(description="Where UAVs were seen last, by their ids")


class StateAtMoment(AnswerModel):
    """A mission at a moment: as it was, or as it is planned to be."""

    number: int = Field(description="The event that it follows from")
    state: StateModel = Field(description="What remains then")
    plan: PlanInForce = Field(description="The rest of the plan in force")


class PlanAnswer(PlanInForce):
    """The plan in force."""

    number: int = Field(description="The event that it follows from")
    clock: float = Field(description="When it begins, by the mission's clock")


class BrokenModel(StopRef):
    """A stop of the plan that cannot be made any more, and was dropped from it."""

    uav_id: str = Field(description="The UAV")
    rule: str = Field(
        description="The rule, for programs: as in `breaches` of `POST /evaluate`, or "
        + ", ".join(f"`{name}` ({says})" for name, says in GONE.items())
    )
    says: str = Field(description="The rule, for people")
    needed: float | None = Field(description="What the stop needs; null where the rule has no figures")
    had: float | None = Field(description="What there is")


class LateModel(StopRef):
    """A stop of the plan that is later than it was."""

    uav_id: str = Field(description="The UAV")
    arrival_time: float = Field(description="When it is there now, by the mission's clock")
    planned: float = Field(description="When it was to be there before the event")


class EffectModel(AnswerModel):
    """What an event did to the plan in force."""

    flyable: bool = Field(description="Whether the plan can be flown as it was")
    broken: list[BrokenModel] = Field(description="Stops that cannot be made any more")
    late: list[LateModel] = Field(description="Stops that are later")
    reward_before: float = Field(description="What the rest of the plan earned before")
    reward: float = Field(description="What the rest of the plan earns now")


class EventAnswer(AnswerModel):
    """An event of a mission's history."""

    number: int = Field(description="From 1, without gaps, in the order in which they took effect")
    id: str | None = Field(description="Your id; null for what the service has written itself")
    type: str = Field(description="What happened")
    at: float = Field(description="When it became known, by the mission's clock")
    recorded_at: datetime = Field(description="When it was put on disk, UTC")
    event: dict[str, Any] = Field(description="The event itself, with its `type`")
    effect: EffectModel | None = Field(
        description="What it did to the plan in force; null for telemetry, which counts with the next event, "
        "and for what the service has written itself"
    )
    passed_over: int | None = Field(description="Of telemetry, how many positions were older than known ones")


class History(AnswerModel):
    """A page of a mission's history."""

    events: list[EventAnswer] = Field(description="In their order")
    next_after: int | None = Field(description="`after` of the next page; null on the last")


class RouteDifference(AnswerModel):
    """How the stops of one UAV differ."""

    uav_id: str = Field(description="The UAV")
    before: list[StopRef] = Field(description="Its stops in the one plan")
    after: list[StopRef] = Field(description="Its stops in the other")
    added: list[StopRef] = Field(description="Stops that only the other has")
    removed: list[StopRef] = Field(description="Stops that only the one has")


class Differences(AnswerModel):
    """How two plans differ."""

    uavs: list[RouteDifference] = Field(description="UAVs whose stops differ")
    visits_changed: int = Field(description="Visits that are in one of the plans only")


class ProposalModel(PlanInForce):
    """A plan that was found, and how it differs from the one in force."""

    number: int = Field(description="Its number, which is that of the event that made it")
    status: ProposalStatus = Field(description="What became of it")
    of_number: int = Field(description="The event after which it was looked for")
    job_id: str = Field(description="The job that found it")
    gained: float = Field(description="What it earns more than the plan in force, changes charged")
    differences: Differences = Field(description="How it differs from the plan in force then")


class ProposalList(AnswerModel):
    """All proposals of a mission."""

    proposals: list[ProposalModel] = Field(description="Newest first")


class ReplayEntry(EventAnswer):
    """An event with the state that it made."""

    state: StateModel | None = Field(description="The state after it; null where it made none")


class ReplayModel(AnswerModel):
    """Everything that is kept of a mission."""

    mission: MissionModel = Field(description="The mission")
    problem: dict[str, Any] = Field(description="The problem that it began with")
    events: list[ReplayEntry] = Field(description="All that happened, in its order")
    proposals: list[ProposalModel] = Field(description="All plans that were proposed, newest first")
