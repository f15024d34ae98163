"""The guard: middleware that lets through who has a key for what is asked for.

It stands in front of the routes and knows them by method and path, so a new route needs a key unless it is
named here, and nothing of a request's body is read for somebody who has none.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Mapping
from contextvars import ContextVar
from functools import partial
from typing import Any

from fastapi import FastAPI
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send
from structlog.contextvars import bind_contextvars

from app.api.access.hosts import Hosts
from app.api.access.keys import ApiKey, KeyStore, Role, recognise
from app.api.problem_details import problem_response, responses
from app.api.problem_types import ERROR_PAGE
from app.api.store_away import store_unavailable
from app.domain.said import said
from app.store_faults import STORE_IS_AWAY

OPEN_PATHS = frozenset({"/", "/healthz", "/readyz", "/docs", ERROR_PAGE, "/openapi.json", "/favicon.ico"})
"""What needs no key: whether the service is well, and pages; what those show, they ask for with a key."""

OPEN_FOLDERS = ("/docs/assets/", "/dashboard/")

SCHEME: dict[str, Any] = {
    "type": "http",
    "scheme": "bearer",
    "description": "An API key, made by `python -m app keys create`. A key of the role `allocate` is for "
    "allocations, jobs and reading, one of the role `library` for registering and deleting policies too. "
    "Without any key made, a service on the loopback interface takes requests from everybody there.",
}

client: ContextVar[str] = ContextVar("client", default="public")
"""Id of the key that the present request came with; ``public`` where none is needed."""

key_is_valid: ContextVar[Callable[[], Awaitable[bool]] | None] = ContextVar("key_is_valid", default=None)
"""For answers that go on: asks whether the key of the present request is still valid; None without one."""

_REALM = 'Bearer realm="uav-allocator"'
_REMEMBERED_S = 1.0


def needed_role(method: str, path: str) -> Role | None:
    """Return the role that a request needs; None where no key is needed.

    Parameters
    ----------
    method
        Upper case.
    path
        Of the request below the root path, or the template of its route.
    """
    if path in OPEN_PATHS or path.startswith(OPEN_FOLDERS):
        return None
    reads = method in ("GET", "HEAD") or (method, path) == ("POST", "/library/similar")
    return Role.LIBRARY if path.startswith("/library") and not reads else Role.ALLOCATE


def route_path(scope: Scope) -> str:
    """Return the path of a request below the root path that a proxy or a mount puts before it."""
    path, root = str(scope["path"]), str(scope.get("root_path", "")).rstrip("/")
    return path.removeprefix(root) if root and path.startswith(f"{root}/") else path


def document(operation: dict[str, Any], role: Role | None, *, required: bool) -> None:
    """Add to an operation of an OpenAPI description what a key has to do with it.

    Parameters
    ----------
    operation
        Changed in place.
    role
        As :func:`needed_role` returns it.
    required
        False where the service may be one that needs no keys.
    """
    if role is None:
        return
    operation["security"] = [{"ApiKey": []}] if required else [{}, {"ApiKey": []}]
    codes = ("unauthenticated", "forbidden") if role is Role.LIBRARY else ("unauthenticated",)
    for status, response in responses(*codes).items():
        operation["responses"].setdefault(str(status), response)


class Guard:
    """Middleware that refuses requests without a key for what they ask.

    Parameters
    ----------
    app
        The application behind it; its state has the services.
    always
        True: also while no key was ever made. False: from the first key on.
    never
        True: nobody needs a key.
    hosts
        Names by which the service may be called.
    """

    def __init__(self, app: ASGIApp, *, always: bool, never: bool, hosts: Hosts) -> None:
        self._app = app
        self._never, self._hosts = never, hosts
        self._always = always
        self._keys: Mapping[str, ApiKey] = {}
        self._read_at = float("-inf")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or answer 401 or 403."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        role = needed_role(scope["method"], route_path(scope))
        # Whether the service lives is told without its database.
        known = self._never or role is None
        try:
            keys = {} if known else await self._newest(scope["app"].state.services.keys)
        except STORE_IS_AWAY as error:
            await store_unavailable(error, scope["path"])(scope, receive, send)
            return
        is_open = self._never or not (known or keys or self._always)
        # A page elsewhere can have its own name lead to this machine, and would then read what needs no key.
        if (is_open or self._hosts.were_named) and not self._hosts.may_be(Headers(scope=scope).get("host")):
            refusal = problem_response(
                "host-not-allowed",
                said("the header Host has no name of this service; ALLOCATOR_ALLOWED_HOSTS adds names"),
                scope["path"],
            )
            await refusal(scope, receive, send)
            return
        if role is None or is_open:
            await self._app(scope, receive, send)
            return
        scheme, _, token = Headers(scope=scope).get("authorization", "").partition(" ")
        if scheme.lower() != "bearer":
            refusal = problem_response(
                "unauthenticated",
                said("this service needs an API key: Authorization: Bearer …"),
                scope["path"],
                headers={"WWW-Authenticate": _REALM},
            )
        elif (key := recognise(token.strip(), keys)) is None:
            refusal = problem_response(
                "unauthenticated",
                said("this API key is unknown, or was revoked"),
                scope["path"],
                headers={"WWW-Authenticate": f'{_REALM}, error="invalid_token"'},
            )
        elif not key.role.allows(role):
            refusal = problem_response(
                "forbidden",
                said(
                    "this needs a key of the role {role}, key {id} has the role {has}",
                    role=str(role),
                    id=key.id,
                    has=str(key.role),
                ),
                scope["path"],
                headers={"WWW-Authenticate": f'{_REALM}, error="insufficient_scope", scope="{role}"'},
            )
        else:
            client.set(key.id)
            bind_contextvars(key_id=key.id)
            key_is_valid.set(partial(self._is_valid, scope["app"], token.strip()))
            await self._app(scope, receive, send)
            return
        await refusal(scope, receive, send)

    async def _is_valid(self, app: FastAPI, token: str) -> bool:
        """Say whether a token that was let through would still be."""
        return recognise(token, await self._newest(app.state.services.keys)) is not None

    async def _newest(self, store: KeyStore) -> Mapping[str, ApiKey]:
        """Return the keys as they were at most a second ago: another process makes and revokes them."""
        if time.monotonic() - self._read_at > _REMEMBERED_S:
            read_at = time.monotonic()
            self._keys = {key.id: key for key in await asyncio.to_thread(store.all)}
            self._read_at = read_at
        return self._keys
