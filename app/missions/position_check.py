"""Whether positions are those of a mission's UAVs, without reading its state for every batch of them."""

from __future__ import annotations

from dataclasses import dataclass

from app.domain.errors import Violation
from app.domain.fields import Context
from app.domain.said import noun, said
from app.missions import events
from app.missions.model import Head


@dataclass(frozen=True, slots=True)
class PositionCheck:
    """What positions are checked by, of one state.

    Attributes
    ----------
    state_number
        Of the event that made the state.
    uav_ids
        The UAVs there are.
    crs
        Of the problem.
    rows
        How many rows its matrices have; 0 without.
    """

    state_number: int
    uav_ids: frozenset[str]
    crs: str
    rows: int

    @classmethod
    def of(cls, head: Head) -> PositionCheck:
        """Return that of a mission as it stands."""
        problem = head.state["problem"]
        rows = 0 if head.matrices is None else len(next(iter(head.matrices.values()))["distance"])
        uav_ids = frozenset(uav["id"] for uav in problem["uavs"])
        return cls(head.mission.state_number, uav_ids, problem["crs"], rows)

    def violations(self, event: events.Telemetry) -> list[Violation]:
        """Return which positions are of UAVs that are not known, or such as no problem of this kind has."""
        violations = list(events.broken_rules(event, Context(self.crs, None)))
        for k, each in enumerate(event.positions):
            if each.uav_id not in self.uav_ids:
                detail = said(
                    "{id!r} is no {what} of this mission, which has {count}",
                    id=each.uav_id,
                    what=noun("UAV"),
                    count=len(self.uav_ids),
                )
                violations.append(Violation(f"/positions/{k}/uav_id", detail))
            if each.location is not None and each.location >= self.rows:
                detail = said(
                    "{row} is no row of the matrices, which have {rows}", row=each.location, rows=self.rows
                )
                violations.append(Violation(f"/positions/{k}/location", detail))
        return violations
