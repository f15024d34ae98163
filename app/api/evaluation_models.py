"""An evaluation on the wire: somebody's own plan, and what follows from it."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from app.api.allocation_models import (
    MAX_TIME_LIMIT_S,
    AnswerModel,
    BaseLeftModel,
    RouteModel,
    UnmetModel,
    WarningModel,
)
from app.api.problem_models import ProblemModel
from app.api.wire_fields import Whole, WireModel

MAX_FLIGHT_FILES = 2_000
MAX_MATCH_WITHIN_M = 1_000.0

AmountsOfStops = list[list[list[Annotated[float, Field(allow_inf_nan=False)]] | None]]
"""Amounts by step, UAV and material."""


class FlightFileModel(WireModel):
    """A flight of a UAV, as a ground station has it."""

    name: str = Field(
        max_length=255,
        description="Of the file. `003-uav-3-flight-2.plan` is the second flight of the third UAV, as the "
        "service names files; of any other name say whose it is",
    )
    uav_id: str | None = Field(default=None, description="Whose flight it is; default: as the name says")
    content: str = Field(description="Its text: QGroundControl's `.plan`, or `QGC WPL 110` waypoints")


class EvaluationRequest(ProblemModel):
    """A problem, and a plan of it: as `assignment`, or as `flight_files`."""

    assignment: list[list[Whole]] | None = Field(
        default=None,
        min_length=1,
        description="One joint action a step: for each UAV the index of its target, N for home, or N + 1 + d "
        "to reload at base d",
    )
    flight_files: list[FlightFileModel] | None = Field(
        default=None,
        min_length=1,
        max_length=MAX_FLIGHT_FILES,
        description="In place of `assignment`: a file a flight. Waypoints near an area are visits to it; who "
        "has no file stays where it is. The answer has the plan as `assignment`",
    )
    match_within: float = Field(
        default=50.0,
        gt=0,
        le=MAX_MATCH_WITHIN_M,
        description="m that a waypoint of `flight_files` may be away from the area or base that it is at",
    )
    delivered: AmountsOfStops | None = Field(
        default=None,
        description="With planned unloading, what every visit unloads: by step, UAV and material, null for "
        "nothing; default: the best amounts of the plan",
    )
    loaded: AmountsOfStops | None = Field(
        default=None,
        description="With planned loading, what every reload takes, likewise, below 0 for what it leaves "
        "behind; it goes with `delivered`",
    )
    bound: bool = Field(
        default=False, description="Whether the answer has an upper bound on the reward of any plan"
    )
    bound_time_limit_s: float = Field(
        default=5.0, gt=0, le=MAX_TIME_LIMIT_S, description="Seconds to look for the bound"
    )
    at: float | None = Field(
        default=None,
        ge=0,
        le=1e12,
        description="A clock of the plan: the answer then has the problem that remains at it",
    )


class Evaluation(AnswerModel):
    """What a plan earns and does."""

    job_id: str = Field(description="The job that evaluated it")
    assignment: list[list[int]] = Field(description="The plan")
    reward: float = Field(description="As of `POST /allocate`")
    satisfaction: float = Field(description="As of `POST /allocate`")
    distance: float = Field(description="As of `POST /allocate`")
    distance_weight: float = Field(description="λ as it was used")
    bound: float | None = Field(default=None, description="As of `POST /allocate`")
    gap: float | None = Field(default=None, description="As of `POST /allocate`")
    routes: list[RouteModel] = Field(description="One a UAV")
    unmet: list[UnmetModel] = Field(description="Areas with needs left, each with the reason")
    reasons: str = Field(default="complete", description="As of `POST /allocate`")
    warnings: list[WarningModel] = Field(default_factory=list, description="As of `POST /allocate`")
    makespan: float | None = Field(default=None, description="As of `POST /allocate`")
    changes: int | None = Field(default=None, description="As of `POST /allocate`")
    bases: list[BaseLeftModel] | None = Field(default=None, description="As of `POST /allocate`")
    remaining: dict[str, Any] | None = Field(
        default=None,
        description="The problem as it stands at `at`, ready to be allocated: who is where with what, needs "
        "with `requested`, what is under way as `committed`, and the rest of the plan as `start_plan`",
    )
    elapsed_s: float = Field(description="Seconds from the request's arrival to the answer")
