"""From a request for an allocation to the payload of its job."""

from __future__ import annotations

from typing import Any

from app.api.allocation_models import AllocationRequest
from app.api.problem_models import to_problem
from app.api.services import Services
from app.domain.records import problem_to_record
from app.settings import Settings
from app.solvers.registry import parse_parameters, require_supported


def allocation_payload(body: AllocationRequest, services: Services) -> dict[str, Any]:
    """Return the payload of a job of this service; see :func:`payload_of`."""
    return payload_of(body, services.settings, services.database.url)


def payload_of(body: AllocationRequest, settings: Settings, library_url: str) -> dict[str, Any]:
    """Return what makes an allocation what it is; the time that it has is not a part of it.

    Parameters
    ----------
    body
        What is asked for.
    settings
        The sizes that are taken.
    library_url
        Database of the policy library.

    Raises
    ------
    ProblemTooLarge, InvalidProblem
        As :func:`app.api.problem_models.to_problem` does, or if the algorithm cannot take a field.
    UnknownAlgorithm, InvalidParameters
        If there is no such algorithm, or its parameters are unknown or out of range.
    """
    problem = to_problem(body, settings)
    parameters = parse_parameters(body.algorithm, body.parameters)
    require_supported(body.algorithm, parameters, problem)
    payload = {
        "problem": problem_to_record(problem),
        "algorithm": body.algorithm,
        "parameters": parameters.model_dump(mode="json"),
        "seed": body.seed,
        "library_url": library_url,
    }
    if body.keep_checkpoint:
        payload["keep_checkpoint"] = True
    if body.bound_seconds is not None:
        payload["bound_time_limit_s"] = body.bound_seconds
    return payload
