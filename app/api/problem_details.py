"""Errors on the wire: problem details (RFC 9457) of the types of :mod:`app.api.problem_types`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, model_validator
from starlette.responses import JSONResponse

from app.api.problem_types import PROBLEM_TYPES, status_of, title_of, type_of
from app.domain.said import Said, to_record

MEDIA_TYPE = "application/problem+json"

MAX_LISTED_ERRORS = 100
"""A request of a thousand wrong numbers is told of the first hundred."""


class Worded(BaseModel):
    """What is wrong, also as a sentence that can be translated, where the service has one for it.

    ``detail`` may be given as :class:`~app.domain.said.Said`, which has the other two with it.
    """

    sentence: str | None = Field(
        default=None,
        description="`detail` with places for its values, the same for every error of its kind: the key of "
        "its translation; none where the service has no such sentence",
        examples=["{given}, must be more than {limit}"],
    )
    values: dict[str, Any] | None = Field(
        default=None,
        description="By the places in `sentence`: a number, a text, a list of texts, or an object with "
        "`detail`, `sentence` and `values` of its own",
        examples=[
            {
                "given": {"detail": "is -5", "sentence": "is {value}", "values": {"value": -5}},
                "limit": 0,
            }
        ],
    )

    @model_validator(mode="before")
    @classmethod
    def _with_sentence(cls, given: Any) -> Any:
        return {**given, **to_record(given["detail"])} if isinstance(given.get("detail"), Said) else given


class FieldError(Worded):
    """One thing that is wrong with a request."""

    pointer: str = Field(
        description="JSON pointer (RFC 6901) into the body; empty for the body as a whole",
        examples=["/uavs/0/speed"],
    )
    detail: str = Field(description="What is wrong", examples=["is -5, must be more than 0"])
    parameter: str | None = Field(
        default=None, description="The query parameter or header, where the error is not in the body"
    )


class ProblemDetails(Worded):
    """Problem details (RFC 9457). Some problems have more members, such as `sizes` or `algorithms`."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(
        description="Stable name of the problem; it leads to what it means and what to do about it",
        examples=[type_of("invalid-request")],
    )
    title: str = Field(
        description="What the type means, for people; the same for every problem of the type",
        examples=[title_of("invalid-request")],
    )
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
        "title": title_of(code),
        "status": status.value,
        **printable(to_record(detail)),
        "instance": printable(instance),
    }
    if errors:
        body["errors"] = [
            # What people look for stands first.
            printable({"pointer": each.pointer, "detail": each.detail, **each.model_dump(exclude_none=True)})
            for each in errors[:MAX_LISTED_ERRORS]
        ]
    return JSONResponse(body, status.value, dict(headers or {}), MEDIA_TYPE)


def printable(value: Any) -> Any:
    """Replace halves of surrogate pairs, which a request can contain and no response can be encoded with."""
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode("utf-8")
    if isinstance(value, dict):
        return {name: printable(each) for name, each in value.items()}
    return [printable(each) for each in value] if isinstance(value, list) else value


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
        {"pointer": "/uavs/0/speed", "detail": "is -5, must be more than 0"},
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
        "title": title_of(code),
        "status": status.value,
        "detail": detail + more,
        "instance": "/allocate",
    }
    return example | ({"errors": [dict(each) for each in errors]} if errors else {})
