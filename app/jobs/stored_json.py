"""JSON as the database stores it, written once and read only where somebody asks for what is in it.

The largest requests and answers are megabytes, and are handed on while a time limit runs: from the service to
the table, to a worker, back to the table, and out. So what is large travels as the text that it is.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic_core import PydanticSerializationError, from_json, to_json

_SMALL = 10_000
"""Characters of a text that is read at once."""

_NOT_FINITE = "NaN", "Infinity"


class StoredJson(Mapping[str, Any]):
    """A JSON object as its text.

    Parameters
    ----------
    text
        As :func:`write` returns it.
    is_new
        Whether it comes from a worker of this service, and not from the table, where an earlier version may
        have put it.

    Raises
    ------
    ValueError
        By whatever looks into it, if it cannot be read.
    """

    __slots__ = ("_value", "is_new", "text")

    def __init__(self, text: str, is_new: bool = False) -> None:
        self.text, self.is_new = text, is_new
        self._value: dict[str, Any] | None = None

    def __getitem__(self, name: str) -> Any:
        return self._read()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._read())

    def __len__(self) -> int:
        return len(self._read())

    def __reduce__(self) -> tuple[type[StoredJson], tuple[str, bool]]:
        return StoredJson, (self.text, self.is_new)

    def __repr__(self) -> str:
        return f"StoredJson({self.text[:40]!r}…)"

    def _read(self) -> dict[str, Any]:
        if self._value is None:
            value = read(self.text)
            if not isinstance(value, dict):
                raise ValueError("it is no JSON object that can be read")
            self._value = value
        return self._value


def write(value: Any) -> str:
    """Write a JSON-ready value: what the standard library writes, in a fraction of its time."""
    if isinstance(value, StoredJson):
        return value.text
    try:
        return to_json(value).decode()
    except (PydanticSerializationError, UnicodeEncodeError):
        # Halves of surrogate pairs, which only JSON's own escapes can carry.
        return json.dumps(value)


def written(value: Mapping[str, Any]) -> StoredJson:
    """Write an object down.

    Raises
    ------
    TypeError, ValueError
        If it is not JSON-ready: something in it is of another type, or not a finite number.
    """
    text = write(value)
    if any(each in text for each in _NOT_FINITE):
        json.dumps(value, allow_nan=False)  # it may be in a name
    return StoredJson(text, is_new=True)


def read_later(stored: Any) -> Any:
    """Return what a text holds, a large object as a :class:`StoredJson`; what is no text is that itself."""
    if not isinstance(stored, str):
        return stored
    return StoredJson(stored) if len(stored) > _SMALL else read(stored)


def read(text: str) -> Any:
    """Read a value that was written by :func:`write`, or by an earlier version; None if nobody can."""
    try:
        return from_json(text)
    except ValueError:
        pass
    try:
        return json.loads(text)
    except RecursionError:
        # One row that is nested too deep is to break no list.
        return None
