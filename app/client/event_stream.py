"""Server-sent events, read line by line (the parts of the HTML standard that the service uses)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class StreamEvent:
    """One event of a stream.

    Attributes
    ----------
    id
        For ``Last-Event-ID``: what comes after it is sent then.
    name
        What kind it is.
    data
        Its JSON.
    """

    id: str
    name: str
    data: Any


class EventReader:
    """Puts the lines of a stream together to events."""

    def __init__(self) -> None:
        self._fields: dict[str, list[str]] = {}

    def take(self, line: str) -> StreamEvent | None:
        """Take the next line; return the event that it ends, if it does."""
        if line:
            name, _, value = line.partition(":")
            if name:  # without one it is a comment, which keeps the connection open
                self._fields.setdefault(name, []).append(value.removeprefix(" "))
            return None
        fields, self._fields = self._fields, {}
        if "data" not in fields:
            return None
        return StreamEvent(
            id=fields.get("id", [""])[-1],
            name=fields.get("event", ["message"])[-1],
            data=json.loads("\n".join(fields["data"])),
        )
