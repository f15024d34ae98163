"""What UAVs can take aboard at bases."""

from __future__ import annotations

import math

from app.domain.problem import UAV, Problem


def most_loaded(problem: Problem) -> list[tuple[float, ...]]:
    """Return the amounts that each UAV leaves a base with at most, M times K.

    Where loading is planned, material by material what its capacity allows, and no more than all areas need.
    """
    if not problem.plans_loading:
        return [uav.full for uav in problem.uavs]
    needed = [
        math.fsum(amounts) for amounts in zip(*(target.need for target in problem.targets), strict=True)
    ]
    return [
        tuple(
            whole if uav.capacity is None or weight == 0.0 else min(whole, uav.capacity / weight)
            for whole, weight in zip(needed, problem.weights, strict=True)
        )
        for uav in problem.uavs
    ]


def loads_later(problem: Problem, uav: UAV, most: tuple[float, ...]) -> tuple[float, ...]:
    """Return the amounts that a UAV can take aboard at some base, of the most that it leaves one with."""
    bases = [base for base in problem.bases if uav.bases is None or base.id in uav.bases]
    return tuple(
        amount if any(base.stock is None or base.stock[k] > 0.0 for base in bases) else 0.0
        for k, amount in enumerate(most)
    )
