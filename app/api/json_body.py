"""Request bodies: bounded while they arrive, and read as JSON to the letter."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Coroutine
from email.message import Message as Header
from typing import Any

from fastapi import Request
from fastapi.routing import APIRoute
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.errors import BodyTooLarge, MalformedJson, UnsupportedContentEncoding, UnsupportedMediaType
from app.api.problem_details import problem_response

Handler = Callable[[Request], Coroutine[Any, Any, Response]]


class JsonRoute(APIRoute):
    """A route whose body is read by :func:`parse_json`, and only if it is sent as JSON."""

    def get_route_handler(self) -> Handler:
        """Read the body before the framework does, which then finds it read."""
        handle = super().get_route_handler()
        if self.body_field is None:
            return handle

        async def read_and_handle(request: Request) -> Response:
            request = _JsonRequest(request.scope, request.receive)
            try:
                body = await request.body()
            except ClientDisconnect:
                raise HTTPException(400, "the client has gone before the body was complete") from None
            # A time limit begins here: how long the client took to send is not in the service's hands.
            request.state.arrived_s = time.monotonic()
            if body:
                _require_json(request.headers.get("content-type", ""))
                _require_plain(request.headers.get("content-encoding", ""))
                await request.json()
            return await handle(request)

        return read_and_handle


class _JsonRequest(Request):
    """Keeps what was parsed, so it is done once."""

    async def json(self) -> Any:
        if not hasattr(self, "_json"):
            self._json = parse_json(await self.body())
        return self._json


def parse_json(body: bytes) -> Any:
    """Parse JSON (RFC 8259): UTF-8, and no name twice in an object.

    Numbers that are too large become infinite, and ``NaN`` and ``Infinity`` are let through as such, so that
    the check of the fields can say where they are; no field takes them.

    Raises
    ------
    MalformedJson
        If it is not JSON, or nested too deep to be read.
    """
    try:
        return json.loads(body.decode("utf-8"), object_pairs_hook=_unique_names)
    except UnicodeDecodeError as error:
        raise MalformedJson(f"byte {error.start} is not UTF-8") from None
    except json.JSONDecodeError as error:
        raise MalformedJson(f"{error.msg}: line {error.lineno} column {error.colno}") from None
    except RecursionError:
        raise MalformedJson("it is nested too deep") from None
    except ValueError:
        raise MalformedJson("an integer has too many digits") from None


def _unique_names(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    names = dict(pairs)
    if len(names) != len(pairs):
        twice = Counter(name for name, _ in pairs).most_common(1)[0][0]
        raise MalformedJson(f"{twice[:100]!a} is twice in one object")
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
