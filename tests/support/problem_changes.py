"""A small problem, changes of it, and what is said of those that break a rule."""

from dataclasses import replace

import pytest

from app.domain.errors import InvalidProblem
from app.domain.problem import UAV, Problem, Target
from app.domain.surroundings import NoFlyZone

BASE = Problem(
    uavs=(
        UAV("a", 0, 0, 0, 0, speed=1.0, voyage=5.0, loadlist=(1.0, 2.0)),
        UAV("b", 3, 0, 3, 0, speed=1.0, voyage=5.0, loadlist=(1.0, 2.0)),
    ),
    targets=(
        Target("x", 0, 4, level=1.0, loadlist=(1.0, 0.0)),
        Target("y", 1, 4, level=1.0, loadlist=(1.0, 0.0)),
    ),
    max_steps=2,
)

SQUARE = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))


def with_zone(*polygon):
    """The changes by which the problem has two zones, of which the second has these corners."""
    return {"no_fly_zones": (NoFlyZone("z", SQUARE), NoFlyZone("w", polygon))}


def violations(**change):
    """What is said of the problem with changes that it cannot have."""
    with pytest.raises(InvalidProblem) as caught:
        replace(BASE, **change)
    return [(each.pointer, each.detail) for each in caught.value.violations]
