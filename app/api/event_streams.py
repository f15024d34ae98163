"""Server-sent events: what their routes read and answer with."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import Header
from sse_starlette import EventSourceResponse, ServerSentEvent

_MOST_DIGITS = 18
_FAREWELL_S = 2.0

LastEventId = Annotated[
    str | None, Header(description="Id of the last event that was seen: only later ones are sent")
]


def last_seen(given: str | None) -> int:
    """Return the number of the last event that a client saw; 0 for none, and for what is no number."""
    known = given is not None and given.isascii() and given.isdigit() and len(given) <= _MOST_DIGITS
    return int(given) if given is not None and known else 0


def event_stream(events: AsyncIterator[ServerSentEvent]) -> EventSourceResponse:
    """Send events as they come; when the server stops, they have a moment to end."""
    return EventSourceResponse(events, shutdown_grace_period=_FAREWELL_S)
