"""Who may start: lanes share the workers so that what somebody waits for is not behind the rest."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from statistics import fmean

from app.jobs.model import LANES, Lane

REMEMBERED_DURATIONS = 50
_UNMEASURED_DURATION_S = 1.0


@dataclass(frozen=True, slots=True)
class QueueLimit:
    """How many jobs of a lane may wait, and what to tell a caller for whom there is no place."""

    places: int
    retry_after_s: float


class Lanes:
    """Counts the workers in use and the jobs that wait, lane by lane.

    Trainings hold at most all workers but one, and so do the jobs of batches; where there is only one, they
    share it. Interactive jobs come first in both cases, then those of batches.

    Parameters
    ----------
    capacity
        How many workers there are.

    Attributes
    ----------
    running, waiting
        Jobs by lane; what runs includes what a worker is reserved for.
    """

    def __init__(self, capacity: int) -> None:
        self._workers: dict[Lane, int] = dict.fromkeys(LANES, max(1, capacity - 1))
        self._workers["interactive"] = self._capacity = capacity
        self.running: dict[Lane, int] = dict.fromkeys(LANES, 0)
        self.waiting: dict[Lane, int] = dict.fromkeys(LANES, 0)
        self._durations: dict[Lane, deque[float]] = {
            lane: deque(maxlen=REMEMBERED_DURATIONS) for lane in LANES
        }

    def may_start(self, lane: Lane, ready: int) -> bool:
        """Say whether a worker is free for a job of the lane, when ``ready`` workers are warm."""
        return sum(self.running.values()) < ready and self.running[lane] < self._workers[lane]

    def is_first(self, lane: Lane) -> bool:
        """Say whether a new job of the lane would go before no other if it started now."""
        return self.waiting["interactive"] == 0 and self.waiting[lane] == 0

    def next_lane(self, ready: int) -> Lane | None:
        """Return the lane whose oldest job starts next; None if nothing waits or no worker is free for it."""
        for lane in LANES:
            if self.waiting[lane] > 0 and self.may_start(lane, ready):
                return lane
        return None

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
        all_of_them = tuple(running)
        own = [each for each in all_of_them if each[0] == lane]
        workers = self._workers[lane]
        if len(own) >= workers:
            seconds = min(self._rest(*each) for each in own)
        elif len(all_of_them) >= self._capacity:
            seconds = min(self._rest(*each) for each in all_of_them)
        else:
            seconds = self._mean(lane) / workers
        return max(1.0, seconds)

    def _rest(self, lane: Lane, ran_s: float, left_s: float | None) -> float:
        """Return how long a job that runs is expected to go on."""
        mean = self._mean(lane)
        # One that has run longer than others did is expected to go on for as long again.
        rest = mean - ran_s if ran_s < mean else ran_s
        return rest if left_s is None else min(rest, max(0.0, left_s))

    def _mean(self, lane: Lane) -> float:
        return fmean(self._durations[lane]) if self._durations[lane] else _UNMEASURED_DURATION_S
