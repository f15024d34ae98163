"""What is kept of a mission as plain values: the mission, its history, its proposals, what is to be kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from enum import StrEnum
from typing import Any, Literal

Plans = Literal["automatic", "proposed"]
"""Whether new plans take effect by themselves, or when a proposal is accepted."""


@dataclass(frozen=True, slots=True)
class Planning:
    """How a mission is planned.

    Attributes
    ----------
    algorithm, parameters, seed
        As of an allocation.
    time_limit_s
        How long each search takes at most, from when a worker begins with it.
    plans
        Whether new plans take effect by themselves.
    """

    algorithm: str
    parameters: Mapping[str, Any]
    seed: int
    time_limit_s: float
    plans: Plans

    def to_record(self) -> dict[str, Any]:
        """Return the fields as a JSON object."""
        return {each.name: getattr(self, each.name) for each in fields(self)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """A mission without its problem and state.

    Attributes
    ----------
    id
        32 lower-case hexadecimal digits.
    name
        For people; None without.
    clock
        Of the newest event that made a state.
    last_number, state_number
        Of the newest event, and of the newest one that made a state.
    wanted, planned
        The newest event after which another plan may be better, and that up to which plans were looked for.
    has_open
        Whether a proposal is open.
    planning
        How it is planned.
    trouble
        The error object of the newest search, where that failed.
    created_at
        UTC.
    """

    id: str
    name: str | None
    clock: float
    last_number: int
    state_number: int
    wanted: int
    planned: int
    has_open: bool
    planning: Planning
    trouble: Mapping[str, Any] | None
    created_at: datetime

    @property
    def wants_plan(self) -> bool:
        """Whether a plan is to be looked for, or is being."""
        return self.wanted > self.planned

    @property
    def is_searching(self) -> bool:
        """Whether another plan may soon be proposed, or take effect by itself."""
        return self.wants_plan or (self.has_open and self.planning.plans == "automatic")


@dataclass(frozen=True, slots=True)
class Head:
    """A mission as it stands.

    Attributes
    ----------
    mission
        The mission.
    state, plan
        Records of the newest state, and of the plan in force with its times.
    matrices
        Of its problem; None without.
    positions
        The newest position of each UAV by its id, with the ``number`` of the event that it came with.
    """

    mission: Mission
    state: Mapping[str, Any]
    plan: Mapping[str, Any]
    matrices: Any
    positions: Mapping[str, Mapping[str, Any]]

    @property
    def new_positions(self) -> dict[str, dict[str, Any]]:
        """Positions that the state does not know yet."""
        return {
            uav_id: {name: value for name, value in each.items() if name != "number"}
            for uav_id, each in self.positions.items()
            if each["number"] > self.mission.state_number
        }


@dataclass(frozen=True, slots=True)
class Entry:
    """One event of a mission's history.

    Attributes
    ----------
    number
        From 1, without gaps, in the order in which they took effect.
    id
        Of the client; None for what the service has written itself.
    type, at, body
        What happened, and when by the mission's clock.
    outcome
        ``effect``, what it did to the plan in force, or ``passed_over``, how many positions were too old.
    recorded_at
        UTC.
    """

    number: int
    id: str | None
    type: str
    at: float
    body: Mapping[str, Any]
    outcome: Mapping[str, Any]
    recorded_at: datetime

    def to_record(self) -> dict[str, Any]:
        """Return what answers and streams have."""
        return {
            "number": self.number,
            "id": self.id,
            "type": self.type,
            "at": self.at,
            "recorded_at": self.recorded_at.isoformat(),
            "event": dict(self.body),
            "effect": self.outcome.get("effect"),
            "passed_over": self.outcome.get("passed_over"),
        }


class ProposalStatus(StrEnum):
    """What became of a proposal."""

    OPEN = "open"
    ACCEPTED = "accepted"
    REFUSED = "refused"
    OUTDATED = "outdated"


@dataclass(frozen=True, slots=True)
class Proposal:
    """A plan that was found, and how it differs from the one in force.

    Attributes
    ----------
    number
        Of the event that made it.
    status
        What became of it.
    of_number
        The event after which it was looked for.
    job_id
        The job that found it.
    content
        ``assignment``, ``reward``, ``gained``, ``routes`` with times, ``differences``, and ``stops``, the
        stops of each UAV, and ``done``, how many stops were done when it was looked for.
    """

    number: int
    status: ProposalStatus
    of_number: int
    job_id: str
    content: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Sent:
    """An event as it is to be kept.

    Attributes
    ----------
    id, digest
        Of the client, and of all that must not differ where the id comes again; None for the service's own.
    type, at, body
        What happened, and when by the mission's clock.
    """

    id: str | None
    digest: str | None
    type: str
    at: float
    body: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Judged:
    """What was worked out of an event.

    Attributes
    ----------
    state, plan
        Records of the state that it makes, and of the plan in force.
    effect
        What it did to that.
    wants_plan
        Whether another plan may be better now.
    closes
        A proposal that it closes, and how; None for none.
    """

    state: Mapping[str, Any]
    plan: Mapping[str, Any]
    effect: Mapping[str, Any]
    wants_plan: bool
    closes: tuple[int, ProposalStatus] | None = None
