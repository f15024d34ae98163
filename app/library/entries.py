"""From a task and a checkpoint to an entry of the policy library."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.domain.errors import InvalidCheckpoint
from app.domain.problem import Problem
from app.domain.records import problem_to_record
from app.domain.said import said
from app.library.description import description_space, task_description
from app.library.summary import SUMMARY_SPACE, task_summary
from policy_store.checkpoint import ContainerLimits, read_container
from policy_store.errors import InvalidContainer, InvalidPolicy, InvalidVector
from policy_store.policy import NewPolicy
from policy_store.soundness import read_object

_DEFAULT_LIMITS = ContainerLimits()
METADATA_KEY = "checkpoint"
"""Under which a checkpoint's metadata is in its file."""

_MOST_METRICS, _LONGEST_METRIC = 100, 256
_OWN_COLUMNS = frozenset({"architecture", "algorithm", "seed", "task", "metrics"})


def unacceptable(error: InvalidContainer) -> InvalidCheckpoint:
    """Return the refusal of bytes that are no safetensors file, or not the one that is expected."""
    return InvalidCheckpoint(said("not an acceptable checkpoint: {why}", why=error.reason))


def checkpoint_metadata(checkpoint: bytes, limits: ContainerLimits = _DEFAULT_LIMITS) -> dict[str, Any]:
    """Read what a checkpoint says about itself, without trusting its weights.

    Parameters
    ----------
    checkpoint
        A safetensors file whose metadata has the key ``checkpoint``, a JSON object.
    limits
        What the file may have at most.

    Raises
    ------
    InvalidCheckpoint
        If it is not such a file, or says nothing of its architecture or algorithm.
    """
    try:
        container = read_container(checkpoint, limits)
    except InvalidContainer as error:
        raise unacceptable(error) from error
    try:
        metadata = read_object(container.metadata.get(METADATA_KEY, ""))
    except ValueError as error:
        detail = said("the file's metadata {key!r} cannot be used: {why}", key=METADATA_KEY, why=str(error))
        raise InvalidCheckpoint(detail) from None
    for key in ("architecture", "algorithm"):
        if not isinstance(metadata.get(key), str):
            raise InvalidCheckpoint(said("the checkpoint's metadata does not name its `{key}`", key=key))
    return metadata


def new_policy(
    name: str,
    task: Problem,
    checkpoint: bytes,
    *,
    policy_id: str | None = None,
    limits: ContainerLimits = _DEFAULT_LIMITS,
) -> NewPolicy:
    """Describe a trained source task for the library.

    Parameters
    ----------
    name
        For people.
    task
        The source task; new tasks are compared with it.
    checkpoint
        What was learned on it. Whether the weights fit their architecture is not checked here.
    policy_id
        A fixed id, or None to have one made.
    limits
        What the file may have at most.

    Raises
    ------
    InvalidCheckpoint
        If the file's header or metadata cannot be used or stored.
    policy_store.errors.InvalidPolicy
        If the name or the id cannot be stored.
    """
    metadata = checkpoint_metadata(checkpoint, limits)
    try:
        return _entry(name, task, checkpoint, metadata, policy_id)
    except (InvalidPolicy, InvalidVector) as error:
        if isinstance(error, InvalidPolicy) and error.field in ("id", "name"):
            raise
        raise InvalidCheckpoint(said("the checkpoint cannot be stored: {why}", why=str(error))) from error


def _entry(
    name: str, task: Problem, checkpoint: bytes, metadata: Mapping[str, Any], policy_id: str | None
) -> NewPolicy:
    return NewPolicy(
        name=name,
        n_uavs=task.n_uavs,
        n_targets=task.n_targets,
        n_materials=task.n_materials,
        task=problem_to_record(task),
        architecture=metadata["architecture"],
        algorithm=metadata["algorithm"],
        checkpoint=checkpoint,
        vectors={
            description_space(task): task_description(task).astype("float32"),
            SUMMARY_SPACE: task_summary(task).astype("float32"),
        },
        seed=metadata.get("seed"),
        metrics=_metrics(metadata.get("metrics")),
        metadata={key: value for key, value in metadata.items() if key not in _OWN_COLUMNS},
        id=policy_id,
    )


def _metrics(given: object) -> dict[str, Any]:
    """Check what a checkpoint says was measured: names, each with a number or a short text.

    Raises
    ------
    InvalidCheckpoint
        If it is anything else.
    """
    if given is None:
        return {}
    if not isinstance(given, dict) or len(given) > _MOST_METRICS:
        raise InvalidCheckpoint(said("its metrics are no object of at most {most} names", most=_MOST_METRICS))
    for name, value in given.items():
        if isinstance(value, dict | list) or len(str(value)) > _LONGEST_METRIC or len(name) > _LONGEST_METRIC:
            shown = name[:_LONGEST_METRIC]
            detail = said("its metric {name!r} is neither a number nor a short text", name=shown)
            raise InvalidCheckpoint(detail)
    return given
