"""Looks for better plans of missions, a job at a time for each: events that come meanwhile make one more."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from app.domain.said import said
from app.jobs.errors import Draining, JobNotFound, QueueFull, failure
from app.jobs.model import Idempotency, Job, JobStatus
from app.jobs.service import JobService
from app.missions.errors import MissionBusy, MissionNotFound
from app.missions.model import Head
from app.missions.store import MissionStore
from app.store_faults import STORE_IS_AWAY

REPLAN = "replan"
"""The kind of job that looks for a plan."""

_PAUSE_S, _LONGEST_PAUSE_S = 0.5, 5.0

_log = logging.getLogger(__name__)


class Planner:
    """Follows the missions that want a plan until they have one.

    Parameters
    ----------
    store
        The tables.
    jobs
        Runs the searches.
    search
        What the payload of a search has besides.
    changed
        Called when a search has ended, with the id of its mission.
    accept
        Lets the open proposal of a mission take effect.
    """

    def __init__(
        self,
        store: MissionStore,
        jobs: JobService,
        search: Mapping[str, Any],
        changed: Callable[[str], None],
        accept: Callable[[str], Awaitable[None]],
    ) -> None:
        self._store, self._jobs, self._search = store, jobs, search
        self._changed, self._accept = changed, accept
        self._following: dict[str, asyncio.Task[None]] = {}
        self._again: set[str] = set()
        # The search of each mission, and the newest event after which another plan may be better.
        self._searches: dict[str, tuple[str, int]] = {}
        self._wanted: dict[str, float] = {}
        self._cancels: set[asyncio.Task[None]] = set()
        self._stopped = False

    def follow(self, mission_id: str, wanted: float = 0) -> None:
        """Look for a plan of a mission, if it wants one; if that is being done, once more after that.

        Parameters
        ----------
        mission_id
            The mission.
        wanted
            Number of an event after which another plan may be better: a search for one of before is stopped,
            as its plan would not be proposed.
        """
        if mission_id in self._following:
            self._again.add(mission_id)
            self._wanted[mission_id] = max(wanted, self._wanted.get(mission_id, 0))
            self._stop_outdated(mission_id)
        elif not self._stopped:
            self._following[mission_id] = asyncio.create_task(self._follow(mission_id))

    def drop(self, mission_id: str) -> None:
        """Stop looking for plans of a mission that is no more."""
        if mission_id in self._following:
            self._wanted[mission_id] = math.inf
            self._stop_outdated(mission_id)

    def _stop_outdated(self, mission_id: str) -> None:
        job_id, number = self._searches.get(mission_id, ("", math.inf))
        if number < self._wanted.get(mission_id, 0):
            cancel = asyncio.create_task(self._cancel(job_id))
            self._cancels.add(cancel)
            cancel.add_done_callback(self._cancels.discard)

    async def _cancel(self, job_id: str) -> None:
        try:
            await self._jobs.cancel(job_id)
        except (Draining, JobNotFound):
            return
        except Exception:
            # It ends at its time limit.
            _log.exception("an outdated search could not be stopped", extra={"job_id": job_id})

    async def stop(self) -> None:
        """Look for nothing any more; what is wanted is known to the tables."""
        self._stopped = True
        tasks = [*self._following.values(), *self._cancels]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _follow(self, mission_id: str) -> None:
        pause_s = _PAUSE_S
        try:
            while not self._stopped:
                self._again.discard(mission_id)
                try:
                    done = await self._step(mission_id)
                except (QueueFull, MissionBusy, *STORE_IS_AWAY) as error:
                    # The plan in force stays; there will be another try.
                    _log.info("no plan could be looked for: %s", error, extra={"mission_id": mission_id})
                    wait_s = getattr(error, "retry_after_s", pause_s)
                    await asyncio.sleep(min(wait_s, _LONGEST_PAUSE_S))
                    pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)
                    continue
                if done and mission_id not in self._again:
                    return
        except (Draining, MissionNotFound):
            return
        except Exception:
            _log.exception("the search for a mission's plans has ended", extra={"mission_id": mission_id})
        finally:
            del self._following[mission_id]
            self._wanted.pop(mission_id, None)
            if mission_id in self._again:
                self._again.discard(mission_id)
                self.follow(mission_id)

    async def _step(self, mission_id: str) -> bool:
        """Look for one plan; return whether there is nothing left to do."""
        head = await asyncio.to_thread(self._store.head, mission_id)
        mission = head.mission
        automatic = mission.planning.plans == "automatic"
        if not mission.wants_plan:
            if automatic:
                await self._accept(mission_id)
                head = await asyncio.to_thread(self._store.head, mission_id)
            return not head.mission.wants_plan
        once = Idempotency("missions", f"{mission_id}/{mission.state_number}", "")
        job, _ = await self._jobs.submit(REPLAN, self._payload(head), idempotency=once)
        number = mission.state_number
        self._searches[mission_id] = job.id, number
        try:
            self._stop_outdated(mission_id)
            job = await self._jobs.wait(job.id, None)
        finally:
            del self._searches[mission_id]
        if not job.status.finished:
            raise Draining
        if job.status is not JobStatus.SUCCEEDED:
            stopped = job.status is JobStatus.CANCELLED and number < self._wanted.get(mission_id, 0)
            trouble = None if stopped else _trouble_of(job)
            await asyncio.to_thread(self._store.planned_in_vain, mission_id, number, trouble)
        self._changed(mission_id)
        return False

    def _payload(self, head: Head) -> dict[str, Any]:
        planning, problem = head.mission.planning, head.state["problem"]
        return {
            "problem": problem if head.matrices is None else {**problem, "matrices": head.matrices},
            "algorithm": planning.algorithm,
            "parameters": dict(planning.parameters),
            "seed": planning.seed,
            **self._search,
            "run_time_limit_s": planning.time_limit_s,
            "mission_id": head.mission.id,
            "number": head.mission.state_number,
            "done": len(head.state["done"]),
        }


def _trouble_of(job: Job) -> dict[str, Any]:
    """Return why a search has failed."""
    if job.error is not None:
        return job.error
    return failure("job-cancelled", said("job {id} was cancelled", id=job.id))
