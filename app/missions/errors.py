"""Every error that the missions room raises on purpose.

AllocatorError
 ├─ EventRefused            an event is about something unknown, from the past, or impossible
 ├─ MissionNotFound         no mission has that id
 ├─ EventReused             an event's id came with another event before
 ├─ ProposalClosed          a proposal was accepted, refused or outdated before
 └─ MissionBusy             what works out missions does not answer, or others change the mission all the time

Each is an :class:`~app.domain.errors.AllocatorError`, so it can come from a worker, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from app.domain.errors import AllocatorError, Violation
from app.domain.said import from_record, noun, said


class EventRefused(AllocatorError):
    """An event is about something unknown, from the past, or impossible; ``violations`` says where."""

    code = "event-refused"

    @classmethod
    def of(cls, violations: Sequence[Violation]) -> EventRefused:
        """Make the error out of at least one violation; pointers are into the event."""
        first = violations[0]
        more = f" (and {len(violations) - 1} more)" if len(violations) > 1 else ""
        return cls(f"{first.pointer or 'the event'}: {first.detail}{more}", violations)

    @classmethod
    def at(cls, pointer: str, detail: str) -> EventRefused:
        """Make the error of one field."""
        return cls.of([Violation(pointer, detail)])


class MissionNotFound(AllocatorError):
    """No mission has that id."""

    code = "mission-not-found"

    def __init__(self, mission_id: str) -> None:
        super().__init__(said("there is no mission {id!r}", id=mission_id))


class EventReused(AllocatorError):
    """An event's id came with another event before."""

    code = "event-id-reused"

    def __init__(self, event_id: str, number: int) -> None:
        super().__init__(
            said(
                "event id {id!r} came with another event before, which is number {number}",
                id=event_id,
                number=number,
            ),
            [
                Violation(
                    "/id",
                    said(
                        "{id!r} is the id of event {number}, which is another one", id=event_id, number=number
                    ),
                )
            ],
        )


class ProposalClosed(AllocatorError):
    """A proposal was accepted, refused or outdated before, or what has happened since does not fit it."""

    code = "proposal-closed"

    @classmethod
    def already(cls, number: int, status: str) -> ProposalClosed:
        """Make the error of a proposal that was accepted, refused or outdated before."""
        words = {"accepted": noun("accepted"), "refused": noun("refused"), "outdated": noun("outdated")}
        return cls(said("proposal {number} is {status}", number=number, status=words[status]))


class MissionBusy(AllocatorError):
    """What works out missions does not answer now, or others change the mission all the time."""

    code = "mission-busy"


KINDS: Mapping[str, type[AllocatorError]] = {kind.code: kind for kind in (EventRefused, ProposalClosed)}
"""Errors that a worker raises, by their codes."""


def raised_elsewhere(error: Mapping[str, Any]) -> AllocatorError:
    """Return the exception of an error object of :func:`app.jobs.errors.describe` that a worker has sent."""
    kind = KINDS.get(error["code"])
    violations = [Violation(each["pointer"], from_record(each)) for each in error["violations"]]
    if kind is not None:
        return kind(from_record(error), violations, error["details"])
    other = AllocatorError(from_record(error), violations, error["details"])
    other.code = error["code"]  # type: ignore[misc]  # of this one object
    return other
