"""What the service logs: one line an event, JSON for machines, columns and colours on a terminal.

Everything is logged by the standard library's loggers, in the server and in its workers. A line has the id of
the request, and of the job, in whose course it was written, whoever wrote it: who begins one binds its id to
structlog's context, and :func:`labels` carries them to where the work is done. What clients send goes into
fields, never into the message, so that it cannot look like a line of its own; headers, where keys are, and
query strings are not logged.
"""

from __future__ import annotations

import logging
import sys
import threading
import unicodedata
from collections.abc import Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from typing import Any, TextIO

import structlog
from structlog.stdlib import ExtraAdder, ProcessorFormatter

_QUIETER = {"alembic": logging.WARNING, "uvicorn.access": logging.CRITICAL}
"""Loggers that say what nobody asks; requests are logged by :mod:`app.api.request_log`."""

_OBEYED = frozenset({"Cc", "Zl", "Zp"})
_TURNS_TEXT = frozenset("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""What a terminal does instead of showing it: controls, line breaks, changes of direction."""

_log = logging.getLogger(__name__)
_of_process: dict[str, str] = {}


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
        [_show_control_characters, structlog.dev.ConsoleRenderer()]
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
    """Add the ids of what this process does, and drop the server's second copy of its message."""
    event.pop("color_message", None)
    event.update(_of_process)
    return event


def _show_control_characters(
    _logger: object, _method: str, event: MutableMapping[str, Any]
) -> MutableMapping[str, Any]:
    """Write out what a terminal would obey, which a client may have sent; JSON does so by itself."""
    for name, value in event.items():
        if isinstance(value, str) and not value.isprintable():
            event[name] = "".join(each if _is_shown(each) else ascii(each)[1:-1] for each in value)
    return event


def _is_shown(character: str) -> bool:
    obeyed = unicodedata.category(character) in _OBEYED or character in _TURNS_TEXT
    return character.isprintable() or not obeyed


def configure_worker_logs(level: str, stream: TextIO = sys.stderr) -> None:
    """Send everything that a worker logs to a stream, what nobody caught in one of its threads included."""
    configure_logs(level, stream)
    threading.excepthook = _log_uncaught


def labels() -> dict[str, str]:
    """Return the ids that lines have which are written now."""
    return {name: str(value) for name, value in structlog.contextvars.get_contextvars().items()}


@contextmanager
def labelled(given: Mapping[str, str]) -> Iterator[None]:
    """Give these ids to all lines that this process writes meanwhile, whatever thread writes them.

    For a process that does one thing at a time; one that does many binds them to structlog's context.
    """
    _of_process.update(given)
    try:
        yield
    finally:
        _of_process.clear()


def _log_uncaught(uncaught: threading.ExceptHookArgs) -> None:
    if uncaught.exc_value is not None:
        where = None if uncaught.thread is None else uncaught.thread.name
        _log.error(
            "a thread ended with an exception", exc_info=uncaught.exc_value, extra={"thread_name": where}
        )
