"""HEAD wherever there is GET (RFC 9110, 9.1): health checks use it, and the framework leaves it out."""

from __future__ import annotations

import re

from starlette.types import ASGIApp, Receive, Scope, Send

from app.api.access.guard import route_path

_STREAM = re.compile(r"/jobs/[^/]+/events|/missions/[^/]+/stream")


def streams(path: str) -> bool:
    """Say whether the answer of a path goes on as long as a job, or a mission, does: there is only GET."""
    return _STREAM.fullmatch(path) is not None


class HeadRequests:
    """Middleware that lets the application answer HEAD as it does GET; the server leaves out the body."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on."""
        if scope["type"] != "http" or scope["method"] != "HEAD" or streams(route_path(scope)):
            await self._app(scope, receive, send)
            return
        # A copy: the server tells by its own that there is no body to send.
        asked = {**scope, "method": "GET"}
        try:
            await self._app(asked, receive, send)
        finally:
            scope.update({name: asked[name] for name in ("route", "path_params") if name in asked})
