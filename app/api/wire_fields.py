"""Models of requests made from declared fields, and what was sent turned into the domain's dataclasses.

The limits of one field are checked by its model, so that a request is refused before anything is built of it;
rules between fields are the domain's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING
from functools import cache
from inspect import getdoc
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model

from app.domain import fields, text_fields, world_fields
from app.domain.fields import MAX_MAGNITUDE, DeclaredField, Kind, declared_fields
from app.domain.identifiers import ID_PATTERN, MAX_ID_LENGTH
from app.domain.records import from_values


def _without_point(given: object) -> object:
    return int(given) if isinstance(given, float) and given.is_integer() else given


Whole = Annotated[int, BeforeValidator(_without_point)]
"""An integer as JSON Schema has it: 1.0 is one too, which is what some languages write."""
Coordinate = Annotated[float, Field(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]
"""What it may be on the globe is a rule between fields."""
Identifier = Annotated[
    str,
    # The domain checks the pattern, and names the character that breaks it.
    Field(min_length=1, max_length=MAX_ID_LENGTH, json_schema_extra={"pattern": ID_PATTERN}),
]


class WireModel(BaseModel):
    """Base of everything a request can hold: no unknown fields, no conversions, no NaN, no infinity."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


@cache
def wire_model(of: type) -> type[WireModel]:
    """Make the model of a dataclass with declared fields; the first line of its docstring describes it."""
    definitions: dict[str, Any] = {each.name: _definition(each) for each in declared_fields(of)}
    about = (getdoc(of) or "").partition("\n\n")[0]
    return create_model(f"{of.__name__}Model", __base__=WireModel, __doc__=about, **definitions)


def _definition(field: DeclaredField) -> tuple[Any, Any]:
    kind = field.kind
    needed = _type_of(kind)
    if field.optional or _is_filled_in(kind):
        return needed | None, Field(default=None, description=field.sentence)
    if field.default is MISSING:
        return needed, Field(description=field.sentence)
    if isinstance(kind, fields.Part):
        empty = list if isinstance(kind, fields.Items) else needed
        return needed, Field(default_factory=empty, description=field.sentence)
    # An empty tuple is an empty list to JSON; a list would be copied for every item.
    default = kind.to_record(field.default) if field.default != () else ()
    return needed, Field(default=default, description=field.sentence)


def _is_filled_in(kind: Kind) -> bool:
    """Whether a value that is left out follows from the place in the list, or from another field."""
    return isinstance(kind, fields.Identifier) or getattr(kind, "same_as", None) is not None


def _type_of(kind: Kind) -> Any:
    """Return the type that a kind has in a request."""
    match kind:
        case fields.Number(low=low, high=high, below=below):
            return Annotated[float, Field(ge=low, lt=high) if below else Field(ge=low, le=high)]
        case fields.Amounts():
            amount = Annotated[float, Field(ge=0, le=MAX_MAGNITUDE)]
            return Annotated[list[amount], Field(min_length=1)]
        case fields.Whole(low=low, high=high):
            return _whole(low, high)
        case fields.Flag(digit=digit):
            return _whole(0, 1) if digit else bool
        case fields.Choice(options=options):
            return Literal[options]
        case fields.Identifier() | text_fields.Name():
            return Identifier
        case text_fields.Words(ids_of=of):
            return Annotated[list[Identifier], Field(json_schema_extra={"idsOf": of} if of else None)]
        case text_fields.Properties():
            return dict[str, Any]
        case world_fields.Corners():
            return _list_of(_list_of(Coordinate, 2, 2), world_fields.FEWEST_CORNERS)
        case world_fields.JointActions():
            return _list_of(_list_of(_whole(0, int(MAX_MAGNITUDE))))
        case world_fields.Table():
            return _list_of(_list_of(Annotated[float, Field(ge=0, le=MAX_MAGNITUDE)] | None), 1)
        case fields.Named(of=of):
            return Annotated[dict[Identifier, wire_model(of)], Field(min_length=1)]  # type: ignore[misc]  # made here
        case fields.Items(of=of, least=least):
            return Annotated[list[wire_model(of)], Field(min_length=least)]  # type: ignore[misc]  # made here
        case fields.Part(of=of):
            return wire_model(of)
    raise TypeError(f"no type of a request is known for {kind}")


def _list_of(item: Any, least: int = 0, most: int | None = None) -> Any:
    """Return the type of a list that may be long: it is checked up to the first fault."""
    limits = Field(min_length=least or None, max_length=most, fail_fast=True)
    return Annotated[list[item], limits]


def _whole(low: int, high: int) -> Any:
    # The limits stand before the conversion, which would hide them from the schema.
    return Annotated[int, Field(ge=low, le=high), BeforeValidator(_without_point)]


def from_wire(model: BaseModel, of: type) -> Any:
    """Turn a model with the fields of a dataclass, and maybe others, into the dataclass.

    Raises
    ------
    InvalidProblem
        If it breaks a rule that the domain checks; pointers are relative to the model.
    """
    values: dict[str, Any] = {}
    for each in declared_fields(of):
        value = getattr(model, each.name)
        match each.kind:
            case fields.Items(of=item):
                values[each.name] = tuple(_items_from_wire(value, item))
            case fields.Named(of=part) if value is not None:
                values[each.name] = {name: from_wire(one, part) for name, one in value.items()}
            case fields.Part(of=part) if value is not None:
                values[each.name] = from_wire(value, part)
            case kind:
                values[each.name] = kind.from_record(value)
    return of(**values)


def _items_from_wire(models: Sequence[BaseModel], of: type) -> list[Any]:
    """Turn the models of a list into the dataclass; field by field, which is quicker than item by item."""
    # Most fields have their defaults, which the constructor knows.
    items = [
        {name: values[name] for name in model.model_fields_set}
        for model, values in zip(models, map(vars, models), strict=True)
    ]
    for each in declared_fields(of):
        name, same_as = each.name, getattr(each.kind, "same_as", None)
        if isinstance(each.kind, fields.Identifier):
            for place, item in enumerate(items, 1):
                if item.get(name) is None:
                    item[name] = each.kind.by_place(place)
        elif same_as and each.optional:
            # What is the default is the same problem, written out or not.
            for item in items:
                if item.get(name) is not None and item[name] == item.get(same_as):
                    item[name] = None
        elif same_as:
            for item in items:
                if item.get(name) is None:
                    item[name] = item[same_as]
    return from_values(items, of)
