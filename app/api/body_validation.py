"""A request's body against its model, piece by piece: the check ends at the errors that an answer can list.

The validator that comes with the models collects every error of a body before anybody sees one, and a body of
a megabyte can have millions. So items of lists are checked one after the other, each whole, until there are
as many errors as are listed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, Discriminator, FailFast, Tag, TypeAdapter, ValidationError

from app.api.errors import InvalidBody
from app.api.problem_details import MAX_LISTED_ERRORS, FieldError
from app.domain.errors import escaped
from app.field_errors import in_words
from app.settings import Settings


class _EnoughErrors(Exception):
    """As many errors were found as are listed."""


@dataclass
class _Found:
    """The errors there are so far.

    Attributes
    ----------
    errors
        At most ``MAX_LISTED_ERRORS``.
    built
        How many the validator made of them.
    """

    errors: list[FieldError] = field(default_factory=list)
    built: int = 0

    def add(self, at: str, error: ValidationError, model: type[BaseModel], known: frozenset[str]) -> None:
        """Add what is wrong with an object, but for fields that are known to be wrong."""
        self.built += error.error_count()
        for item in error.errors(include_url=False):
            location = item["loc"]
            if location and location[0] in known:
                continue
            pointer = at + "".join(f"/{escaped(step)}" for step in location)
            self.errors.append(FieldError(pointer=pointer, detail=in_words(item, list(model.model_fields))))
            if len(self.errors) == MAX_LISTED_ERRORS:
                raise _EnoughErrors


class BodyValidator:
    """Checks bodies against what a route declares.

    Parameters
    ----------
    declared
        A model, or several that a discriminator tells apart.
    """

    def __init__(self, declared: Any) -> None:
        self._declared = declared

    def validate(self, body: Any, settings: Settings) -> BaseModel:
        """Make the model of a body.

        Raises
        ------
        InvalidBody
            If a field is missing, unknown, of another type or out of range.
        AllocatorError, RequestError
            If something is larger than it may be here, as ``require_sizes`` of the models says.
        """
        model, found = _model_for(self._declared, body), _Found()
        if isinstance(body, Mapping):
            require_sizes(model, body, settings)
        try:
            made = _validate(model, body, "", found)
        except _EnoughErrors:
            raise InvalidBody(found.errors, all_listed=False, built=found.built) from None
        if made is None:
            raise InvalidBody(found.errors, built=found.built)
        return made


def require_sizes(model: type[BaseModel], body: Mapping[str, Any], settings: Settings, at: str = "") -> None:
    """Let the models inside a body refuse what is too large, before anything of it is looked at.

    A model says so in a class method ``require_sizes(body, settings, at)``; items of lists are left to their
    turn.
    """
    require = getattr(model, "require_sizes", None)
    if require is not None:
        require(body, settings, at)
    for name, (inner, holder) in _models_in(model).items():
        if holder is None and isinstance(body.get(name), Mapping):
            require_sizes(inner, body[name], settings, f"{at}/{name}")


def _validate(model: type[BaseModel], given: Any, at: str, found: _Found) -> BaseModel | None:
    """Make a model; None if anything is wrong, which is then among the errors."""
    wrong: set[str] = set()
    if isinstance(given, dict):
        given = dict(given)
        for name, (inner, holder) in _models_in(model).items():
            value = given.get(name)
            if holder is list and isinstance(value, list):
                given[name] = _validate_items(inner, value, f"{at}/{name}", found)
                if any(each is None for each in given[name]):
                    wrong.add(name)
            elif holder is dict and isinstance(value, dict):
                given[name] = {
                    key: _validate(inner, each, f"{at}/{name}/{escaped(key)}", found)
                    for key, each in value.items()
                }
                if any(each is None for each in given[name].values()):
                    wrong.add(name)
            elif holder is None and isinstance(value, dict):
                given[name] = _validate(inner, value, f"{at}/{name}", found)
                if given[name] is None:
                    wrong.add(name)
        for name in wrong:
            # What is wrong with it is known, and what else is wrong does not depend on it.
            del given[name]
    try:
        made_of_all = model.model_validate(given)
    except ValidationError as error:
        found.add(at, error, model, frozenset(wrong))
        return None
    return None if wrong else made_of_all


def _validate_items(
    model: type[BaseModel], items: list[Any], at: str, found: _Found
) -> Sequence[BaseModel | None]:
    """Make the models of a list; None for each that is wrong."""
    if not _models_in(model):
        # Sound nearly always, and much quicker at once; it ends at the first that is not.
        try:
            return _at_once(model).validate_python(items)
        except ValidationError:
            pass
    return [_validate(model, item, f"{at}/{index}", found) for index, item in enumerate(items)]


@cache
def _at_once(model: type[BaseModel]) -> TypeAdapter[list[BaseModel]]:
    """Return what makes a whole list of models, or stops at the first item that is wrong."""
    return TypeAdapter(Annotated[list[model], FailFast()])  # type: ignore[arg-type, valid-type]  # a model is a type


@cache
def _models_in(model: type[BaseModel]) -> dict[str, tuple[type[BaseModel], type | None]]:
    """Return the fields that are models, and what holds several of them: a list, or an object by names."""
    inside = {}
    for name, declared in model.model_fields.items():
        for kind in _alternatives(declared.annotation):
            holder = next((each for each in (list, dict) if get_origin(kind) is each), None)
            inner = kind if holder is None else get_args(kind)[-1]
            if isinstance(inner, type) and issubclass(inner, BaseModel):
                inside[name] = inner, holder
    return inside


def _alternatives(annotation: Any) -> list[Any]:
    """Return the types that a value may have, but for null, without their limits."""
    several = get_origin(annotation) in (Union, UnionType)
    given = [each for each in get_args(annotation) if each is not NoneType] if several else [annotation]
    return [get_args(each)[0] if get_origin(each) is Annotated else each for each in given]


def _model_for(declared: Any, body: Any) -> type[BaseModel]:
    """Return the model of a body where a discriminator chooses.

    Raises
    ------
    InvalidBody
        If it chooses none.
    """
    if get_origin(declared) is not Annotated:
        return declared  # type: ignore[no-any-return]  # a route declares a model or a choice of models
    choice, *about = get_args(declared)
    discriminator = next(each for each in about if isinstance(each, Discriminator))
    assert callable(discriminator.discriminator)
    chosen = discriminator.discriminator(body)
    for each in get_args(choice):
        model, tag = get_args(each)
        assert isinstance(tag, Tag)
        if tag.tag == chosen:
            return model  # type: ignore[no-any-return]  # as above
    try:
        TypeAdapter(declared).validate_python(body)
    except ValidationError as error:
        errors = [FieldError(pointer="", detail=in_words(item)) for item in error.errors(include_url=False)]
        raise InvalidBody(errors) from None
    raise AssertionError("a body of no form was taken")  # pragma: no cover
