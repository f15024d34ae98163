"""The clock of the jobs: seconds since 1970 that pass evenly, whatever is done to the system's clock."""

from __future__ import annotations

import time
from collections.abc import Callable


class Clock:
    """Tells the time by the system's clock as it was when the service was last idle, and what passed since.

    So a job's limit and its duration do not change with the system's clock while it waits or runs, and what
    is stored of one job fits together.

    Parameters
    ----------
    system
        Seconds since 1970; may be set back or forward.
    steady
        Seconds that pass.
    """

    def __init__(
        self, system: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic
    ) -> None:
        self._system, self._steady = system, steady
        self._offset = system() - steady()

    def now(self) -> float:
        """Return the seconds since 1970."""
        return self._offset + self._steady()

    def follow(self) -> None:
        """Take over the system's time; only while no job waits or runs."""
        self._offset = self._system() - self._steady()
