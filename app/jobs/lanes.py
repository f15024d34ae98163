"""Who may start: two lanes share the workers so that what somebody waits for is not behind trainings."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from statistics import fmean

from app.jobs.model import LANES, Lane

REMEMBERED_DURATIONS = 50
_UNMEASURED_DURATION_S = 1.0


class Lanes:
    """Counts the workers in use and the jobs that wait, lane by lane.

    Trainings hold at most all workers but one; where there is only one, they share it. Interactive jobs
    come first in both cases.

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
        self._workers: dict[Lane, int] = {"interactive": capacity, "training": max(1, capacity - 1)}
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

    def time_to_work_off(self, lane: Lane, waiting: int) -> float:
        """Return the seconds in which ``waiting`` jobs of the lane will have been started, at least 1.

        The mean of the last durations, times the jobs, over the workers that the lane can have.
        """
        durations = tuple(self._durations[lane])
        mean = fmean(durations) if durations else _UNMEASURED_DURATION_S
        return max(1.0, mean * waiting / self._workers[lane])
