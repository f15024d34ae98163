"""The shape of a JSON text before anything is built from it: how long its lists are, how many, how deep.

A text of eight megabytes can hold three million lists. To build them takes seconds and hundreds of megabytes,
and a list of numbers is built in one go, in which nothing else runs. So a text with many lists, objects,
commas or escapes is looked through first, from its beginning, up to the first thing that no request has.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from app.domain.said import noun, said

FEW_CONTAINERS, FEW_VALUES, FEW_ESCAPES = 20_000, 250_000, 100_000
"""What is built at once: some megabytes, in some hundredths of a second."""

BYTES_A_CONTAINER = 16
"""Fewer than any list or object of a request takes: the smallest area has two in 38 bytes."""

DEEPEST = 32
MOST_NAMES = 700
"""More than fit into the properties of an item, the largest object that a request can have."""
_MOST_ESCAPES_A_TEXT = 1_000

_TOKEN = re.compile(
    # A text; a flat list; what begins, ends and separates. Nothing is tried twice.
    rb'"[^"\\]*+(?:\\.[^"\\]*+){0,%d}+"|\[[^\[\]{}"]*+\]|[\[\]{},"]' % _MOST_ESCAPES_A_TEXT,
    re.DOTALL,
)
_OBJECT, _LIST = b"{"[0], b"["[0]


class UnlikelyShape(Exception):
    """A JSON text is not shaped as any request is.

    Parameters
    ----------
    pointer
        JSON pointer of the place.
    reason
        What is wrong there, with the number and the limit.
    """

    def __init__(self, pointer: str, reason: str) -> None:
        super().__init__(reason)
        self.pointer = pointer
        self.reason = reason


class NestedTooDeep(UnlikelyShape):
    """Lists and objects are nested deeper than a parser should follow."""


@dataclass(slots=True)
class _Open:
    """A list or object whose end has not come."""

    is_list: bool
    values: int = 0
    name: bytes = field(default=b"")


def is_small(text: bytes) -> bool:
    """Say whether a text can be parsed as it is; counted as if every character stood outside of texts."""
    return (
        text.count(b"{") + text.count(b"[") <= FEW_CONTAINERS
        and text.count(b",") <= FEW_VALUES
        and text.count(b"\\") <= FEW_ESCAPES
    )


def require_likely_shape(text: bytes, longest_list: int, most_values: int = FEW_VALUES) -> int:
    """Refuse a JSON text that is shaped as no request is. Whether it is JSON at all is not looked at.

    Parameters
    ----------
    text
        The body.
    longest_list
        Most elements of a list.
    most_values
        Most values that stand without an object among them: those of the largest table.

    Returns
    -------
    int
        How many tokens were looked at; 0 for a text that is small.

    Raises
    ------
    UnlikelyShape
        At the first list that is too long, object that has too many names, text of too many escapes, or place
        up to which there are more lists and objects than its bytes can hold.
    NestedTooDeep
        At the first list or object more than ``DEEPEST`` deep.
    """
    if is_small(text):
        return 0
    path: list[_Open] = []
    containers = flat = tokens = 0
    for token in _TOKEN.finditer(text):
        tokens += 1
        begin = token.start()
        first = text[begin]
        if first == ord('"'):
            if token.end() - begin == 1:
                raise UnlikelyShape(
                    _pointer(path), f"a text has more than {_MOST_ESCAPES_A_TEXT} escapes, or no end"
                )
            if path and not path[-1].is_list:
                path[-1].name = token.group()
        elif first == ord(","):
            flat += 1
            if path:
                path[-1].values += 1
                _require_short(path, longest_list)
        elif first in (_OBJECT, _LIST):
            containers += 1
            if containers > FEW_CONTAINERS + begin // BYTES_A_CONTAINER:
                raise UnlikelyShape(
                    _pointer(path), f"{containers} lists and objects up to here, more than a request can have"
                )
            is_whole = token.end() - begin > 1
            commas = token.group().count(b",") if is_whole else 0
            path.append(_Open(first == _LIST, commas))
            if len(path) > DEEPEST:
                raise NestedTooDeep("", said("it is nested more than {most} deep", most=DEEPEST))
            if is_whole:
                flat += commas
                _require_short(path, longest_list)
                path.pop()
        elif path:
            path.pop()
        if first == _OBJECT:
            flat = 0
        elif flat > most_values:
            raise UnlikelyShape(
                _pointer(path), f"more than {most_values} values without an object among them"
            )
    return tokens


def _require_short(path: list[_Open], longest_list: int) -> None:
    innermost = path[-1]
    limit = longest_list if innermost.is_list else MOST_NAMES
    if innermost.values >= limit:
        what = noun("elements") if innermost.is_list else noun("names")
        raise UnlikelyShape(
            _pointer(path[:-1]),
            said("has more than {most} {items}, the most that a request can have", most=limit, items=what),
        )


def _pointer(path: list[_Open]) -> str:
    """Name the place that the innermost value has in those around it."""
    steps = [str(each.values) if each.is_list else _name(each.name) for each in path]
    return "".join(f"/{step}" for step in steps)


def _name(token: bytes) -> str:
    written = token[1:-1][:100].decode("utf-8", "replace")
    return written.replace("~", "~0").replace("/", "~1")
