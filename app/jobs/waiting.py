"""The jobs that wait, as far as this service knows of them: how many, and when the time of which is up."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping

from app.jobs.lanes import Lanes
from app.jobs.model import LANES, Job, JobKind, Lane
from app.jobs.overdue import OverdueJobs
from app.jobs.peers import Peers


class Waiting:
    """Keeps count, and tells those who have to know.

    Where other services take jobs in and out too, the count is a guess: at least 1 until nothing was found in
    the queue.

    Parameters
    ----------
    lanes
        Where the count is kept.
    kinds
        The kinds of job by their names.
    overdue
        Told of the jobs that have to be answered when their time is up; None: nobody answers those.
    peers
        The other services.
    wake
        Set when there is something to take.
    """

    def __init__(
        self,
        lanes: Lanes,
        kinds: Mapping[str, JobKind],
        overdue: OverdueJobs | None,
        peers: Peers,
        wake: asyncio.Event,
    ) -> None:
        self._lanes, self._kinds = lanes, kinds
        self._overdue, self._peers = overdue, peers
        self._wake = wake
        # Lanes of which something was heard while their queue was looked at.
        self._heard: set[Lane] = set()

    def more(self, job: Job, deadline: float | None) -> None:
        """Take note of one more job, and tell the others who could take it."""
        self._lanes.waiting[job.lane] += 1
        if self._overdue is not None and deadline is not None and self._answered_at_once(job.kind):
            self._overdue.watch(job.id, deadline, self._kinds[job.kind].effort(job.payload))
        self._peers.tell_waiting(job.lane)
        self._wake.set()

    def less(self, job: Job) -> None:
        """Take note that a job waits no more."""
        least = int(self._peers.others_may_wait)
        self._lanes.waiting[job.lane] = max(least, self._lanes.waiting[job.lane] - 1)
        self.forget(job.id)
        self._wake.set()

    def forget(self, job_id: str) -> None:
        """Take note that a job, which this service may not know, waits no more."""
        if self._overdue is not None:
            self._overdue.forget(job_id)

    def heard(self, lane: Lane) -> None:
        """Take note that another service told of a job."""
        self._heard.add(lane)
        self._lanes.waiting[lane] = max(1, self._lanes.waiting[lane])
        self._wake.set()

    def looks(self, lane: Lane) -> None:
        """Take note that the oldest job of a lane is being looked for."""
        self._heard.discard(lane)

    def found_none(self, lane: Lane) -> None:
        """Take note that there was none; of one that was told of meanwhile that may not be true."""
        self._lanes.waiting[lane] = int(lane in self._heard)

    def count_anew(self, counts: Mapping[Lane, int]) -> None:
        """Take over how many jobs wait in the table."""
        self._lanes.waiting = {lane: counts.get(lane, 0) for lane in LANES}
        self._wake.set()

    def watch_anew(self, deadlines: Iterable[tuple[str, str, float]]) -> None:
        """Take over id, kind and deadline of the jobs that wait in the table and have one."""
        if self._overdue is not None:
            self._overdue.watch_only(
                {job_id: deadline for job_id, kind, deadline in deadlines if self._answered_at_once(kind)}
            )

    def _answered_at_once(self, kind: str) -> bool:
        known = self._kinds.get(kind)
        return known is not None and known.at_once is not None
