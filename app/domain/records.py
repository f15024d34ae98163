"""Problems as plain JSON-ready records and back: how they are stored and sent between processes.

A record means the same in a later version: defaults have been filled in, but for those that never change
(:class:`~app.domain.fields.AlwaysRecorded`). The fields are those that are declared; what their kinds say of
records is done here for many items at once.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from itertools import repeat
from operator import attrgetter, is_
from typing import Any

from app.domain.fields import Conversion, Items, Kind, Named, Part, declared_fields
from app.domain.problem import Problem

_PLAIN = (float, int, str, bool)


def problem_to_record(problem: Problem) -> dict[str, Any]:
    """Turn a problem into a record, with the field names of the specification."""
    return _recorded([problem], Problem)[0]


def problem_from_record(record: Mapping[str, Any]) -> Problem:
    """Turn a record into a problem.

    Raises
    ------
    InvalidProblem
        If the record breaks a rule of the problem.
    KeyError, TypeError
        If it is no record of :func:`problem_to_record`. A field that was not there yet when it was written
        has its default.
    """
    problem: Problem = _read([record], Problem)[0]
    return problem


def item_to_record(item: Any) -> dict[str, Any]:
    """Turn an item of a problem into a record, without fields that have a default that never changes."""
    return _recorded([item], type(item))[0]


def to_record(value: Any) -> Any:
    """Turn a dataclass, and what it holds, into dictionaries, lists and plain values.

    What :func:`dataclasses.asdict` does, without copying what cannot change: a fraction of its time, which
    counts for problems and plans of a thousand UAVs.
    """
    if value is None or isinstance(value, float | int | str):
        return value
    if isinstance(value, tuple | list):
        flat = not value or isinstance(value[0], float | int | str)
        return list(value) if flat else [to_record(each) for each in value]
    if is_dataclass(value) and not isinstance(value, type):
        names, values_of = _fields(type(value))
        return {
            name: each if each is None or type(each) in _PLAIN else to_record(each)
            for name, each in zip(names, values_of(value), strict=True)
        }
    return value


@cache
def _fields(of: type) -> tuple[tuple[str, ...], Callable[[Any], tuple[Any, ...]]]:
    """Return the names of a dataclass's fields, and what gets all their values at once.

    The order is that of the constructor. A checkpoint has a record in it, and the same checkpoint has the
    same bytes in every version.
    """
    names = tuple(field.name for field in sorted(fields(of), key=attrgetter("kw_only")))
    return names, _getter(names)


def _getter(names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    if len(names) < 2:
        # Of one name it would get the value itself, and of none nothing at all.
        return lambda value: tuple(getattr(value, name) for name in names)
    return attrgetter(*names)


@dataclass(frozen=True, slots=True)
class _Recording:
    """How items of a dataclass with declared fields are recorded.

    Attributes
    ----------
    names
        Of the fields that records always have.
    values_of
        Gets the values of all of them at once.
    others
        Names of the other fields, what gets the value of each, and its default, at which it is left out.
    to_record, from_record
        What turns the values of some of them into what JSON can hold, and back.
    """

    names: tuple[str, ...]
    values_of: Callable[[Any], tuple[Any, ...]]
    others: tuple[tuple[str, Callable[[Any], Any], Any], ...]
    to_record: tuple[tuple[str, Conversion], ...]
    from_record: tuple[tuple[str, Conversion], ...]


@cache
def _recording(of: type) -> _Recording:
    declared = declared_fields(of)
    converted = [(each.name, _conversions(each.kind)) for each in declared]
    others = {each.name: each for each in declared if not each.always_recorded}
    names = tuple(name for name in _fields(of)[0] if name not in others)
    return _Recording(
        names,
        _getter(names),
        tuple((name, attrgetter(name), each.default) for name, each in others.items()),
        tuple((name, conversions[0]) for name, conversions in converted if conversions),
        tuple((name, conversions[1]) for name, conversions in converted if conversions),
    )


def _conversions(kind: Kind) -> tuple[Conversion, Conversion] | None:
    """Return what turns values of a kind into records, and back; None where they are the same."""
    if isinstance(kind, Items):
        return lambda items: _recorded(items, kind.of), lambda records: tuple(_read(records, kind.of))
    if isinstance(kind, Named):
        return (
            lambda parts: dict(zip(parts, _recorded(parts.values(), kind.of), strict=True)),
            lambda records: dict(zip(records, _read(records.values(), kind.of), strict=True)),
        )
    if isinstance(kind, Part):
        return lambda part: _recorded([part], kind.of)[0], lambda record: _read([record], kind.of)[0]
    return kind.conversions


def _recorded(items: Collection[Any], of: type) -> list[dict[str, Any]]:
    recording = _recording(of)
    names, values_of = recording.names, recording.values_of
    records = [dict(zip(names, values_of(item))) for item in items]  # noqa: B905 - as long as each other, and quicker
    for name, value_of, default in recording.others:
        values = list(map(value_of, items))
        # Nearly always, and looked at quicker than one by one.
        if all(map(is_, values, repeat(default))):
            continue
        for record, value in zip(records, values, strict=True):
            if value is not default and (default is None or value != default):
                record[name] = value
    for name, convert in recording.to_record:
        for record in records:
            value = record.get(name)
            if value is not None:
                record[name] = convert(value)
    return records


def _read(records: Iterable[Mapping[str, Any]], of: type) -> list[Any]:
    return from_values([{**record} for record in records], of)


def from_values(items: list[dict[str, Any]], of: type) -> list[Any]:
    """Build a dataclass with declared fields of the values that records of its items have.

    Parameters
    ----------
    items
        Values by the names of the fields. They are used up: a problem has thousands, and a copy takes time.
    of
        The dataclass.
    """
    for name, convert in _recording(of).from_record:
        for values in items:
            # A record of an earlier version lacks fields, of which the constructor knows the defaults.
            if values.get(name) is not None:
                values[name] = convert(values[name])
    return [of(**values) for values in items]
