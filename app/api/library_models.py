"""The policy library on the wire."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from app.api.allocation_models import AnswerModel, TrainingModel
from app.api.problem_models import ProblemModel
from app.api.wire_fields import Whole, WireModel
from policy_store.policy import Neighbour, Policy, PolicyPage

JOB_ID_PATTERN = "^[0-9a-f]{32}$"

# A null character is no text for a database.
PolicyName = Annotated[
    str,
    Field(min_length=1, max_length=256, pattern=r"^[^\x00]*$", description="For people; need not be unique"),
]


class RegisterCheckpoint(WireModel):
    """Register a checkpoint that was trained elsewhere."""

    name: PolicyName
    task: ProblemModel = Field(description="The source task it was trained on")
    checkpoint: str = Field(
        min_length=1,
        description="A safetensors file in base64, as `GET /library/{policy_id}/checkpoint` returns it",
        json_schema_extra={"format": "byte"},
    )


class RegisterTraining(WireModel):
    """Train a source policy, and register it at the end."""

    name: PolicyName
    task: ProblemModel = Field(description="The source task to train on")
    train: TrainingModel = Field(description="How to train")


class RegisterJob(WireModel):
    """Register what an earlier job has learned."""

    name: PolicyName
    task: ProblemModel | None = Field(
        default=None, description="The source task; null: the job's own problem"
    )
    job_id: str = Field(pattern=JOB_ID_PATTERN, description="A job that has ended and learned something")


_FORMS = ("checkpoint", "train", "job_id")


def _form_of(body: Any) -> str | None:
    given = body if isinstance(body, Mapping) else vars(body) if isinstance(body, WireModel) else {}
    present = [form for form in _FORMS if form in given]
    return present[0] if len(present) == 1 else None


Registration = Annotated[
    Annotated[RegisterCheckpoint, Tag("checkpoint")]
    | Annotated[RegisterTraining, Tag("train")]
    | Annotated[RegisterJob, Tag("job_id")],
    Discriminator(
        _form_of,
        custom_error_type="registration_form",
        custom_error_message="Exactly one of checkpoint, train and job_id is needed beside name and task",
    ),
]


class SimilarRequest(WireModel):
    """A new task."""

    task: ProblemModel = Field(description="The task to find similar source tasks for")
    k: Whole = Field(default=5, ge=1, le=100, description="How many at most")
    similarity: Literal["summary", "paper"] = Field(
        default="summary",
        description="summary: by what the tasks have in common, whatever their sizes; paper: Algorithm 2, "
        "number by number, which only finds tasks of the same size",
    )


class CheckpointModel(AnswerModel):
    """The file with a policy's weights."""

    sha256: str = Field(description="SHA-256, hexadecimal; in quotes it is the `ETag`")
    size: int = Field(description="Bytes")


class PolicySummary(AnswerModel):
    """A source policy without its task."""

    id: str = Field(description="Its id")
    name: str = Field(description="For people")
    n_uavs: int = Field(description="UAVs of the source task, M")
    n_targets: int = Field(description="Targets of the source task, N")
    n_materials: int = Field(description="Materials of the source task, K")
    architecture: str = Field(description="The network its weights are for")
    algorithm: str = Field(description="What trained it")
    seed: int | None = Field(description="The seed of the training")
    metrics: dict[str, Any] = Field(description="What was measured at its training")
    created_at: datetime = Field(description="When it was registered, UTC")
    checkpoint: CheckpointModel = Field(description="Its weights")


class PolicyModel(PolicySummary):
    """A source policy with its task."""

    task: dict[str, Any] = Field(description="The source task, a problem with all defaults filled in")
    metadata: dict[str, Any] = Field(description="What else its checkpoint says of itself")


class PolicyList(AnswerModel):
    """A page of source policies."""

    policies: list[PolicySummary] = Field(description="Newest first")
    next_cursor: str | None = Field(description="`cursor` of the next page; null on the last")


class SimilarPolicy(AnswerModel):
    """A source policy and how far its task is."""

    policy: PolicySummary
    distance: float = Field(
        description="Sum of squared differences between the tasks' summaries or descriptions"
    )


class SimilarList(AnswerModel):
    """Similar source tasks."""

    similar: list[SimilarPolicy] = Field(description="Nearest first")


def policy_summary(policy: Policy) -> PolicySummary:
    """Describe a policy without its task."""
    return PolicySummary(**_summary(policy))


def policy_model(policy: Policy) -> PolicyModel:
    """Describe a policy with its task."""
    return PolicyModel(**_summary(policy), task=dict(policy.task), metadata=dict(policy.metadata))


def policy_list(page: PolicyPage) -> PolicyList:
    """Describe a page of policies."""
    return PolicyList(
        policies=[policy_summary(policy) for policy in page.policies], next_cursor=page.next_cursor
    )


def similar_list(neighbours: list[Neighbour]) -> SimilarList:
    """Describe what was found, nearest first."""
    return SimilarList(
        similar=[SimilarPolicy(policy=policy_summary(n.policy), distance=n.distance) for n in neighbours]
    )


def _summary(policy: Policy) -> dict[str, Any]:
    return {
        "id": policy.id,
        "name": policy.name,
        "n_uavs": policy.n_uavs,
        "n_targets": policy.n_targets,
        "n_materials": policy.n_materials,
        "architecture": policy.architecture,
        "algorithm": policy.algorithm,
        "seed": policy.seed,
        "metrics": dict(policy.metrics),
        "created_at": policy.created_at,
        "checkpoint": CheckpointModel(sha256=policy.checkpoint_sha256, size=policy.checkpoint_size),
    }
