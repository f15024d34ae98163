"""A problem on the wire, and its conversion to the domain; the rules between fields are the domain's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from operator import attrgetter
from typing import Any

from app.api.wire_fields import WireModel, from_wire, wire_model
from app.domain.errors import InvalidProblem, ProblemTooLarge, Violation, escaped
from app.domain.fields import Amounts, Items, Kind, Named, declared_fields
from app.domain.problem import Problem
from app.domain.said import Said, noun, said
from app.domain.text_fields import Words
from app.domain.world_fields import Corners, Table
from app.settings import Settings


class ProblemModel(wire_model(Problem), WireModel):  # type: ignore[misc]  # its fields are declared in the domain
    """A swarm, rescue areas, and what a plan is paid for."""

    @classmethod
    def require_sizes(cls, body: Mapping[str, Any], settings: Settings, at: str) -> None:
        """Refuse a problem that is too large before its items are looked at.

        Raises
        ------
        ProblemTooLarge
            As :func:`to_problem` does.
        """
        lists = {name: _items(body.get(name)) for name in _LISTS}
        first = lists["uavs"][0] if lists["uavs"] else None
        materials = len(_items(_field(first, "loadlist")))
        _refuse([*_sizes(lists, materials, settings), *_sizes_of_tables(body, settings)], at)


_LISTS = {each.name: each.kind for each in declared_fields(Problem) if isinstance(each.kind, Items)}
"""The kinds of the lists of a problem by their names."""


def largest(name: str, settings: Settings) -> int:
    """Return how many items a list of a problem may have here; the setting has the list's name."""
    limit: int = getattr(settings, f"max_{name}")
    return limit


def most_elements(kind: Kind, settings: Settings) -> int | None:
    """Return how many elements a field of an item may have here; None where that is not limited."""
    match kind:
        case Amounts():
            return settings.max_materials
        case Words(ids_of=None):
            return settings.max_skills
        case Words(ids_of=str(listed)):
            return largest(listed, settings)
        case Corners():
            return settings.max_zone_corners
        case Table():
            return settings.max_locations
        case Named():
            return settings.max_profiles
    return None


def to_problem(body: ProblemModel, settings: Settings, at: str = "") -> Problem:
    """Convert a problem to the domain.

    Parameters
    ----------
    body
        The problem as it was sent.
    settings
        The sizes that are taken.
    at
        JSON pointer of the problem in the request's body.

    Raises
    ------
    ProblemTooLarge
        If one of its lists has more items than are taken.
    InvalidProblem
        If it breaks a rule between fields. Pointers of both are into the request's body.
    """
    lists = {name: getattr(body, name) for name in _LISTS}
    sizes = _sizes(lists, len(body.uavs[0].loadlist), settings)
    _refuse([*sizes, *_sizes_of_tables(body, settings), *_sizes_of_words(lists, settings)], at)
    try:
        problem: Problem = from_wire(body, Problem)
    except InvalidProblem as error:
        raise InvalidProblem.of([Violation(at + v.pointer, v.detail) for v in error.violations]) from None
    return problem


_Size = tuple[str, Said, int, int | None]
"""Of a list: JSON pointer, what it counts, how many there are, how many are taken; None: as many as are."""


def _sizes(lists: Mapping[str, Sequence[Any]], n_materials: int, settings: Settings) -> Iterator[_Size]:
    for name, kind in _LISTS.items():
        yield f"/{name}", noun(kind.called), len(lists[name]), largest(name, settings)
    # The first UAV says how many materials there are.
    yield "/uavs/0/loadlist", noun("materials"), n_materials, settings.max_materials


def _sizes_of_tables(problem: object, settings: Settings) -> Iterator[_Size]:
    """Yield the sizes of what can be large in few items: a model's, or of a body not yet looked at."""
    polygons = [_items(_field(zone, "polygon")) for zone in _items(_field(problem, "no_fly_zones"))]
    corners = sum(map(len, polygons))
    yield "/no_fly_zones", noun("corners of no-fly zones"), corners, settings.max_zone_corners
    matrices = _field(problem, "matrices")
    if not isinstance(matrices, Mapping):
        return
    yield "/matrices", noun("profiles"), len(matrices), settings.max_profiles
    for name, matrix in islice(matrices.items(), settings.max_profiles):
        for table in ("distance", "duration"):
            rows = len(_items(_field(matrix, table)))
            yield f"/matrices/{escaped(name)}/{table}", noun("rows"), rows, settings.max_locations


def _sizes_of_words(lists: Mapping[str, Sequence[Any]], settings: Settings) -> Iterator[_Size]:
    for name, kind in _LISTS.items():
        for each in declared_fields(kind.of):
            if isinstance(each.kind, Words):
                words = [words or () for words in map(attrgetter(each.name), lists[name])]
                longest = max(map(len, words), default=0)
                index = next((at for at, some in enumerate(words) if len(some) == longest), 0)
                what = noun("words") if each.kind.ids_of is None else noun("ids")
                limit = most_elements(each.kind, settings)
                yield f"/{name}/{index}/{each.name}", what, longest, limit


def _refuse(sizes: Sequence[_Size], at: str) -> None:
    violations = [
        Violation(
            at + pointer,
            said("{count} {items}, at most {most} are taken", count=size, items=what, most=limit),
        )
        for pointer, what, size, limit in sizes
        if limit is not None and size > limit
    ]
    if violations:
        first = violations[0].detail
        several = "; ".join(violation.detail for violation in violations)
        raise ProblemTooLarge(several if len(violations) > 1 else first, violations)


def _field(of: object, name: str) -> object:
    return of.get(name) if isinstance(of, Mapping) else getattr(of, name, None)


def _items(value: object) -> list[Any]:
    return value if isinstance(value, list) else []
