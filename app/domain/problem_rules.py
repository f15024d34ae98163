"""Rules between the fields of a problem: what excludes each other, what needs each other, what fits.

Each is a pair: the end of a JSON pointer, and what is wrong there. Nothing is relied on but the types of the
fields: a rule is looked at also where a field breaks its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from operator import attrgetter
from typing import TYPE_CHECKING

from app.domain.fields import declared_fields
from app.domain.matrix_rules import broken_rules_of_matrices
from app.domain.said import noun, said
from app.domain.text_fields import Words
from app.domain.zone_rules import broken_rules_of_zones

if TYPE_CHECKING:
    from app.domain.problem import Problem

Rules = Iterator[tuple[str, str]]

ROUNDING_OF_WEIGHT = 1e-9
"""Share of a capacity that a load may weigh more, which is rounding."""


def broken_rules_between_fields(problem: Problem) -> Rules:
    """Yield every rule between fields of a problem that it breaks."""
    yield from _exclusions(problem)
    yield from _materials(problem)
    yield from _ids(problem)
    yield from _promises(problem)
    yield from _start_plan(problem)
    yield from broken_rules_of_matrices(problem)
    yield from broken_rules_of_zones(problem)


def _exclusions(problem: Problem) -> Rules:
    objective = problem.objective
    if problem.matrices is not None:
        for name in ("no_fly_zones", "wind"):
            if getattr(problem, name):
                yield f"/{name}", said("`{one}` and `{other}` exclude each other", one=name, other="matrices")
    if objective.half_life is not None and objective.unloading == "planned":
        yield "/objective/half_life", said("`half_life` and `unloading`: planned exclude each other")
    if objective.loading == "planned" and objective.unloading != "planned":
        yield "/objective/loading", said("`loading`: planned needs `unloading`: planned")
    if objective.change_weight > 0.0 and problem.start_plan is None:
        detail = said("{weight} needs a `start_plan`, and there is none", weight=objective.change_weight)
        yield "/objective/change_weight", detail


def _materials(problem: Problem) -> Rules:
    materials = len(problem.uavs[0].loadlist) if problem.uavs else 0
    if problem.materials and len(problem.materials) != materials:
        yield (
            "/materials",
            said(
                "{count} materials, but the first UAV carries {materials}",
                count=len(problem.materials),
                materials=materials,
            ),
        )
        return
    if not any(uav.capacity is not None for uav in problem.uavs):
        return
    weights = problem.weights
    for i, uav in enumerate(problem.uavs):
        if uav.capacity is None:
            continue
        most = map(max, uav.loadlist, uav.full)
        weight = sum(each * amount for each, amount in zip(weights, most, strict=False))
        if weight > uav.capacity * (1.0 + ROUNDING_OF_WEIGHT):
            figures = {"capacity": uav.capacity, "weight": weight}
            if uav.full == uav.loadlist:
                detail = said("{capacity} is less than the {weight} that its `loadlist` weighs", **figures)
            else:
                detail = said(
                    "{capacity} is less than the {weight} that its `loadlist` and `full_load`, the larger of "
                    "each, weigh",
                    **figures,
                )
            yield f"/uavs/{i}/capacity", detail


def _ids(problem: Problem) -> Rules:
    """Yield ids that no item of the list has that they are of."""
    for name in ("uavs", "targets"):
        items = getattr(problem, name)
        of: type | None = type(items[0]) if items else None
        for each in declared_fields(of) if of else ():
            if not isinstance(each.kind, Words) or each.kind.ids_of is None:
                continue
            ids_of_items = list(map(attrgetter(each.name), items))
            if not any(ids_of_items):
                continue
            known = {item.id for item in getattr(problem, each.kind.ids_of)}
            for index, ids in enumerate(ids_of_items):
                for place, identifier in enumerate(ids or ()):
                    if identifier not in known:
                        detail = said(
                            "{id!r} is no id of the {items}", id=identifier, items=noun(each.kind.ids_of)
                        )
                        yield f"/{name}/{index}/{each.name}/{place}", detail


def _promises(problem: Problem) -> Rules:
    for i, uav in enumerate(problem.uavs):
        if not uav.committed:
            continue
        excluded = set(uav.excluded)
        first: dict[str, int] = {}
        for place, identifier in enumerate(uav.committed):
            at = f"/uavs/{i}/committed/{place}"
            if identifier in first:
                yield at, said("{id!r} is already number {other}", id=identifier, other=first[identifier])
            first.setdefault(identifier, place)
            if identifier in excluded:
                yield at, said("{id!r} is in `excluded` too", id=identifier)


def _start_plan(problem: Problem) -> Rules:
    """Yield where the plan has not the shape of one; what it may do the simulator says."""
    plan, m = problem.start_plan, len(problem.uavs)
    last = len(problem.targets) + len(problem.bases)
    if plan is None:
        return
    if not 1 <= len(plan) <= problem.max_steps:
        yield (
            "/start_plan",
            said(
                "{count} steps, not in 1..{most}, which is `max_steps`",
                count=len(plan),
                most=problem.max_steps,
            ),
        )
    for step, row in enumerate(plan):
        if len(row) != m:
            yield (
                f"/start_plan/{step}",
                said("{count} actions, but there are {uavs} UAVs", count=len(row), uavs=m),
            )
            continue
        for i, action in enumerate(row):
            if not 0 <= action <= last:
                yield (
                    f"/start_plan/{step}/{i}",
                    said("{value} is not in {low}..{high}", value=action, low=0, high=last),
                )
