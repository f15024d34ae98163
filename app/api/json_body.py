"""Request bodies: bounded while they arrive, read as JSON to the letter, checked beside the event loop."""

from __future__ import annotations

import asyncio
import codecs
import json
import time
from collections import Counter
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from email.message import Message as Header
from typing import Annotated, Any, cast

from fastapi import Request
from fastapi.routing import APIRoute
from pydantic import BaseModel, Discriminator
from pydantic_core import from_json
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.body_validation import BodyValidator
from app.api.errors import (
    BodyTooLarge,
    InvalidBody,
    MalformedJson,
    UnsupportedContentEncoding,
    UnsupportedMediaType,
)
from app.api.json_structure import FEW_VALUES, MOST_NAMES, NestedTooDeep, UnlikelyShape, require_likely_shape
from app.api.problem_details import FieldError, problem_response
from app.domain.said import said
from app.settings import Settings

Handler = Callable[[Request], Coroutine[Any, Any, Response]]

_READ_AT_ONCE_BYTES = 16_384
"""A body up to this is read in a millisecond, less than it takes to hand it over."""

_NESTING = frozenset({dict, list})

_SHOWN = 20
"""Characters of a body that are shown before and after the place where it is not JSON."""

_readers = ThreadPoolExecutor(2, "read-body")
"""Read larger bodies, so that others are answered meanwhile; as few as the memory of so many is known."""


class JsonRoute(APIRoute):
    """A route whose body is sent as JSON, and read and checked by :func:`read_body`."""

    def get_route_handler(self) -> Handler:
        """Read the body before the framework does, which then finds its model made."""
        handle = super().get_route_handler()
        if self.body_field is None:
            return handle
        info = self.body_field.field_info
        choice = [each for each in info.metadata if isinstance(each, Discriminator)]
        validator = BodyValidator(Annotated[info.annotation, choice[0]] if choice else info.annotation)

        async def read_and_handle(request: Request) -> Response:
            request = _CheckedRequest(request.scope, request.receive)
            try:
                body = await request.body()
            except ClientDisconnect:
                raise HTTPException(400, "the client has gone before the body was complete") from None
            # A time limit begins here: how long the client took to send is not in the service's hands.
            request.state.arrived_s = time.monotonic()
            if not body:
                raise InvalidBody([FieldError(pointer="", detail=said("is empty, needs a JSON object"))])
            _require_json(request.headers.get("content-type", ""))
            _require_plain(request.headers.get("content-encoding", ""))
            settings = cast(Settings, request.app.state.services.settings)
            request.checked = await read_in_turn(body, validator, settings)
            return await handle(request)

        return read_and_handle


class _CheckedRequest(Request):
    """Has the model of its body for JSON, so that the framework finds nothing left to check."""

    checked: BaseModel

    async def json(self) -> Any:
        return self.checked


async def read_in_turn(body: bytes, validator: BodyValidator, settings: Settings) -> BaseModel:
    """Do what :func:`read_body` does; a large body is read by another thread than the event loop's."""
    if len(body) <= _READ_AT_ONCE_BYTES:
        return read_body(body, validator, settings)
    loop = asyncio.get_running_loop()
    return await loop.run_in_executor(_readers, read_body, body, validator, settings)


def read_body(body: bytes, validator: BodyValidator, settings: Settings) -> BaseModel:
    """Make the model of a body; nothing is built of a body whose shape no request has.

    Raises
    ------
    MalformedJson
        If it is not JSON.
    InvalidBody, AllocatorError, RequestError
        As :meth:`~app.api.body_validation.BodyValidator.validate` says.
    """
    longest, most_values = longest_list(settings), 2 * settings.max_locations**2
    try:
        # Distances and durations of a profile are one object, with no other in it.
        require_likely_shape(body, longest, max(FEW_VALUES, most_values))
    except NestedTooDeep as error:
        raise MalformedJson(error.reason) from None
    except UnlikelyShape as error:
        raise InvalidBody([FieldError(pointer=error.pointer, detail=error.reason)]) from None
    return validator.validate(parse_json(body), settings)


def longest_list(settings: Settings) -> int:
    """Return how many elements the longest list of any request may have."""
    return max(
        settings.max_uavs,
        settings.max_targets,
        settings.max_materials,
        settings.max_bases,
        settings.max_no_fly_zones,
        settings.max_zone_corners,
        settings.max_locations,
        settings.max_skills,
        settings.batch_limit,
    )


def parse_json(body: bytes) -> Any:
    """Parse JSON (RFC 8259): UTF-8, and no name twice in an object; a byte order mark is passed over.

    Numbers that are too large become infinite, and ``NaN`` and ``Infinity`` are let through as such, so that
    the check of the fields can say where they are; no field takes them.

    Raises
    ------
    MalformedJson
        If it is not JSON, or nested too deep to be read.
    InvalidBody
        If an object has more names than any of a request.
    """
    body = body.removeprefix(codecs.BOM_UTF8)
    with suppress(ValueError):
        value = from_json(body)
        # Every name has a colon: as many names as colons, and none is there twice. In doubt, as where a text
        # has a colon, or something is wrong, the slower parser looks at every object and says what it is.
        if body.count(b":") == _names_in(value):
            return value
    try:
        text = body.decode("utf-8")
        return json.loads(text, object_pairs_hook=_unique_names)
    except UnicodeDecodeError as error:
        raise MalformedJson(said("byte {place} is not UTF-8", place=error.start)) from None
    except json.JSONDecodeError as error:
        before, after = error.doc[max(0, error.pos - _SHOWN) : error.pos], error.doc[error.pos :][:_SHOWN]
        shown = f"{before!a} and then {after!a}" if after else f"{before!a} and then nothing"
        reason = f"{error.msg}: line {error.lineno} column {error.colno}, after {shown}"
        raise MalformedJson(reason) from None
    except RecursionError:
        raise MalformedJson(said("it is nested too deep")) from None
    except ValueError:
        raise MalformedJson(said("an integer has too many digits")) from None


def _names_in(value: Any) -> int:
    """Count the names of all objects; fewer where objects stand in a list behind something else."""
    if isinstance(value, dict):
        if len(value) > MOST_NAMES:
            return -1
        return len(value) + sum(_names_in(each) for each in value.values() if type(each) in _NESTING)
    if isinstance(value, list) and value and type(value[0]) in _NESTING:
        return sum(map(_names_in, value))
    return 0


def _unique_names(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(pairs) > MOST_NAMES:
        detail = said(
            "an object has {count} names, at most {most} are taken", count=len(pairs), most=MOST_NAMES
        )
        raise InvalidBody([FieldError(pointer="", detail=detail)])
    names = dict(pairs)
    if len(names) != len(pairs):
        twice = Counter(name for name, _ in pairs).most_common(1)[0][0]
        raise MalformedJson(said("{name!a} is twice in one object", name=twice[:100]))
    return names


def _require_json(content_type: str) -> None:
    header = Header()
    header["content-type"] = content_type
    subtype = header.get_content_subtype()
    if header.get_content_maintype() != "application" or not (subtype == "json" or subtype.endswith("+json")):
        raise UnsupportedMediaType(content_type[:100])


def _require_plain(content_encoding: str) -> None:
    """Refuse what is compressed: unpacked it could have any size."""
    if content_encoding.strip().lower() not in ("", "identity"):
        raise UnsupportedContentEncoding(content_encoding[:100])


class BodyLimit:
    """Middleware that refuses bodies over a limit: by their announced size, else while they arrive.

    Parameters
    ----------
    app
        The application behind it.
    limit
        Bytes.
    """

    def __init__(self, app: ASGIApp, limit: int) -> None:
        self._app = app
        self._limit = limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, its body counted."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        announced = Headers(scope=scope).get("content-length", "")
        if announced.isdecimal() and int(announced) > self._limit:
            error = BodyTooLarge(self._limit, int(announced))
            refusal = problem_response(error.code, error.detail, scope["path"], extensions=error.extensions)
            await refusal(scope, receive, send)
            return
        received = 0

        async def count() -> Message:
            nonlocal received
            message = await receive()
            if message["type"] == "http.request":
                received += len(message.get("body", b""))
                if received > self._limit:
                    raise BodyTooLarge(self._limit, None)
            return message

        await self._app(scope, count, send)
