"""What JSON of strangers has to be for everybody to be able to store, list and send it again.

A parser reads more than that: nesting a thousand deep, which writers refuse; NaN and infinity, which are no
JSON; integers of thousands of digits; halves of surrogate pairs and null characters, which databases refuse.
"""

from __future__ import annotations

import json
import math
from typing import Any

DEEPEST = 16
_LARGEST_INTEGER = 2**63 - 1


def fault_of(value: object) -> str | None:
    """Say what is wrong with a JSON-ready value; None where it is sound."""
    waiting = [(value, 0)]
    while waiting:
        each, depth = waiting.pop()
        if isinstance(each, dict | list | tuple):
            if depth == DEEPEST:
                return f"it is nested more than {DEEPEST} deep"
            if isinstance(each, dict):
                if not all(isinstance(name, str) for name in each):
                    return "it has a name that is no text"
                waiting += ((name, depth + 1) for name in each)
                each = each.values()
            waiting += ((item, depth + 1) for item in each)
        elif isinstance(each, str):
            if not is_storable(each):
                return "it has text that is not Unicode, or a null character"
        elif isinstance(each, float):
            if not math.isfinite(each):
                return "it has a number that is not finite"
        elif isinstance(each, int):
            if abs(each) > _LARGEST_INTEGER:
                return f"it has an integer beyond {_LARGEST_INTEGER}"
        elif each is not None:
            return f"it has a {type(each).__name__}, which is not JSON"
    return None


def is_storable(text: str) -> bool:
    """Say whether every database stores a text: not half of a surrogate pair, nor the null character."""
    return "\0" not in text and not any("\ud800" <= character <= "\udfff" for character in text)


def read_object(text: str) -> dict[str, Any]:
    """Read a JSON object that a stranger wrote.

    Raises
    ------
    ValueError
        If it is none, or has what :func:`fault_of` finds; the message says what.
    """
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError("it is not JSON") from None
    fault = fault_of(value) if isinstance(value, dict) else "it is no JSON object"
    if fault is not None:
        raise ValueError(fault)
    found: dict[str, Any] = value
    return found
