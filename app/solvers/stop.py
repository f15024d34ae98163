"""Stop criteria: none, a time limit, a cancellation, and any of several."""

from __future__ import annotations

import time
from collections.abc import Callable

from app.solvers.protocol import StopCriterion


def never() -> bool:
    """Never stop early."""
    return False


class TimeLimit:
    """Stops once a number of seconds has passed since it was built."""

    def __init__(self, seconds: float) -> None:
        self._end = time.monotonic() + seconds

    def __call__(self) -> bool:
        """Return True when the time is up."""
        return time.monotonic() >= self._end


class AnyOf:
    """Stops when the first of several criteria does."""

    def __init__(self, *criteria: StopCriterion | Callable[[], bool]) -> None:
        self._criteria = criteria

    def __call__(self) -> bool:
        """Return True when one of the criteria is true."""
        return any(criterion() for criterion in self._criteria)
