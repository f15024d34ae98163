"""From a task and a checkpoint to an entry of the policy library."""

from __future__ import annotations

import json
from typing import Any

from app.domain.errors import InvalidCheckpoint
from app.domain.problem import Problem
from app.domain.records import problem_to_record
from app.library.description import description_space, task_description
from app.library.summary import SUMMARY_SPACE, task_summary
from policy_store.checkpoint import ContainerLimits, read_container
from policy_store.errors import InvalidContainer
from policy_store.policy import NewPolicy

_DEFAULT_LIMITS = ContainerLimits()
_OWN_COLUMNS = frozenset({"architecture", "algorithm", "seed", "task", "metrics"})


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
        raise InvalidCheckpoint(str(error)) from error
    try:
        metadata = json.loads(container.metadata.get("checkpoint", ""))
    except (ValueError, RecursionError):
        metadata = None
    if not isinstance(metadata, dict):
        raise InvalidCheckpoint("the file's metadata has no JSON object under the key 'checkpoint'")
    for key in ("architecture", "algorithm"):
        if not isinstance(metadata.get(key), str):
            raise InvalidCheckpoint(f"the checkpoint's metadata does not name its {key}")
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
        If the file's header or metadata cannot be used.
    policy_store.errors.InvalidPolicy
        If the name or the metadata cannot be stored.
    """
    metadata = checkpoint_metadata(checkpoint, limits)
    seed, metrics = metadata.get("seed"), metadata.get("metrics")
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
        seed=seed if isinstance(seed, int) else None,
        metrics=metrics if isinstance(metrics, dict) else {},
        metadata={key: value for key, value in metadata.items() if key not in _OWN_COLUMNS},
        id=policy_id,
    )
