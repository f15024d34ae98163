"""Errors on the wire: problem details (RFC 9457), and the one table that gives error codes their HTTP status.

The domain, the jobs and the store raise errors that know no HTTP; a code not in the table is a defect and
answers 500.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from pydantic import BaseModel, ConfigDict, Field
from starlette.responses import JSONResponse

MEDIA_TYPE = "application/problem+json"

STATUS_OF_CODE: Mapping[str, HTTPStatus] = {
    # the request itself
    "malformed-json": HTTPStatus.BAD_REQUEST,
    "bad-request": HTTPStatus.BAD_REQUEST,
    "unauthenticated": HTTPStatus.UNAUTHORIZED,
    "forbidden": HTTPStatus.FORBIDDEN,
    "host-not-allowed": HTTPStatus.MISDIRECTED_REQUEST,
    "not-found": HTTPStatus.NOT_FOUND,
    "method-not-allowed": HTTPStatus.METHOD_NOT_ALLOWED,
    "request-timeout": HTTPStatus.REQUEST_TIMEOUT,
    "body-too-large": HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    "unsupported-media-type": HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
    "invalid-request": HTTPStatus.UNPROCESSABLE_ENTITY,
    "invalid-cursor": HTTPStatus.UNPROCESSABLE_ENTITY,
    # app.domain.errors
    "invalid-problem": HTTPStatus.UNPROCESSABLE_ENTITY,
    "illegal-plan": HTTPStatus.UNPROCESSABLE_ENTITY,
    "unknown-algorithm": HTTPStatus.UNPROCESSABLE_ENTITY,
    "invalid-parameters": HTTPStatus.UNPROCESSABLE_ENTITY,
    "problem-too-large": HTTPStatus.UNPROCESSABLE_ENTITY,
    "batch-too-large": HTTPStatus.UNPROCESSABLE_ENTITY,
    "invalid-checkpoint": HTTPStatus.UNPROCESSABLE_ENTITY,
    "no-compatible-source": HTTPStatus.CONFLICT,
    # app.jobs.errors and what a job can end with
    "job-not-found": HTTPStatus.NOT_FOUND,
    "idempotency-key-reused": HTTPStatus.UNPROCESSABLE_ENTITY,
    "job-cancelled": HTTPStatus.CONFLICT,
    "job-without-checkpoint": HTTPStatus.CONFLICT,
    # app.api.plan_formats
    "uav-not-found": HTTPStatus.NOT_FOUND,
    "no-plan": HTTPStatus.CONFLICT,
    "nothing-to-fly": HTTPStatus.CONFLICT,
    "plan-not-geographic": HTTPStatus.CONFLICT,
    "plan-out-of-range": HTTPStatus.CONFLICT,
    # app.missions.errors
    "mission-not-found": HTTPStatus.NOT_FOUND,
    "event-refused": HTTPStatus.UNPROCESSABLE_ENTITY,
    "event-id-reused": HTTPStatus.UNPROCESSABLE_ENTITY,
    "proposal-closed": HTTPStatus.CONFLICT,
    "mission-busy": HTTPStatus.SERVICE_UNAVAILABLE,
    "queue-full": HTTPStatus.TOO_MANY_REQUESTS,
    "draining": HTTPStatus.SERVICE_UNAVAILABLE,
    "not-ready": HTTPStatus.SERVICE_UNAVAILABLE,
    "time-limit-exceeded": HTTPStatus.GATEWAY_TIMEOUT,
    # the database does not answer
    "store-unavailable": HTTPStatus.SERVICE_UNAVAILABLE,
    # policy_store.errors
    "policy-not-found": HTTPStatus.NOT_FOUND,
    "duplicate-policy": HTTPStatus.CONFLICT,
    "invalid-policy": HTTPStatus.UNPROCESSABLE_ENTITY,
    "damaged-checkpoint": HTTPStatus.INTERNAL_SERVER_ERROR,
}

ERROR_PAGE = "/docs/errors"
"""Where the meanings are shown."""

MEANINGS: Mapping[str, str] = {
    "malformed-json": "The body is not JSON in UTF-8, or has a name twice in one object",
    "bad-request": "The request is not HTTP as it should be",
    "unauthenticated": "An API key is needed, or the one that was sent is unknown or revoked",
    "forbidden": "The API key has not the role that this needs",
    "host-not-allowed": "The header Host does not name this service",
    "not-found": "There is nothing at this path",
    "method-not-allowed": "This path has other methods, which Allow lists",
    "request-timeout": "The request was not received in time",
    "body-too-large": "The body has more bytes than the operator takes",
    "unsupported-media-type": "The body is not sent as plain application/json",
    "invalid-request": "Fields or parameters are missing, unknown, of another type or out of range",
    "invalid-cursor": "No page has given this cursor out",
    "invalid-problem": "The problem breaks a rule between its fields, or has one that the algorithm refuses",
    "illegal-plan": "The plan that was sent breaks a rule of the problem",
    "unknown-algorithm": "No algorithm has this name",
    "invalid-parameters": "The algorithm has no such parameters, or not with these values",
    "problem-too-large": "The problem is larger than the operator or the algorithm takes",
    "batch-too-large": "The batch has more problems than the operator takes",
    "invalid-checkpoint": "The checkpoint is not exactly what its architecture needs",
    "no-compatible-source": "The library has no policy that fits; `sizes` has the sizes there are",
    "job-not-found": "No job has this id; ended ones are deleted after a time",
    "idempotency-key-reused": "The Idempotency-Key came with another request before",
    "job-cancelled": "The job was cancelled before it had a plan",
    "job-without-checkpoint": "The job has learned nothing that could be registered",
    "uav-not-found": "No UAV of the plan has this id",
    "no-plan": "The job has no plan, or not yet",
    "nothing-to-fly": "The UAV, or all of them, stay where they are",
    "plan-not-geographic": "Flight files need a problem with crs wgs84",
    "plan-out-of-range": "A flight file cannot hold the plan, or the UAV not fly it as asked",
    "mission-not-found": "No mission has this id",
    "event-refused": "The event is about something unknown, from the past, or impossible",
    "event-id-reused": "The id of the event came with another event before",
    "proposal-closed": "The proposal was accepted, refused or outdated before, or fits no more",
    "mission-busy": "What works out missions does not answer, or others change the mission all the time",
    "queue-full": "As many jobs wait as may; Retry-After says when to come back",
    "draining": "The service is stopping",
    "not-ready": "The database or the workers do not answer yet",
    "time-limit-exceeded": "No plan was there when the time was up",
    "store-unavailable": "The database does not answer",
    "policy-not-found": "The library has no policy with this id",
    "duplicate-policy": "Another policy has this id",
    "invalid-policy": "A field of the policy cannot be stored",
    "damaged-checkpoint": "The stored weights are not those that were registered",
    "internal-error": "The service has a defect, or its machine is in trouble",
}
"""What each type means, for people."""

MAX_LISTED_ERRORS = 100
"""A request of a thousand wrong numbers is told of the first hundred."""


class FieldError(BaseModel):
    """One thing that is wrong with a request."""

    pointer: str = Field(
        description="JSON pointer (RFC 6901) into the body; empty for the body as a whole",
        examples=["/uavs/0/speed"],
    )
    detail: str = Field(description="What is wrong", examples=["is -5, must be at least 1e-09"])
    parameter: str | None = Field(
        default=None, description="The query parameter or header, where the error is not in the body"
    )


class ProblemDetails(BaseModel):
    """Problem details (RFC 9457). Some problems have more members, such as `sizes` or `algorithms`."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(
        description=f"Stable name of the problem; `{ERROR_PAGE}` says what each means",
        examples=["invalid-request"],
    )
    title: str = Field(description="The same for people", examples=["Unprocessable Entity"])
    status: int = Field(description="HTTP status", examples=[422])
    detail: str = Field(description="What is wrong with this request")
    instance: str = Field(description="Path of the request", examples=["/allocate"])
    errors: list[FieldError] | None = Field(
        default=None, description="What is wrong, field by field, where that is known"
    )


def status_of(code: str) -> HTTPStatus:
    """Give an error code its status; 500 for one that is not in the table."""
    return STATUS_OF_CODE.get(code, HTTPStatus.INTERNAL_SERVER_ERROR)


def problem_response(
    code: str,
    detail: str,
    instance: str,
    *,
    errors: Sequence[FieldError] = (),
    extensions: Mapping[str, Any] | None = None,
    headers: Mapping[str, str] | None = None,
) -> JSONResponse:
    """Make the response of a problem.

    Parameters
    ----------
    code
        The problem's type; the table has its status.
    detail
        What is wrong, with offending values and limits.
    instance
        Path of the request.
    errors
        Field by field; of many, the first are listed.
    extensions
        Further members, JSON-ready.
    headers
        Of the response.
    """
    status = status_of(code)
    body: dict[str, Any] = {
        **(extensions or {}),
        "type": code,
        "title": status.phrase,
        "status": status.value,
        "detail": printable(detail),
        "instance": printable(instance),
    }
    if errors:
        body["errors"] = [
            {name: printable(value) for name, value in error.model_dump(exclude_none=True).items()}
            for error in errors[:MAX_LISTED_ERRORS]
        ]
    return JSONResponse(body, status.value, dict(headers or {}), MEDIA_TYPE)


def printable(text: str) -> str:
    """Replace halves of surrogate pairs, which a request can contain and no response can be encoded with."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def responses(*codes: str) -> dict[int | str, dict[str, Any]]:
    """Document the problems of a route for OpenAPI, those that every route has included.

    Parameters
    ----------
    codes
        Problem types that the route can answer with.
    """
    types: dict[int, list[str]] = {
        421: ["host-not-allowed"],
        500: ["internal-error"],
        503: ["store-unavailable"],
    }
    for code in codes:
        types.setdefault(status_of(code).value, []).append(code)
    return {
        status: {
            "description": f"{HTTPStatus(status).phrase}: {', '.join(f'`{name}`' for name in names)}",
            "content": {
                MEDIA_TYPE: {
                    "schema": {"$ref": "#/components/schemas/ProblemDetails"},
                    "examples": {name: {"value": _example(name)} for name in names},
                }
            },
        }
        for status, names in sorted(types.items())
    }


_EXAMPLE_ERRORS: Mapping[str, Sequence[Mapping[str, str]]] = {
    "invalid-request": (
        {"pointer": "/uavs/0/speed", "detail": "is -5, must be at least 1e-09"},
        {
            "pointer": "/targets/2/priority",
            "detail": "unknown field `priority`; there are id, x, y, level, loadlist, deadline, service_time",
        },
    ),
    "invalid-problem": ({"pointer": "/uavs/1/id", "detail": "'uav-1' is already the id of number 0"},),
    "problem-too-large": ({"pointer": "/uavs", "detail": "1200 UAVs, at most 1000 are taken"},),
}


def _example(code: str) -> dict[str, Any]:
    """Show the problem of a type as a request might get it."""
    status, errors = status_of(code), _EXAMPLE_ERRORS.get(code, ())
    detail = f"{errors[0]['pointer']}: {errors[0]['detail']}" if errors else MEANINGS[code]
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    example = {
        "type": code,
        "title": status.phrase,
        "status": status.value,
        "detail": detail + more,
        "instance": "/allocate",
    }
    return example | ({"errors": [dict(each) for each in errors]} if errors else {})
