"""What is wrong with a field, in this service's words: the value, the limit, and the names there are.

A text is never repeated, since it may be a secret or a megabyte; a number is, and the name of a field that is
unknown.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

_LONGEST_NAME = 100
_MOST_DIGITS = 30

_NEEDED = {
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing_size": "a smaller number",
    "finite_number": "a finite number",
    "string_type": "a text",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "list_type": "a list",
    "dict_type": "an object",
    "model_type": "an object",
    "model_attributes_type": "an object",
}
_LIMITS: Mapping[str, tuple[str, str]] = {
    "greater_than_equal": ("at least", "ge"),
    "greater_than": ("more than", "gt"),
    "less_than_equal": ("at most", "le"),
    "less_than": ("less than", "lt"),
}


def in_words(error: Mapping[str, Any], names: Sequence[str] = ()) -> str:
    """Say what is wrong with a field.

    Parameters
    ----------
    error
        An item of ``pydantic.ValidationError.errors()``.
    names
        Names of the fields there are beside it, for one that is unknown.
    """
    kind, given, limits = error["type"], error.get("input"), error.get("ctx", {})
    if kind in _NEEDED:
        return f"{_value(given)}, needs {_NEEDED[kind]}"
    if kind in _LIMITS:
        words, limit = _LIMITS[kind]
        return f"{_value(given)}, must be {words} {_number(limits[limit])}"
    say = _OTHERS.get(kind)
    return str(error["msg"]) if say is None else say(error, names)


def _unknown(error: Mapping[str, Any], names: Sequence[str]) -> str:
    name = str(error["loc"][-1])
    near = difflib.get_close_matches(name[:_LONGEST_NAME], names, 1)
    guess = f"did you mean `{near[0]}`? " if near else ""
    there = f"there are {', '.join(names)}" if names else "there are none"
    return f"unknown field `{name[:_LONGEST_NAME]}`; {guess}{there}"


def _text_length(error: Mapping[str, Any], _names: Sequence[str]) -> str:
    limits = error["ctx"]
    bound = _bound(limits)
    return f"has {len(error['input'])} characters, {bound}"


def _list_length(error: Mapping[str, Any], _names: Sequence[str]) -> str:
    limits = error["ctx"]
    return f"has {limits['actual_length']} elements, {_bound(limits)}"


def _bound(limits: Mapping[str, Any]) -> str:
    least = limits.get("min_length")
    return f"must have at most {limits['max_length']}" if least is None else f"must have at least {least}"


def _choice(error: Mapping[str, Any], _names: Sequence[str]) -> str:
    return f"must be {error['ctx']['expected']}"


_OTHERS: Mapping[str, Callable[[Mapping[str, Any], Sequence[str]], str]] = {
    "missing": lambda _error, _names: "is missing",
    "extra_forbidden": _unknown,
    "string_too_short": _text_length,
    "string_too_long": _text_length,
    "too_short": _list_length,
    "too_long": _list_length,
    "literal_error": _choice,
    "enum": _choice,
    "string_unicode": lambda _error, _names: "has text that is not Unicode",
    "string_pattern_mismatch": lambda error, _names: f"must match {error['ctx']['pattern']}",
    "value_error": lambda error, _names: str(error["msg"]).removeprefix("Value error, "),
}


def _value(given: object) -> str:
    """Say what was given: a number as it is, all else by its kind."""
    if given is None:
        return "is null"
    if isinstance(given, bool):
        return f"is {str(given).lower()}"
    if isinstance(given, int | float):
        return f"is {_number(given)}"
    if isinstance(given, str):
        # Parameters of a query come as text.
        return f"is {given}" if len(given) <= _MOST_DIGITS and _is_number(given) else "is a text"
    if isinstance(given, list | tuple):
        return "is a list"
    return "is an object"


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text)) and text.isascii()
    except ValueError:
        return False


def _number(number: float) -> str:
    if isinstance(number, int):
        # Beyond some thousand digits Python writes no integer out.
        return f"{number}" if abs(number) < 10**_MOST_DIGITS else "a number of many digits"
    return f"{number:.15g}"
