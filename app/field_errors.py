"""What is wrong with a field, in this service's words: the value, the limit, and the names there are.

A text is never repeated, since it may be a secret or a megabyte; a number is, and the name of a field that is
unknown.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from app.domain.fields import MIN_MAGNITUDE
from app.domain.said import Said, said

_LONGEST_NAME = 100
_MOST_DIGITS = 30

NEEDS: Mapping[str, str] = {
    "float_type": "{given}, needs a number",
    "float_parsing": "{given}, needs a number",
    "int_type": "{given}, needs a whole number",
    "int_parsing": "{given}, needs a whole number",
    "int_from_float": "{given}, needs a whole number",
    "int_parsing_size": "{given}, needs a smaller number",
    "finite_number": "{given}, needs a finite number",
    "string_type": "{given}, needs a text",
    "bool_type": "{given}, needs true or false",
    "bool_parsing": "{given}, needs true or false",
    "list_type": "{given}, needs a list",
    "dict_type": "{given}, needs an object",
    "model_type": "{given}, needs an object",
    "model_attributes_type": "{given}, needs an object",
}
"""What a value of another type is told, by the kind of error."""

LIMITS: Mapping[str, tuple[str, str]] = {
    "greater_than_equal": ("{given}, must be at least {limit:.16g}", "ge"),
    "greater_than": ("{given}, must be more than {limit:.16g}", "gt"),
    "less_than_equal": ("{given}, must be at most {limit:.16g}", "le"),
    "less_than": ("{given}, must be less than {limit:.16g}", "lt"),
}
"""What a number beyond a limit is told, and the name of the limit, by the kind of error."""


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
    if kind in NEEDS:
        # Where a type is asked for, a text with a number in it is a text.
        as_text = isinstance(given, str) and kind.endswith("_type")
        return said(NEEDS[kind], given=said("is a text") if as_text else _value(given))
    if limits.get("ge") == MIN_MAGNITUDE and isinstance(given, int | float) and given <= 0:
        # A limit that only keeps a number from being 0.
        kind, limits = "greater_than", {"gt": 0}
    if kind in LIMITS:
        sentence, limit = LIMITS[kind]
        return said(sentence, given=_value(given), limit=limits[limit])
    say = _OTHERS.get(kind)
    return str(error["msg"]) if say is None else say(error, names)


def _unknown(error: Mapping[str, Any], names: Sequence[str]) -> str:
    name = str(error["loc"][-1])[:_LONGEST_NAME]
    near = difflib.get_close_matches(name, names, 1)
    if near:
        return said(
            "unknown field `{name}`; did you mean `{near}`? there are {names}",
            name=name,
            near=near[0],
            names=list(names),
        )
    if names:
        return said("unknown field `{name}`; there are {names}", name=name, names=list(names))
    return said("unknown field `{name}`; there are none", name=name)


def _text_length(error: Mapping[str, Any], _names: Sequence[str]) -> str:
    limits, count = error["ctx"], len(error["input"])
    if "min_length" in limits:
        return said(
            "has {count} characters, must have at least {least}", count=count, least=limits["min_length"]
        )
    return said("has {count} characters, must have at most {most}", count=count, most=limits["max_length"])


def _list_length(error: Mapping[str, Any], _names: Sequence[str]) -> str:
    limits = error["ctx"]
    count = limits["actual_length"]
    if "min_length" in limits:
        return said(
            "has {count} elements, must have at least {least}", count=count, least=limits["min_length"]
        )
    return said("has {count} elements, must have at most {most}", count=count, most=limits["max_length"])


def _choice(error: Mapping[str, Any], _names: Sequence[str]) -> str:
    return said("must be {expected}", expected=error["ctx"]["expected"])


def _own(error: Mapping[str, Any], _names: Sequence[str]) -> str:
    """Say what a check of the service's own has raised."""
    raised = error["ctx"]["error"]
    return raised.args[0] if isinstance(raised.args[0], Said) else str(raised)


_OTHERS: Mapping[str, Callable[[Mapping[str, Any], Sequence[str]], str]] = {
    "missing": lambda _error, _names: said("is missing"),
    "extra_forbidden": _unknown,
    "string_too_short": _text_length,
    "string_too_long": _text_length,
    "too_short": _list_length,
    "too_long": _list_length,
    "literal_error": _choice,
    "enum": _choice,
    "string_unicode": lambda _error, _names: said("has text that is not Unicode"),
    "string_pattern_mismatch": lambda error, _names: said(
        "must match {pattern}", pattern=error["ctx"]["pattern"]
    ),
    "value_error": _own,
}


def _value(given: object) -> Said:
    """Say what was given: a number as it is, all else by its kind."""
    if given is None:
        return said("is null")
    if isinstance(given, bool):
        return said("is true") if given else said("is false")
    if isinstance(given, float):
        return said("is {value:.15g}", value=given)
    if isinstance(given, int):
        # Beyond some thousand digits Python writes no integer out.
        return (
            said("is {value}", value=given) if abs(given) < 10**_MOST_DIGITS else said("has very many digits")
        )
    if isinstance(given, str):
        # Parameters of a query come as text.
        if len(given) <= _MOST_DIGITS and _is_number(given):
            return said("is {value}", value=given)
        return said("is a text")
    return said("is a list") if isinstance(given, list | tuple) else said("is an object")


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text)) and text.isascii()
    except ValueError:
        return False
