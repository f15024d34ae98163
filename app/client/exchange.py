"""A request and its answer, whatever way they travel: what is sent, what is tried again, what is read."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote

import httpx

from .errors import ServiceError

NOT_TAKEN_IN = frozenset({"queue-full", "draining", "not-ready"})
"""Problems of requests of which the service has done nothing, so that they may come again."""
_PASSING = frozenset({429, 502, 503})
_FIRST_PAUSE_S = 0.25
_LONGEST_PAUSE_S = 5.0
_FILE_NAME = re.compile(r'filename="([^"]+)"')


def one_part(identifier: str) -> str:
    """Write an id as one part of a path, whatever it is: `..`, or one with a `/`, leads nowhere else."""
    return quote(identifier, safe="").replace(".", "%2E")


@dataclass(frozen=True, slots=True)
class Call:
    """A request to the service.

    Attributes
    ----------
    method, path
        Of HTTP.
    query
        Parameters; those that are None are left out.
    body
        Sent as JSON; None: no body.
    headers
        Further ones; those that are None are left out.
    repeatable
        Whether it does the same when it comes twice, so that it may be sent again when no answer came.
    waits
        Whether the answer may take as long as the work takes.
    """

    method: str
    path: str
    query: Mapping[str, Any] = field(default_factory=dict)
    body: Any = None
    headers: Mapping[str, str | None] = field(default_factory=dict)
    repeatable: bool = False
    waits: bool = False

    def arguments(self, timeout_s: float) -> dict[str, Any]:
        """Return what :mod:`httpx` is told of it.

        Parameters
        ----------
        timeout_s
            Seconds without a byte after which a connection counts as lost, where nothing is waited for.
        """
        return {
            "method": self.method,
            "url": self.path,
            "params": {name: value for name, value in self.query.items() if value is not None},
            "headers": {name: value for name, value in self.headers.items() if value is not None},
            "timeout": httpx.Timeout(timeout_s, read=None) if self.waits else timeout_s,
        } | ({} if self.body is None else {"json": self.body})


@dataclass(frozen=True, slots=True)
class File:
    """A file that the service has written.

    Attributes
    ----------
    name
        As the service names it.
    media_type
        What it is.
    content
        Its bytes.
    """

    name: str
    media_type: str
    content: bytes

    @property
    def text(self) -> str:
        """Its text, of a format that is one; without a byte order mark."""
        return self.content.decode("utf-8-sig")


def file_of(response: httpx.Response) -> File:
    """Read a file out of an answer."""
    named = _FILE_NAME.search(response.headers.get("content-disposition", ""))
    media_type = response.headers.get("content-type", "application/octet-stream").partition(";")[0]
    return File(named[1] if named else "", media_type, response.content)


def error_of(response: httpx.Response) -> ServiceError:
    """Read the error out of an answer that is one."""
    try:
        problem = response.json()
    except ValueError:
        problem = {}
    return ServiceError(
        response.status_code,
        problem if isinstance(problem, dict) else {},
        request_id=response.headers.get("x-request-id"),
        retry_after_s=_seconds(response.headers.get("retry-after")),
    )


def may_come_again(call: Call, error: ServiceError | httpx.TransportError) -> bool:
    """Say whether a request that brought this error may be sent again."""
    if isinstance(error, ServiceError):
        return error.status in _PASSING and (call.repeatable or error.type in NOT_TAKEN_IN)
    # Without a connection nothing was sent.
    return call.repeatable or isinstance(error, httpx.ConnectError | httpx.ConnectTimeout)


def pause_s(attempt: int, error: Exception | None = None) -> float:
    """Return the seconds to wait before the next attempt.

    Parameters
    ----------
    attempt
        How many there were.
    error
        What the last one brought; the service may have said when to come back.
    """
    asked = error.retry_after_s if isinstance(error, ServiceError) else None
    return asked if asked is not None else min(_FIRST_PAUSE_S * 2.0 ** (attempt - 1), _LONGEST_PAUSE_S)


def _seconds(text: str | None) -> float | None:
    return float(text) if text is not None and text.isascii() and text.isdigit() else None
