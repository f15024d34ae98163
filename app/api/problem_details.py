"""Errors on the wire: problem details (RFC 9457) of the types of :mod:`app.api.problem_types`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from pydantic import BaseModel, ConfigDict, Field
from starlette.responses import JSONResponse

from app.api.problem_types import PROBLEM_TYPES, status_of, type_of

MEDIA_TYPE = "application/problem+json"

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
        description="Stable name of the problem; it leads to what it means and what to do about it",
        examples=[type_of("invalid-request")],
    )
    title: str = Field(description="The same for people", examples=["Unprocessable Entity"])
    status: int = Field(description="HTTP status", examples=[422])
    detail: str = Field(description="What is wrong with this request")
    instance: str = Field(description="Path of the request", examples=["/allocate"])
    errors: list[FieldError] | None = Field(
        default=None, description="What is wrong, field by field, where that is known"
    )


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
        "type": type_of(code),
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
    detail = f"{errors[0]['pointer']}: {errors[0]['detail']}" if errors else PROBLEM_TYPES[code].meaning
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    example = {
        "type": type_of(code),
        "title": status.phrase,
        "status": status.value,
        "detail": detail + more,
        "instance": "/allocate",
    }
    return example | ({"errors": [dict(each) for each in errors]} if errors else {})
