"""The state of a mission: the problem that remains at its clock, with the plan in force, and what was done.

A state is the same for the same problem and events. Its problem is one that ``POST /allocate`` takes: who is
where with what, what is still needed, what is under way as ``committed``, and the plan in force as
``start_plan``. All times are by the mission's clock.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from app.domain.problem import Problem
from app.domain.records import problem_from_record, problem_to_record


@dataclass(frozen=True, slots=True)
class Stop:
    """A stop of a route: an area that is visited, or a base where a UAV reloads.

    Attributes
    ----------
    id
        Of the area, or of the base.
    is_base
        Which of the two.
    """

    id: str
    is_base: bool = False

    def to_record(self) -> dict[str, str]:
        """Return what answers have."""
        return {"base_id" if self.is_base else "target_id": self.id}

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Stop:
        """Return the stop that a record of :meth:`to_record` is of; others of its fields are passed over."""
        is_base = "base_id" in record
        return cls(record["base_id" if is_base else "target_id"], is_base)


Routes = tuple[tuple[Stop, ...], ...]
"""The stops of each UAV, in the order of the problem's UAVs; with none it flies home, or stays there."""


@dataclass(frozen=True, slots=True)
class Done:
    """A stop that is over.

    Attributes
    ----------
    uav_id, stop
        Who stopped where.
    time
        When: as reported, or when it was planned to begin.
    amounts
        What was unloaded, or taken up, one a material.
    reported
        Whether an event has said so; otherwise it is what was planned.
    """

    uav_id: str
    stop: Stop
    time: float
    amounts: tuple[float, ...]
    reported: bool = False


@dataclass(frozen=True, slots=True)
class MissionState:
    """A mission after an event.

    Attributes
    ----------
    clock
        Of the newest event.
    problem
        What remains; its ``start_plan`` is the plan in force.
    done
        What was done, in the order in which it became known.
    lost, cancelled
        Ids of UAVs that are lost, and of areas that were cancelled; the problem still has them, without use.
    """

    clock: float
    problem: Problem
    done: tuple[Done, ...] = ()
    lost: tuple[str, ...] = ()
    cancelled: tuple[str, ...] = ()

    @property
    def routes(self) -> Routes:
        """The plan in force."""
        return routes_of(self.problem)

    def to_record(self) -> dict[str, Any]:
        """Return the state as JSON can hold it, without matrices, which no event changes."""
        problem = problem_to_record(self.problem)
        problem.pop("matrices", None)
        return {
            "clock": self.clock,
            "problem": problem,
            "done": [_done_to_record(each) for each in self.done],
            "lost": list(self.lost),
            "cancelled": list(self.cancelled),
        }

    @classmethod
    def from_record(cls, record: Mapping[str, Any], matrices: Any = None) -> MissionState:
        """Return the state of a record.

        Parameters
        ----------
        record
            Of :meth:`to_record`.
        matrices
            Those of the mission's problem, as its record has them; None without.
        """
        problem = record["problem"] if matrices is None else {**record["problem"], "matrices": matrices}
        return cls(
            record["clock"],
            problem_from_record(problem),
            tuple(_done_from_record(each) for each in record["done"]),
            tuple(record["lost"]),
            tuple(record["cancelled"]),
        )


def _done_to_record(done: Done) -> dict[str, Any]:
    return {
        "uav_id": done.uav_id,
        **done.stop.to_record(),
        "time": done.time,
        "amounts": list(done.amounts),
        "reported": done.reported,
    }


def _done_from_record(record: Mapping[str, Any]) -> Done:
    return Done(
        record["uav_id"],
        Stop.from_record(record),
        record["time"],
        tuple(record["amounts"]),
        record["reported"],
    )


def routes_of(problem: Problem, rows: Sequence[Sequence[int]] | None = None) -> Routes:
    """Return the routes of a plan; of ``start_plan`` where none is given."""
    rows = (problem.start_plan or ()) if rows is None else rows
    n = problem.n_targets
    return tuple(
        tuple(
            Stop(problem.targets[row[i]].id) if row[i] < n else Stop(problem.bases[row[i] - n - 1].id, True)
            for row in rows
            if row[i] != n
        )
        for i in range(problem.n_uavs)
    )


def with_routes(problem: Problem, routes: Sequence[Sequence[Stop]]) -> Problem:
    """Return a problem whose ``start_plan`` is a plan that is given as routes."""
    n = problem.n_targets
    places = {Stop(target.id): j for j, target in enumerate(problem.targets)}
    places |= {Stop(base.id, True): n + 1 + d for d, base in enumerate(problem.bases)}
    steps = max(1, *map(len, routes))
    rows = tuple(tuple(places[route[s]] if s < len(route) else n for route in routes) for s in range(steps))
    return replace(problem, start_plan=rows)


def without_plan(problem: Problem, **changes: Any) -> Problem:
    """Return a problem with other fields, and the plan that sends everybody home.

    Raises
    ------
    InvalidProblem
        If it then breaks a rule.
    """
    uavs, targets = changes.get("uavs", problem.uavs), changes.get("targets", problem.targets)
    return replace(problem, **changes, start_plan=((len(targets),) * len(uavs),))
