"""When to stop early: never, or at a deadline; and how long any criterion leaves."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import cast

from app.solvers.protocol import StopCriterion


def never() -> bool:
    """Never stop early."""
    return False


class Deadline:
    """Stops when time is up, and says how much is left: a search cools down by it.

    Parameters
    ----------
    seconds
        From now on.
    clock
        Tells the time in seconds.
    """

    def __init__(self, seconds: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._end = clock() + seconds

    def __call__(self) -> bool:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        return self._clock() >= self._end

    def seconds_left(self) -> float:
        """Return the seconds that are left; zero or less when time is up."""
        return self._end - self._clock()


def seconds_left(stop: StopCriterion) -> float | None:
    """Return how many seconds a stop criterion leaves; None where it has no time limit or does not say.

    A criterion says so by a method ``seconds_left`` beside being callable; solvers that plan ahead ask for
    it, the others need not know.
    """
    ask = getattr(stop, "seconds_left", None)
    left = None if ask is None else cast(Callable[[], float | None], ask)()
    return None if left is None or math.isinf(left) else left
