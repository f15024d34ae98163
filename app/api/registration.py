"""From the three forms of a registration to the payload of the job that does it."""

from __future__ import annotations

import base64
from typing import Any

from app.api.errors import JobWithoutCheckpoint
from app.api.job_kinds import ALLOCATE, BATCH
from app.api.library_models import RegisterCheckpoint, RegisterJob, RegisterTraining
from app.api.problem_models import to_problem
from app.api.services import Services
from app.domain.errors import (
    AllocatorError,
    InvalidCheckpoint,
    InvalidParameters,
    InvalidProblem,
    UnknownAlgorithm,
    Violation,
)
from app.domain.records import problem_to_record
from app.domain.said import said
from app.solvers.registry import ALGORITHMS, algorithm, parse_parameters, require_supported

_BASE64_BYTES, _BASE64_CHARACTERS = 3, 4


def training_payload(body: RegisterTraining, services: Services) -> dict[str, Any]:
    """Return what a training job needs.

    Raises
    ------
    UnknownAlgorithm
        If there is no such algorithm, or it does not learn.
    InvalidParameters
        If its parameters are unknown or out of range.
    InvalidProblem
        If it cannot take a field of the task.
    """
    task, train = to_problem(body.task, services.settings, "/task"), body.train
    try:
        if not algorithm(train.algorithm).learns:
            raise _does_not_learn(train.algorithm)
        parameters = parse_parameters(train.algorithm, train.parameters)
    except (UnknownAlgorithm, InvalidParameters) as error:
        raise _inside("/train", error) from None
    try:
        require_supported(train.algorithm, parameters, task)
    except InvalidProblem as error:
        raise _inside("/task", error) from None
    return {
        "name": body.name,
        "problem": problem_to_record(task),
        "algorithm": train.algorithm,
        "parameters": parameters.model_dump(mode="json"),
        "seed": train.seed,
        "library_url": services.database.url,
    }


def checkpoint_payload(body: RegisterCheckpoint, services: Services) -> dict[str, Any]:
    """Return what the job that checks and registers weights needs.

    Raises
    ------
    InvalidCheckpoint
        If they are more than is taken, or no ASCII text; all else is found by the job.
    """
    if not body.checkpoint.isascii():
        detail = said("the checkpoint is not base64: it has characters beyond ASCII")
        raise InvalidCheckpoint(detail, [Violation("/checkpoint", detail)])
    limit = services.settings.max_checkpoint_bytes
    padding = body.checkpoint[-2:].count("=")
    size = len(body.checkpoint) * _BASE64_BYTES // _BASE64_CHARACTERS - padding
    if size > limit:
        detail = said("the checkpoint has {size} bytes, at most {limit} are taken", size=size, limit=limit)
        raise InvalidCheckpoint(detail, [Violation("/checkpoint", detail)])
    task = to_problem(body.task, services.settings, "/task")
    return {
        "name": body.name,
        "problem": problem_to_record(task),
        "checkpoint_base64": body.checkpoint,
    }


async def job_payload(body: RegisterJob, services: Services) -> dict[str, Any]:
    """Return what the job that registers an earlier job's weights needs.

    Raises
    ------
    JobNotFound
        If there is no such job.
    JobWithoutCheckpoint
        If it has not ended, has learned nothing, or was not asked to keep what it learned.
    """
    job = await services.jobs.get(body.job_id)
    checkpoint = await services.jobs.artifact(job.id) if job.status.finished else None
    if checkpoint is None:
        could_keep = job.kind in (ALLOCATE, BATCH) and not job.payload.get("keep_checkpoint")
        raise JobWithoutCheckpoint(job.id, job.status, could_keep=could_keep)
    if body.task is None:
        record = job.payload["problem"]
    else:
        record = problem_to_record(to_problem(body.task, services.settings, "/task"))
    return {
        "name": body.name,
        "problem": record,
        "checkpoint_base64": base64.b64encode(checkpoint).decode("ascii"),
    }


def _does_not_learn(name: str) -> UnknownAlgorithm:
    names = [each.name for each in ALGORITHMS.values() if each.learns]
    detail = said("{name!r} does not learn; there are {names}", name=name, names=names)
    return UnknownAlgorithm(detail, [Violation("/algorithm", detail)], {"algorithms": names})


def _inside(at: str, error: AllocatorError) -> AllocatorError:
    """Make the pointers of an error relative to the request's body."""
    violations = [Violation(at + v.pointer, v.detail) for v in error.violations]
    return type(error)(error.detail, violations, error.details)
