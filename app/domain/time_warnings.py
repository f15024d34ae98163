"""Times, promises and wishes that were probably not meant: what nobody can keep, whatever the plan."""

from __future__ import annotations

from collections.abc import Iterator

from app.domain.problem import Problem

Found = tuple[str, list[tuple[str, str]]]
"""A code, and the pointers and details of each place where it is."""


def odd_times(problem: Problem) -> Iterator[Found]:
    """Yield the places at which times or promises contradict each other."""
    yield (
        "deadline_passed",
        [
            (
                f"/targets/{j}/deadline",
                f"the deadline of {target.id!r} was {-target.deadline:g} time units ago",
            )
            for j, target in enumerate(problem.targets)
            if target.deadline is not None and target.deadline < 0.0 and any(target.need)
        ],
    )
    yield (
        "earliest_after_deadline",
        [
            (
                f"/targets/{j}/earliest",
                f"a visit of {target.id!r} begins at {target.earliest:g} at the earliest, and its deadline, "
                f"{target.deadline:g}, is for an arrival: a UAV that comes in time waits",
            )
            for j, target in enumerate(problem.targets)
            if target.deadline is not None and target.earliest > max(0.0, target.deadline)
        ],
    )
    yield (
        "never_available",
        [
            (
                f"/uavs/{i}/available_until",
                f"{uav.id!r} has to have landed at {uav.available_until:g}, before it may take off, at "
                f"{uav.available_from:g}",
            )
            for i, uav in enumerate(problem.uavs)
            if uav.available_until is not None and uav.available_until < uav.available_from
        ],
    )
    yield (
        "committed_beyond_steps",
        [
            (
                f"/uavs/{i}/committed",
                f"{len(uav.committed)} visits are promised of {uav.id!r}, in {problem.max_steps} steps",
            )
            for i, uav in enumerate(problem.uavs)
            if len(uav.committed) > problem.max_steps
        ],
    )
    yield (
        "no_capacity",
        [
            (
                f"/uavs/{i}",
                f"loading is planned, and {uav.id!r} has no `capacity`: it can take whatever is in stock",
            )
            for i, uav in enumerate(problem.uavs)
            if problem.plans_loading and uav.capacity is None and not uav.ret
        ],
    )
