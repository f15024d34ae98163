"""Every request as a line of the log and as a count in the metrics."""

from __future__ import annotations

import logging
import time

from asgi_correlation_id import correlation_id
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from structlog.contextvars import bind_contextvars

from app.api.metrics import Metrics

_QUIET_ROUTES = frozenset({"/healthz", "/readyz", "/metrics"})
"""Asked every few seconds by machines: logged only if something is wrong with them."""

_log = logging.getLogger(__name__)


class RequestLog:
    """Middleware that logs and counts requests when they end.

    Parameters
    ----------
    app
        The application behind it.
    metrics
        Where requests are counted.
    """

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and tell of it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        # Every line that is logged in the course of the request has its id, those of its job included.
        bind_contextvars(request_id=correlation_id.get())
        begun = time.perf_counter()
        # What raises is answered with 500 outside of this middleware.
        status, answered_s = 500, None

        async def watch(message: Message) -> None:
            nonlocal status, answered_s
            if message["type"] == "http.response.start":
                status, answered_s = message["status"], time.perf_counter() - begun
            await send(message)

        try:
            await self._app(scope, receive, watch)
        finally:
            took_s = time.perf_counter() - begun
            route = getattr(scope.get("route"), "path", None)
            self._metrics.answered(
                scope["method"], route, status, took_s if answered_s is None else answered_s
            )
            quiet = route in _QUIET_ROUTES and status < 500
            _log.log(
                logging.DEBUG if quiet else logging.INFO,
                "request",
                extra={
                    "method": scope["method"],
                    "path": scope["path"],
                    "status": status,
                    "duration_ms": round(1000 * took_s, 1),
                    "client": scope["client"][0] if scope.get("client") else None,
                },
            )
