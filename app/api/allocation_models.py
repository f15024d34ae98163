"""An allocation on the wire: what is asked, and what is answered."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.api.plan_formats.flown_routes import PASSED_OVER
from app.api.problem_models import ProblemModel
from app.api.wire_fields import Whole, WireModel
from app.domain.allocation import UnmetCode
from app.domain.warnings import CODES as WARNING_CODES
from app.solvers.registry import ALGORITHMS

MAX_SEED = 2**53 - 1
"""Beyond it not every reader of JSON gets the same integer (RFC 7493)."""
MAX_TIME_LIMIT_S = 7 * 24 * 3600.0


class TrainingModel(WireModel):
    """What to learn with."""

    algorithm: str = Field(
        default="qmix",
        description="An algorithm that learns, see `GET /algorithms`",
        json_schema_extra={"enum": [each.name for each in ALGORITHMS.values() if each.learns]},
    )
    parameters: dict[str, Any] = Field(
        default_factory=dict, description="The algorithm's own; the others keep their defaults"
    )
    seed: Whole = Field(default=123, ge=0, le=MAX_SEED, description="Source of all randomness")


class AllocationRequest(ProblemModel):
    """A problem, and how to solve it."""

    algorithm: str = Field(
        default="transfer_qmix",
        description="See `GET /algorithms`",
        json_schema_extra={"enum": list(ALGORITHMS)},
    )
    parameters: dict[str, Any] = Field(
        default_factory=dict, description="The algorithm's own; the others keep their defaults"
    )
    seed: Whole = Field(
        default=123,
        ge=0,
        le=MAX_SEED,
        description="Source of all randomness: same request, same seed, no time limit: same answer",
    )
    time_limit_s: float | None = Field(
        default=None,
        gt=0,
        le=MAX_TIME_LIMIT_S,
        description="The answer comes within this time, with the best plan so far; null: no limit",
    )
    keep_checkpoint: bool = Field(
        default=False,
        description="Whether what an algorithm learns is kept with the job, so that `POST /library` can "
        "register it by its `job_id`; half a megabyte and more",
    )
    bound: bool = Field(
        default=False, description="Whether the answer has an upper bound on the reward of any plan"
    )
    bound_time_limit_s: float = Field(
        default=5.0,
        gt=0,
        le=MAX_TIME_LIMIT_S,
        description="Seconds to look for the bound, after the plan was found; within `time_limit_s`, of "
        "which at most a third is kept for it",
    )

    @property
    def bound_seconds(self) -> float | None:
        """Seconds to look for a bound; None where none is asked for."""
        return self.bound_time_limit_s if self.bound else None


class AnswerModel(BaseModel):
    """Base of everything that is answered."""

    model_config = ConfigDict(frozen=True)


_PATH = "Points `[x, y]` flown over, first and last place included; null: a straight line"


class StopModel(AnswerModel):
    """One visit of a UAV; the last ones only where the problem uses fields of the world, such as `wind`."""

    kind: Literal["visit"] = Field(default="visit", description="Only where the problem has bases")
    target_id: str = Field(description="The rescue area")
    step: int = Field(description="Decision step, from 1")
    arrival_time: float = Field(description="Time units from now, or h")
    distance: float = Field(description="Length of the leg flown to it")
    delivered: list[float] = Field(description="Amounts unloaded, one a material")
    begin_time: float | None = Field(
        default=None, description="When unloading begins: on arrival, or after waiting; as `arrival_time`"
    )
    departure_time: float | None = Field(default=None, description="When the visit has ended")
    range_left: float | None = Field(
        default=None, description="Air length left on departure, of the whole `voyage`"
    )
    endurance_left: float | None = Field(
        default=None,
        description="Time in the air left on departure, of the whole `endurance`; null: no limit",
    )
    path: list[tuple[float, float]] | None = Field(default=None, description=f"{_PATH} to it")


class ReloadModel(AnswerModel):
    """One landing of a UAV at a base, where it takes up material and flies on."""

    kind: Literal["reload"] = Field(description="What the stop is")
    base_id: str = Field(description="The base")
    step: int = Field(description="Decision step, from 1")
    arrival_time: float = Field(description="Time units from now, or h")
    distance: float = Field(description="Length of the leg flown to it")
    loaded: list[float] = Field(description="Amounts taken up, one a material; below 0: left behind")
    departure_time: float = Field(description="When it may take off again")
    path: list[tuple[float, float]] | None = Field(description=f"{_PATH} to it")


class BaseLeftModel(AnswerModel):
    """A base at the end of the plan."""

    base_id: str = Field(description="The base")
    stock: list[float] | None = Field(
        description="Amounts left, one a material; null: as much as is asked for"
    )


class LandingModel(AnswerModel):
    """The end of a route."""

    time: float = Field(
        description="When the UAV has landed; without `return_to_base`, when its last visit has ended"
    )
    path: list[tuple[float, float]] | None = Field(description=f"{_PATH} home")
    base_id: str | None = Field(
        default=None,
        description="The base where it has landed; null: its starting point. Only with bases",
    )


class RouteModel(AnswerModel):
    """What one UAV does: its stops in order, then home."""

    uav_id: str = Field(description="The UAV")
    distance: float = Field(description="Distance of the legs to its stops, without the leg home")
    return_distance: float = Field(description="Length of the leg home")
    stops: list[StopModel | ReloadModel] = Field(
        description="Its visits and, where the problem has bases, reloads"
    )
    landing: LandingModel | None = Field(
        default=None,
        description="Its end; null for a UAV that does not fly. Only where the problem uses fields of the "
        "world",
    )


class LaterDeadlineModel(AnswerModel):
    """A deadline that would have to be later."""

    target_id: str = Field(description="The rescue area")
    by: float = Field(description="How much later, in time units, or h")


class RelaxationModel(AnswerModel):
    """What a problem would have to allow more of."""

    more_load: list[float] = Field(description="Amounts more aboard the UAV, one a material")
    more_range: float = Field(description="Range more of the UAV")
    more_steps: int = Field(description="Decision steps more")
    later_deadlines: list[LaterDeadlineModel] = Field(description="Deadlines that would have to be later")


class UnmetModel(AnswerModel):
    """A rescue area that does not get all it needs."""

    target_id: str = Field(description="The rescue area")
    remaining: list[float] = Field(description="Amounts still needed after the plan, one a material")
    code: UnmetCode = Field(
        description="The reason, for programs. " + " ".join(f"`{code}`: {code.meaning}" for code in UnmetCode)
    )
    reason: str = Field(description="The reason, for people, with its numbers")
    uav_id: str | None = Field(
        default=None, description="The UAV that could serve it, or comes closest to it; null: none"
    )
    step: int | None = Field(
        default=None,
        description="The decision step, from 1, in which that UAV would visit it; its later visits come one "
        "step later. Where the plan has this visit already and more is to be aboard, no other is needed. "
        "null: not evaluated",
    )
    remedy: str | None = Field(
        default=None, description="What would change it, for people; null: nothing simple would"
    )
    relaxation: RelaxationModel | None = Field(
        default=None,
        description="What the problem has to allow for the remedy, for programs; null: nothing, or no remedy",
    )
    reward_change: float | None = Field(
        default=None,
        description="Change of the reward with that visit once the remedy is there, or, without a remedy, as "
        "things are; visits that it makes illegal are left out; null: not evaluated",
    )
    verified: bool = Field(
        default=False,
        description="Whether the reason is verified: where it depends on the plan, by the exact reward of "
        "every single additional visit of any UAV at any place in its route; of very many unmet areas only "
        "the most urgent ones are",
    )


class SourcePolicyModel(AnswerModel):
    """The policy of the library that was transferred."""

    id: str = Field(description="Its id, see `GET /library/{policy_id}`")
    name: str = Field(description="Its name")
    distance: float = Field(description="Sum of squared differences between the task descriptions")


class HistoryModel(AnswerModel):
    """Reward against epoch, as in the paper's figures; two lists of one length."""

    epoch: list[int] = Field(description="Epochs or generations")
    reward: list[float] = Field(description="Reward at that epoch")


class ProofModel(AnswerModel):
    """What an algorithm knows of plans that it has not found; they unload greedily."""

    bound: float = Field(description="No plan that unloads greedily earns more")
    proven: bool = Field(description="Whether the plan is the best there is")


class WarningModel(AnswerModel):
    """Something in the request that is taken as it is, but was probably not meant."""

    pointer: str = Field(description="JSON pointer to it in the problem (RFC 6901)")
    code: str = Field(
        description="What it is, for programs", json_schema_extra={"enum": [*WARNING_CODES, PASSED_OVER]}
    )
    detail: str = Field(description="What it is, for people, with its numbers")


class Allocation(AnswerModel):
    """A plan, what it earns, and how it was found."""

    job_id: str = Field(description="The job that found it, see `GET /jobs/{job_id}`")
    algorithm: str = Field(description="The algorithm that was asked for")
    answered_by: str | None = Field(
        default=None,
        description="The algorithm whose plan it is: `greedy` where no time was left for another; null in "
        "answers of versions that did not say so",
    )
    parameters: dict[str, Any] = Field(
        description="The parameters of the algorithm that was asked for, defaults filled in"
    )
    seed: int = Field(description="The seed that was used")
    assignment: list[list[int]] = Field(
        description="One joint action a step: for each UAV the index of its target, N for home, or N + 1 + d "
        "to reload at base d"
    )
    reward: float = Field(
        description="satisfaction - distance_weight · distance - makespan_weight · makespan - change_weight "
        "· changes"
    )
    satisfaction: float = Field(description="Sum over the visits of level · delivered / requested")
    distance: float = Field(description="Total distance, legs home only if they are charged")
    distance_weight: float = Field(description="λ as it was used")
    bound: float | None = Field(
        default=None,
        description="No plan earns more, whichever way it unloads; null unless `bound` was asked for",
    )
    gap: float | None = Field(
        default=None,
        description="(bound - reward) / bound: the share by which the plan may fall short of the best; null "
        "without a bound, or where the bound is not positive",
    )
    proof: ProofModel | None = Field(
        default=None,
        description="Of `exact`: whether the plan is proven to be the best, where it unloads greedily",
    )
    routes: list[RouteModel] = Field(description="One a UAV")
    unmet: list[UnmetModel] = Field(description="Areas with needs left, each with the reason")
    reasons: Literal["complete", "pending", "incomplete"] = Field(
        default="complete",
        description="Whether the reasons of `unmet` are all there: `pending` where the time limit left none "
        "to look for them, then the result of `GET /jobs/{job_id}` has them soon after; `incomplete` where "
        "they will not come",
    )
    warnings: list[WarningModel] = Field(
        default_factory=list,
        description="What in the problem was probably not meant; nothing is refused for it",
    )
    source_policy: SourcePolicyModel | None = Field(description="What was transferred, if anything")
    history: HistoryModel = Field(description="Reward against epoch; thinned evenly beyond 10,000")
    makespan: float | None = Field(
        default=None,
        description="When the last UAV with a visit has landed; 0 without visits. Only where the problem "
        "uses fields of the world",
    )
    changes: int | None = Field(
        default=None,
        description="Pairs of UAV and area that are visited in `start_plan` and not in the plan. Only where "
        "the problem uses fields of the world",
    )
    bases: list[BaseLeftModel] | None = Field(
        default=None, description="What is left of each stock. Only where the problem has bases"
    )
    elapsed_s: float = Field(description="Seconds from the request's arrival to the plan")


SOMETIMES_ANSWERED = frozenset({"makespan", "changes", "bases"})
"""Fields of an allocation that are left out where the problem uses no field of the world, or has no bases."""
