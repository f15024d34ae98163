"""Declared fields of whole problems: whether they are sound, what is wrong with them, what is too small.

A problem of thousands of items is sound nearly always. So all numbers are looked at at once first, and what
is wrong is looked for only where something is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from enum import IntEnum
from functools import cache
from itertools import chain
from operator import attrgetter
from typing import Any

import numpy as np
import numpy.typing as npt

from app.domain.errors import Violation, escaped
from app.domain.fields import (
    MIN_MAGNITUDE,
    Amounts,
    Context,
    DeclaredField,
    Identifier,
    Items,
    Kind,
    Named,
    Number,
    Part,
    declared_fields,
    too_few,
)
from app.domain.identifiers import fault_of
from app.domain.said import said

Floats = npt.NDArray[np.float64]

_Column = tuple[DeclaredField, Callable[[Any], Any]]
"""A field, and what gets its value of an item."""


class Look(IntEnum):
    """What a look at many values finds."""

    SOUND = 0
    TINY = 1
    """Sound, but a number that is not 0 is too small to count."""
    WRONG = 2
    """Something may break a rule: :func:`violations_of` says what."""


def look_at(items: Sequence[Any], of: type, context: Context) -> Look:
    """Look at all declared fields of items of a dataclass at once."""
    if not items:
        return Look.SOUND
    found, (numbers, values_of, others) = Look.SOUND, _columns(of)
    if numbers:
        found = _look_at_numbers(list(map(values_of, items)), *_limits(of, context.crs == "wgs84"))
    for each, value_of in others:
        if found is Look.WRONG:
            return Look.WRONG
        # Defaults are sound, and most fields have theirs.
        default = each.default
        values = [value for value in map(value_of, items) if value is not default and value is not None]
        if values:
            found = max(found, _look_at_values(values, each.kind, context))
    rules = getattr(of, "broken_rules", None)
    if rules is not None and any(True for item in items for _ in rules(item)):
        return Look.WRONG
    return found


@cache
def _columns(of: type) -> tuple[list[DeclaredField], Callable[[Any], tuple[Any, ...]], list[_Column]]:
    """Return the fields that are always a number, what gets their values, and all other fields."""
    declared = declared_fields(of)
    numbers = [each for each in declared if isinstance(each.kind, Number) and not each.optional]
    names = [each.name for each in numbers]
    values_of = attrgetter(*names) if len(names) > 1 else lambda item: tuple(getattr(item, n) for n in names)
    others: list[_Column] = [(each, attrgetter(each.name)) for each in declared if each not in numbers]
    return numbers, values_of, others


@cache
def _limits(of: type, on_globe: bool) -> tuple[Floats, Floats]:
    """Return the smallest and the largest of each field that is always a number."""
    numbers, _, _ = _columns(of)
    context = Context("wgs84" if on_globe else "local", None)
    low, high = np.array([each.kind.limits(context) for each in numbers]).T  # type: ignore[attr-defined]  # of numbers
    return low, high


def _look_at_values(values: list[Any], kind: Kind, context: Context) -> Look:
    """Look at what one field of many items is; a kind that is not told apart here is asked for each."""
    if isinstance(kind, Number):
        return _look_at_numbers([values], *kind.limits(context))
    if isinstance(kind, Amounts):
        if context.n_materials is not None and set(map(len, values)) != {context.n_materials}:
            return Look.WRONG
        return _look_at_numbers([list(chain.from_iterable(values))], *kind.limits(context))
    if isinstance(kind, Identifier):
        sound = not (kind.unique and len(set(values)) < len(values)) and not any(map(fault_of, values))
    elif isinstance(kind, Items):
        if any(len(value) < kind.least for value in values):
            return Look.WRONG
        return look_at(list(chain.from_iterable(values)), kind.of, context)
    elif isinstance(kind, Named):
        if any(True for value in values for _ in kind.violations("", value, context)):
            return Look.WRONG
        return look_at([part for value in values for part in value.values()], kind.of, context)
    elif isinstance(kind, Part):
        return look_at(values, kind.of, context)
    else:
        sound = not any(True for value in values for _ in kind.violations("", value, context))
    return Look.SOUND if sound else Look.WRONG


def _look_at_numbers(rows: Sequence[Sequence[Any]], low: Any, high: Any) -> Look:
    try:
        numbers = np.array(rows)
    except ValueError:
        return Look.WRONG
    # What is no number, as a text that reads like one, and an integer beyond 64 bits are not for comparison.
    if numbers.ndim != 2 or numbers.dtype.kind not in "fiub":
        return Look.WRONG
    if not bool(((numbers >= low) & (numbers <= high)).all()):
        return Look.WRONG
    tiny = (np.abs(numbers) < MIN_MAGNITUDE) & (numbers != 0.0)
    return Look.TINY if tiny.any() else Look.SOUND


def violations_of(item: Any, at: str, context: Context) -> Iterator[Violation]:
    """Yield what is wrong with the declared fields of an item, in their order, and with what they hold.

    Parameters
    ----------
    item
        Of a dataclass whose fields are declared. What breaks a rule between its fields, its method
        ``broken_rules`` says, if it has one: pairs of the end of a pointer and the fault.
    at
        JSON pointer to the item.
    context
        What checks depend on besides.
    """
    of: type = type(item)
    for each in declared_fields(of):
        value, pointer = getattr(item, each.name), f"{at}/{each.name}"
        if value is None and each.optional:
            continue
        yield from each.kind.violations(pointer, value, context)
        if isinstance(each.kind, Items):
            yield from _violations_of_items(value, pointer, each.kind, context)
        elif isinstance(each.kind, Named):
            for name, part in value.items():
                yield from violations_of(part, f"{pointer}/{escaped(name)}", context)
        elif isinstance(each.kind, Part):
            yield from violations_of(value, pointer, context)
    rules = getattr(item, "broken_rules", None)
    for pointer, detail in rules() if rules is not None else ():
        yield Violation(at + pointer, detail)


def _violations_of_items(items: Sequence[Any], at: str, kind: Items, context: Context) -> Iterator[Violation]:
    if len(items) < kind.least:
        yield Violation(at, too_few(len(items), kind.called, kind.least))
    declared = declared_fields(kind.of)
    named = [each.name for each in declared if isinstance(each.kind, Identifier) and each.kind.unique]
    first: dict[str, int] = {}
    for index, item in enumerate(items):
        for name in named:
            identifier = getattr(item, name)
            if identifier in first:
                detail = said(
                    "{id!r} is already the id of number {other}", id=identifier, other=first[identifier]
                )
                yield Violation(f"{at}/{index}/{name}", detail)
            elif fault_of(identifier) is None:
                first[identifier] = index
        yield from violations_of(item, f"{at}/{index}", context)


def without_tiny(value: Any) -> Any:
    """Return a value in which every number that is too small to count is 0."""
    if isinstance(value, float):
        return 0.0 if abs(value) < MIN_MAGNITUDE else value
    if isinstance(value, tuple):
        return tuple(map(without_tiny, value))
    if is_dataclass(value) and not isinstance(value, type):
        settled = {each.name: without_tiny(getattr(value, each.name)) for each in fields(value)}
        return replace(value, **settled)
    return value
