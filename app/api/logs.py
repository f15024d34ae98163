"""What the service logs: one line an event, JSON for machines, columns and colours on a terminal.

Everything is logged by the standard library's loggers. A line has the id of the request, and of the job, in
whose course it was written, whoever wrote it. What clients send goes into fields, never into the message, so
that it cannot look like a line of its own; headers, where keys are, and query strings are not logged.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import MutableMapping
from typing import Any, TextIO

import structlog
from asgi_correlation_id import correlation_id
from structlog.stdlib import ExtraAdder, ProcessorFormatter

_QUIETER = {"alembic": logging.WARNING, "uvicorn.access": logging.CRITICAL}
"""Loggers that say what nobody asks; requests are logged by :mod:`app.api.request_log`."""


def configure_logs(level: str, stream: TextIO = sys.stderr) -> None:
    """Send everything that this process logs to a stream.

    Parameters
    ----------
    level
        ``debug``, ``info``, ``warning`` or ``error``.
    stream
        A terminal gets coloured columns, anything else a JSON object a line.
    """
    terminal = stream.isatty()
    render: list[Any] = (
        [structlog.dev.ConsoleRenderer()]
        if terminal
        else [structlog.processors.format_exc_info, structlog.processors.JSONRenderer()]
    )
    handler = logging.StreamHandler(stream)
    handler.setFormatter(
        ProcessorFormatter(
            foreign_pre_chain=[
                structlog.contextvars.merge_contextvars,
                structlog.stdlib.add_log_level,
                structlog.stdlib.add_logger_name,
                ExtraAdder(),
                structlog.processors.TimeStamper(fmt="iso", utc=True, key="time"),
                _finish,
            ],
            processors=[ProcessorFormatter.remove_processors_meta, *render],
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level.upper())
    for name, least in _QUIETER.items():
        logging.getLogger(name).setLevel(least)
    logging.captureWarnings(True)


def _finish(_logger: object, _method: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
    """Add the request's id, and drop the server's second copy of its message, which has colours."""
    event.pop("color_message", None)
    request_id = correlation_id.get()
    if request_id is not None:
        event["request_id"] = request_id
    return event
