"""Whether other services work on the same job table, and what a dispatcher then has to do with them.

On SQLite a service has :class:`NoPeers`; on a shared database it has those of
:class:`app.jobs.shared.Shared`.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Protocol

from app.jobs.model import Lane
from app.jobs.run import Run


@dataclass(frozen=True, slots=True)
class Reactions:
    """What the dispatcher does when something is heard.

    Attributes
    ----------
    look_for_work
        A job waits in a lane.
    forget
        A job has ended elsewhere, by its id.
    stop
        A job that runs here should stop.
    give_back
        The table has a job, in this attempt, as one that runs here, but it does not.
    look_after
        It is time to look for jobs that nobody runs.
    """

    look_for_work: Callable[[Lane], None]
    forget: Callable[[str], None]
    stop: Callable[[Run], None]
    give_back: Callable[[str, int], Awaitable[None]]
    look_after: Callable[[], Awaitable[None]]


class Peers(Protocol):
    """The other services, as the dispatcher deals with them; called on the event loop where not said."""

    others_may_wait: bool
    """Whether there may be waiting jobs that this service has not heard of."""

    async def join(self, reactions: Reactions) -> None:
        """Begin, before the first job is taken, and react from then on to what is heard."""

    async def leave(self) -> None:
        """End, after the last job was settled or put back."""

    def is_alive(self, owner: str) -> bool:
        """Say whether an owner can still finish its jobs. Blocks; called in the thread that writes."""

    def tell_waiting(self, lane: Lane) -> None:
        """Tell that a job waits in a lane."""

    def tell_ended(self, job_id: str) -> None:
        """Tell that a job has ended."""

    def tell_cancelled(self, job_id: str) -> None:
        """Tell that a job, which runs elsewhere, should stop."""


class NoPeers:
    """There are no others: the database belongs to this service as long as it runs.

    Parameters
    ----------
    owner
        This service.
    """

    others_may_wait = False

    def __init__(self, owner: str) -> None:
        self._owner = owner

    async def join(self, reactions: Reactions) -> None:
        """Do nothing: nothing is ever heard."""

    async def leave(self) -> None:
        """Do nothing."""

    def is_alive(self, owner: str) -> bool:
        """Say whether it is this service: every other one has ended, or the database would be occupied."""
        return owner == self._owner

    def tell_waiting(self, lane: Lane) -> None:
        """Tell nobody."""

    def tell_ended(self, job_id: str) -> None:
        """Tell nobody."""

    def tell_cancelled(self, job_id: str) -> None:
        """Tell nobody."""
