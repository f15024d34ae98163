"""Who may start: lanes share the workers so that what somebody waits for is not behind the rest."""

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
    come first in both cases, then those of batches, which may hold all workers.

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
        self._workers: dict[Lane, int] = dict.fromkeys(LANES, capacity)
        self._workers["training"] = max(1, capacity - 1)
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

    def time_to_work_off(
        self, lane: Lane, waiting: int, running: Iterable[tuple[float, float | None]]
    ) -> float:
        """Return the seconds in which ``waiting`` jobs of the lane will have been started, at least 1.

        Parameters
        ----------
        lane
            The lane.
        waiting
            How many jobs wait.
        running
            Of the jobs of the lane that run, for how long they have, and how long their time limit leaves
            them if they have one. Who has run longer than others did is expected to go on for as long again.

        Returns
        -------
        float
            What is left of the one that ends first where no worker is free, and the mean of the last
            durations and of what runs longer, times the jobs, over the workers that the lane can have.
        """
        now = tuple(running)
        ended = tuple(self._durations[lane])
        mean = fmean(ended) if ended else _UNMEASURED_DURATION_S
        rests = []
        for ran_s, left_s in now:
            rest = mean - ran_s if ran_s < mean else ran_s
            rests.append(rest if left_s is None else min(rest, max(0.0, left_s)))
        longer = [ran_s + rest for (ran_s, _), rest in zip(now, rests, strict=True) if ran_s > mean]
        mean = max(mean, fmean([*ended, *longer])) if longer else mean
        workers = self._workers[lane]
        first = min(rests) if len(rests) >= workers else 0.0
        return max(1.0, first + mean * waiting / workers)
