"""Which jobs may start: lanes share the workers, so that nobody waits behind work that can wait."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from statistics import fmean

from app.jobs.model import LANES, Lane

REMEMBERED_DURATIONS = 50
_UNMEASURED_DURATION_S = 1.0


class Capacity:
    """Counts the workers in use, lane by lane.

    Trainings hold at most all workers but one, and so do the jobs of batches; where there is only one, they
    share it. Interactive jobs come first in both cases, then those of batches.

    Parameters
    ----------
    workers
        How many there are.

    Attributes
    ----------
    running
        Jobs by lane; a job that a worker is reserved for is among them.
    """

    def __init__(self, workers: int) -> None:
        self._all = workers
        self._most: dict[Lane, int] = dict.fromkeys(LANES, max(1, workers - 1)) | {"interactive": workers}
        self.running: dict[Lane, int] = dict.fromkeys(LANES, 0)
        self._durations = {lane: deque[float](maxlen=REMEMBERED_DURATIONS) for lane in LANES}

    def may_start(self, ready: int) -> tuple[Lane, ...]:
        """Return the lanes of which a job may start, in their order, when ``ready`` workers are warm."""
        if sum(self.running.values()) >= ready:
            return ()
        return tuple(lane for lane in LANES if self.running[lane] < self._most[lane])

    def ran(self, lane: Lane, durations_s: Iterable[float]) -> None:
        """Note how long jobs of the lane took."""
        self._durations[lane].extend(durations_s)

    def time_to_a_place(self, lane: Lane, running: Iterable[tuple[Lane, float, float | None]]) -> float:
        """Return the seconds until one job of a lane in which others wait will have been started, at least 1.

        Parameters
        ----------
        lane
            The lane.
        running
            Of the jobs that run, their lane, for how long they have, and how long their time limit leaves
            them if they have one.

        Returns
        -------
        float
            What is left of the one that ends first among those for which the lane waits. Where a worker is
            free, or soon will be, the mean of the lane's last durations over the workers that it can have.
        """
        busy = tuple(running)
        own = [each for each in busy if each[0] == lane]
        if len(own) >= self._most[lane]:
            seconds = min(self._rest(*each) for each in own)
        elif len(busy) >= self._all:
            seconds = min(self._rest(*each) for each in busy)
        else:
            seconds = self._mean(lane) / self._most[lane]
        return max(1.0, seconds)

    def _rest(self, lane: Lane, ran_s: float, left_s: float | None) -> float:
        """Return how long a job that runs is expected to go on."""
        mean = self._mean(lane)
        # One that has run longer than others did is expected to go on for as long again.
        rest = mean - ran_s if ran_s < mean else ran_s
        return rest if left_s is None else min(rest, max(0.0, left_s))

    def _mean(self, lane: Lane) -> float:
        return fmean(self._durations[lane]) if self._durations[lane] else _UNMEASURED_DURATION_S
