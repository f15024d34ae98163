"""How a problem's fields are declared: a kind with its limits, and one sentence, beside the type.

A field of :mod:`app.domain.problem` is declared as ``Annotated[type, kind, "sentence"]``, and nowhere else.
Its check, its record, its place in a request, its column in files and its row in the reference follow from
that. This module has most kinds, :mod:`app.domain.text_fields` those of texts,
:mod:`app.domain.world_fields` those of zones, plans and tables. :mod:`app.domain.field_checks` applies them
to whole problems.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Iterator
from dataclasses import MISSING, dataclass, fields
from functools import cache
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from app.domain.errors import Violation
from app.domain.identifiers import fault_of
from app.domain.said import Said, noun, said
from app.domain.units import PLACE, Axis, Unit

MAX_MAGNITUDE = 1e12
"""Largest absolute value of any number of a problem: keeps every sum and product of the simulator finite."""

MIN_MAGNITUDE = 1e-100
"""Smallest absolute value of a number that is not 0: smaller ones are taken as 0.

Products of three such numbers, and quotients of them and ``MAX_MAGNITUDE``, are still ordinary numbers. A
speed, which must not be 0, is refused below it.
"""

Conversion = Callable[[Any], Any]


@dataclass(frozen=True, slots=True)
class Context:
    """What a check of one field depends on besides the field.

    Attributes
    ----------
    crs
        Of the problem.
    n_materials
        K; None where it is not known.
    """

    crs: str
    n_materials: int | None


@dataclass(frozen=True)
class Kind:
    """Base of all kinds: one that checks nothing, and whose record is the value itself."""

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:  # noqa: ARG002 - for kinds that check something
        """Yield every rule that a value breaks; ``pointer`` is the JSON pointer to it."""
        yield from ()

    @property
    def conversions(self) -> tuple[Conversion, Conversion] | None:
        """Return what turns a value into what JSON can hold, and back; None where both are the same."""
        return None

    def to_record(self, value: Any) -> Any:
        """Turn a value into what JSON can hold."""
        return value if self.conversions is None or value is None else self.conversions[0](value)

    def from_record(self, recorded: Any) -> Any:
        """Turn a recorded value back."""
        return recorded if self.conversions is None or recorded is None else self.conversions[1](recorded)


@dataclass(frozen=True)
class Number(Kind):
    """A finite number within limits.

    Attributes
    ----------
    low, high
        The limits, which are allowed themselves.
    unit
        Its unit, where it has one.
    same_as
        Name of the field whose value it has where a request leaves it out.
    below
        Whether the upper limit itself is not allowed.
    """

    low: float = -MAX_MAGNITUDE
    high: float = MAX_MAGNITUDE
    unit: Unit | None = None
    same_as: str | None = None
    below: bool = False

    def limits(self, context: Context) -> tuple[float, float]:  # noqa: ARG002 - of a coordinate they depend on it
        """Return the smallest and the largest number that is allowed."""
        return self.low, math.nextafter(self.high, -math.inf) if self.below else self.high

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:
        """Yield what is wrong with the number."""
        if self.below and math.isfinite(value) and not self.low <= value < self.high:
            yield Violation(
                pointer,
                said(
                    "{value} is not from {low:g} to below {high:g}", value=value, low=self.low, high=self.high
                ),
            )
            return
        yield from out_of_limits(pointer, value, *self.limits(context))


@dataclass(frozen=True, kw_only=True)
class Coordinate(Number):
    """One of the two numbers of a position; degrees have limits of their own.

    Attributes
    ----------
    axis
        Which of the two.
    """

    axis: Axis
    unit: Unit | None = PLACE

    def limits(self, context: Context) -> tuple[float, float]:
        """Return the limits of the plane or of the globe."""
        most = self.axis.degrees
        return (-most, most) if context.crs == "wgs84" else (self.low, self.high)


@dataclass(frozen=True)
class Amounts(Kind):
    """Amounts of material, one a material, K of them, none below 0.

    Attributes
    ----------
    same_as
        Name of the field whose value None stands for; the two are the same problem.
    """

    same_as: str | None = None

    def limits(self, context: Context) -> tuple[float, float]:  # noqa: ARG002 - as those of numbers
        """Return the smallest and the largest amount that is allowed."""
        return 0.0, MAX_MAGNITUDE

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:
        """Yield what is wrong with their number, and with each of them."""
        materials = context.n_materials
        if materials is not None and len(value) != materials:
            yield Violation(
                pointer,
                said(
                    "{count} amounts, but the first UAV carries {materials} materials",
                    count=len(value),
                    materials=materials,
                ),
            )
        for k, amount in enumerate(value):
            yield from out_of_limits(f"{pointer}/{k}", amount, *self.limits(context))

    @property
    def conversions(self) -> tuple[Conversion, Conversion] | None:
        """Return what makes a list of the amounts, and amounts of the list."""
        return list, tuple


@dataclass(frozen=True)
class Whole(Kind):
    """A whole number within limits.

    Attributes
    ----------
    low, high
        The limits, which are allowed themselves.
    same_as
        Name of the field whose value None stands for.
    """

    low: int
    high: int = int(MAX_MAGNITUDE)
    same_as: str | None = None

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:  # noqa: ARG002 - of all kinds
        """Yield what is wrong with the number."""
        if not self.low <= value <= self.high:
            yield Violation(
                pointer, said("{value} is not in {low}..{high}", value=value, low=self.low, high=self.high)
            )


@dataclass(frozen=True)
class Flag(Kind):
    """True or false.

    Attributes
    ----------
    digit
        Whether requests and records have it as 1 or 0.
    """

    digit: bool = False

    @property
    def conversions(self) -> tuple[Conversion, Conversion] | None:
        """Return what makes 1 or 0 of it, and back, where that is how it is written."""
        return (int, bool) if self.digit else None


@dataclass(frozen=True)
class Choice(Kind):
    """One of a few words."""

    options: tuple[str, ...]

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:  # noqa: ARG002 - of all kinds
        """Yield that it is none of the words."""
        if value not in self.options:
            *others, last = map(repr, self.options)
            yield Violation(
                pointer,
                said("{value!r} is neither {others} nor {last}", value=value, others=others, last=last),
            )


@dataclass(frozen=True)
class Identifier(Kind):
    """A name of an item of a list.

    Attributes
    ----------
    stem
        Items without one are named by it and their place in the list, from 1.
    unique
        Whether only one item of the list may have it.
    """

    stem: str
    unique: bool = True

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:  # noqa: ARG002 - of all kinds
        """Yield the character that is at fault; the list it stands in says whether it is unique."""
        fault = fault_of(value)
        if fault is not None:
            yield Violation(pointer, fault)

    def by_place(self, place: int) -> str:
        """Name the item at a place in the list, from 1."""
        return f"{self.stem}-{place}"


@dataclass(frozen=True)
class Part(Kind):
    """An object with declared fields of its own."""

    of: type


@dataclass(frozen=True)
class Items(Part):
    """A list of objects with declared fields of their own.

    Attributes
    ----------
    called
        What they are called where they are counted.
    least
        How many there must be.
    """

    called: str = ""
    least: int = 0


@dataclass(frozen=True)
class Named(Part):
    """Objects with declared fields of their own, by names that are a client's.

    Attributes
    ----------
    called
        What they are called where they are counted.
    """

    called: str = ""

    def violations(self, pointer: str, value: Any, context: Context) -> Iterator[Violation]:  # noqa: ARG002 - of all kinds
        """Yield that there are none, and the names that could not be an identifier."""
        if not value:
            yield Violation(pointer, too_few(0, self.called, 1))
        for name in value:
            fault = fault_of(name)
            if fault is not None:
                yield Violation(pointer, fault)


@dataclass(frozen=True)
class AlwaysRecorded:
    """Marks a field that records have also where it has its default.

    Others are left out there, so that what a problem does not use leaves no trace: its record is the one that
    was written before there was such a field. So the default of a field without the mark never changes.
    """


ALWAYS_RECORDED = AlwaysRecorded()


@dataclass(frozen=True, slots=True)
class DeclaredField:
    """A field as it is declared.

    Attributes
    ----------
    name
        In the dataclass, in requests, records and files.
    kind
        With its limits.
    sentence
        What it means.
    optional
        Whether None is a value of it.
    default
        What it is where nothing is said; ``MISSING`` where something must be.
    always_recorded
        Whether records have it also where it has its default.
    """

    name: str
    kind: Kind
    sentence: str
    optional: bool
    default: Any
    always_recorded: bool


@cache
def declared_fields(of: type) -> tuple[DeclaredField, ...]:
    """Return the fields of a dataclass in their order.

    Raises
    ------
    TypeError
        If one is not declared as this module says.
    """
    hints = get_type_hints(of, include_extras=True)
    return tuple(_declared(of, each.name, hints[each.name], _default(each)) for each in fields(of))


def _declared(of: type, name: str, hint: Any, default: Any) -> DeclaredField:
    if get_origin(hint) is Annotated:
        inner, *about = get_args(hint)
        kinds = [each for each in about if isinstance(each, Kind)]
        sentences = [each for each in about if isinstance(each, str)]
        if len(kinds) == len(sentences) == 1:
            optional = get_origin(inner) in (Union, types.UnionType) and type(None) in get_args(inner)
            always = default is MISSING or ALWAYS_RECORDED in about
            return DeclaredField(name, kinds[0], sentences[0], optional, default, always)
    raise TypeError(f"{of.__name__}.{name} has no kind, or no sentence, or several: {hint}")


def _default(of_dataclass: Any) -> Any:
    factory = of_dataclass.default_factory
    return of_dataclass.default if factory is MISSING else factory()


def too_few(count: int, called: str, least: int) -> Said:
    """Say that there are too few of what is counted."""
    return said("{count} {items}; at least {least} is needed", count=count, items=noun(called), least=least)


def out_of_limits(pointer: str, value: float, low: float, high: float) -> Iterator[Violation]:
    """Yield that a number is not finite, or beyond its limits."""
    if not math.isfinite(value):
        yield Violation(pointer, said("{value} is not a finite number", value=value))
    elif not low <= value <= high:
        yield Violation(pointer, said("{value} is not in {low:g}..{high:g}", value=value, low=low, high=high))
