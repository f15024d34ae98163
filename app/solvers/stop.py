"""When to stop early. Every criterion also says how long it leaves, so that no wrapper can lose that."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Protocol

from app.solvers.protocol import SolverContext, StopCriterion


class Never:
    """Never stops early."""

    def __call__(self) -> bool:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        return False

    def seconds_left(self) -> float:
        """Return infinity: there is no time limit."""
        return math.inf


never = Never()


class Deadline:
    """Stops when time is up.

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
        """Return the seconds until the deadline; zero or less once it has passed."""
        return self._end - self._clock()


class EarlierOf:
    """Stops as soon as one of several criteria does.

    Parameters
    ----------
    criteria
        At least one.
    """

    def __init__(self, *criteria: StopCriterion) -> None:
        self._criteria = criteria

    def __call__(self) -> bool:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        return any(stop() for stop in self._criteria)

    def seconds_left(self) -> float:
        """Return the least that any of them leaves."""
        return min(stop.seconds_left() for stop in self._criteria)


class Sooner:
    """Stops when another criterion does, or some seconds before that one's time is up.

    Parameters
    ----------
    other
        The other criterion.
    seconds
        How many; they change nothing where the other has no time limit.
    """

    def __init__(self, other: StopCriterion, seconds: float) -> None:
        self._other, self._seconds = other, seconds

    def __call__(self) -> bool:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        return self._other() or self.seconds_left() <= 0.0

    def seconds_left(self) -> float:
        """Return what the other criterion leaves, less these seconds."""
        return self._other.seconds_left() - self._seconds


def share_of_time(other: StopCriterion, share: float) -> StopCriterion:
    """Return a criterion for a first part of the work: it leaves that share of the time that is left now."""
    left = other.seconds_left()
    return other if math.isinf(left) else Sooner(other, (1.0 - share) * max(0.0, left))


class WhileSpare:
    """Stops when another criterion does, or once too few threads are spare.

    Parameters
    ----------
    other
        The other criterion.
    spare_threads
        Returns how many threads are spare at the moment.
    place
        How many there have to be.
    """

    def __init__(self, other: StopCriterion, spare_threads: Callable[[], int], place: int) -> None:
        self._other, self._spare_threads, self._place = other, spare_threads, place

    def __call__(self) -> bool:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        return self._spare_threads() < self._place or self._other()

    def seconds_left(self) -> float:
        """Return what the other criterion leaves."""
        return self._other.seconds_left()


def a_thread_each(stop: StopCriterion, context: SolverContext) -> list[StopCriterion]:
    """Return what ends the search of each thread, first the one that ends all.

    Under a time limit there are more threads where cores are idle; they end when those are needed.
    """
    spare = 0 if math.isinf(stop.seconds_left()) else context.spare_threads()
    of_spare = (WhileSpare(stop, context.spare_threads, place) for place in range(1, spare + 1))
    return [stop] * context.threads + list(of_spare)


class Event(Protocol):
    """What other threads or processes set, as :class:`threading.Event` is."""

    def is_set(self) -> bool:
        """Say whether it is set."""
        ...


class WhenSet:
    """Stops once an event is set; has no time limit.

    Parameters
    ----------
    event
        The event.
    """

    def __init__(self, event: Event) -> None:
        self._event = event

    def __call__(self) -> bool:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        return self._event.is_set()

    def seconds_left(self) -> float:
        """Return infinity: nobody knows when it will be set."""
        return math.inf
