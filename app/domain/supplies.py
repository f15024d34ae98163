"""What UAVs can take aboard at bases."""

from __future__ import annotations

from app.domain.problem import UAV, Problem


def loads_later(problem: Problem, uav: UAV) -> tuple[float, ...]:
    """Return the amounts that a UAV can take aboard at some base, at most what it leaves one with."""
    bases = [base for base in problem.bases if uav.bases is None or base.id in uav.bases]
    return tuple(
        amount if any(base.stock is None or base.stock[k] > 0.0 for base in bases) else 0.0
        for k, amount in enumerate(uav.full)
    )
