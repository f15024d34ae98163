"""What the dispatcher needs of the machinery that runs work: small enough for one machine or many.

All of it is called from the event loop's thread, and calls back there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from app.jobs.model import Progress, WorkResult


@dataclass(frozen=True, slots=True)
class Returned:
    """The work function returned."""

    work: WorkResult


@dataclass(frozen=True, slots=True)
class Raised:
    """The work function raised; the error object of the job, and the traceback for the log."""

    error: dict[str, Any]
    traceback: str


@dataclass(frozen=True, slots=True)
class Lost:
    """The worker died, or was killed, before the work function ended."""

    reason: str


Outcome = Returned | Raised | Lost


class Execution(Protocol):
    """One piece of work on its way."""

    async def outcome(self) -> Outcome:
        """Wait until it has ended. Every progress was delivered before, the last one included."""

    def cancel(self) -> None:
        """Ask the work to stop by itself."""

    def kill(self) -> None:
        """End the worker that does it; the outcome is :class:`Lost` unless the work ended meanwhile."""


class Executor(Protocol):
    """Runs work functions in other processes, at most ``capacity`` at a time."""

    @property
    def capacity(self) -> int:
        """How many pieces of work run at a time when all workers are well."""

    @property
    def ready(self) -> int:
        """How many workers are warm now, whether they work or not."""

    @property
    def restarts(self) -> int:
        """How many workers have been replaced."""

    async def start(self, on_ready: Callable[[], None]) -> None:
        """Begin to start the workers, without waiting for them; ``on_ready`` is called for each."""

    def submit(
        self,
        work: str,
        payload: Mapping[str, Any],
        *,
        time_left_s: float | None,
        on_progress: Callable[[Progress], None],
        labels: Mapping[str, str],
    ) -> Execution:
        """Hand ``"module:function"`` and its payload to a worker; never blocks.

        The lines that the worker logs in its course have the ``labels``, ids by their names.
        ``time_left_s`` may be negative: the work still runs, and sees that its time is up.
        """

    async def close(self) -> None:
        """End all workers, whatever they do."""
