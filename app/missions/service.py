"""Missions as the rest of the program sees them: begin, tell what happens, look, listen."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncGenerator, Awaitable, Callable, Coroutine, Mapping
from typing import Any, TypeVar
from weakref import WeakValueDictionary

from app.domain.problem import Problem
from app.domain.records import problem_to_record
from app.domain.said import said
from app.jobs.model import Idempotency
from app.jobs.service import JobService
from app.missions import events
from app.missions.effects import differences
from app.missions.errors import EventRefused, EventReused, MissionBusy, ProposalClosed
from app.missions.judge import Judge
from app.missions.model import Entry, Judged, Mission, Planning, Proposal, ProposalStatus, Sent
from app.missions.planner import Planner
from app.missions.position_check import PositionCheck
from app.missions.sizes import require_sizes
from app.missions.state import MissionState, without_plan
from app.missions.store import MissionStore, Moved, newest_of
from app.missions.streams import MissionStreams, Told

# Another service may write to a mission between a look at it and what follows from it; so often in a row it
# does not.
_TRIES = 20
_SETTLE_S = 2.0
_CHECKS = 100
_EXPIRE_EVERY_S, _EXPIRED_AT_ONCE = 60.0, 20

_log = logging.getLogger(__name__)

T = TypeVar("T")
_CLOSES = {"proposal_accepted": ProposalStatus.ACCEPTED, "proposal_refused": ProposalStatus.REFUSED}


class MissionService:
    """Missions, their events, and the search for their plans.

    Parameters
    ----------
    store
        The tables.
    jobs
        Runs the searches.
    judge
        Works out what events do.
    search
        What the payload of a search has besides: ``library_url`` and ``threads``.
    largest
        How many ``uavs``, ``targets``, ``no_fly_zones`` and ``zone_corners`` a problem may have.
    retention_s
        Seconds without an event until a mission is deleted; None: never.

    Attributes
    ----------
    store
        The tables, for what only reads.
    """

    def __init__(
        self,
        store: MissionStore,
        jobs: JobService,
        judge: Judge,
        search: Mapping[str, Any],
        largest: Mapping[str, int],
        retention_s: float | None = None,
    ) -> None:
        self.store, self._judge, self._largest = store, judge, largest
        self._streams = MissionStreams(store)
        self._planner = Planner(store, jobs, search, self._streams.wake, self._accept)
        # Of the missions whose UAVs were seen last; thrown away at any moment.
        self._checks: dict[str, PositionCheck] = {}
        self._turns: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        self._begun: set[asyncio.Task[Any]] = set()
        self._retention_s = retention_s
        self._expiry: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Go on with the searches that an earlier process was at; the jobs have to be started before."""
        for mission_id in await asyncio.to_thread(self.store.wanting):
            self._planner.follow(mission_id)
        if self._retention_s is not None:
            self._expiry = asyncio.create_task(self._expire(self._retention_s))

    def begin_stop(self) -> None:
        """End all streams."""
        self._streams.stop()

    async def stop(self) -> None:
        """End streams, searches and the judge; what was judged in time is written."""
        self.begin_stop()
        if self._expiry is not None:
            self._expiry.cancel()
        if self._begun:
            await asyncio.wait(self._begun, timeout=_SETTLE_S)
        await self._planner.stop()
        await self._judge.close()
        if self._begun:
            await asyncio.wait(self._begun)

    async def begin(
        self, name: str | None, problem: Problem, planning: Planning, idempotency: Idempotency | None = None
    ) -> tuple[Mission, bool]:
        """Begin a mission, with the problem's ``start_plan`` in force; without one nobody flies yet.

        Parameters
        ----------
        name
            For people.
        problem, planning
            What it begins with, and how it is planned.
        idempotency
            The key that the request came with.

        Returns
        -------
        tuple
            The mission, and whether it is new: a key that was seen before with the same request gives the
            mission that it began, as it stands.

        Raises
        ------
        IdempotencyMismatch
            If the key came with another request before.
        IllegalPlan
            If that plan breaks a rule.
        MissionBusy
            If the judge does not answer.
        """
        if idempotency is not None:
            known = await asyncio.to_thread(self.store.begun_with, idempotency)
            if known is not None:
                return known, False
        if problem.start_plan is None:
            problem = without_plan(problem)
        record = problem_to_record(problem)
        begun = await self._judge.ask("begin", {"problem": record})
        state, plan = begun["state"], begun["plan"]
        create = asyncio.to_thread(self.store.create, name, record, planning, state, plan, idempotency)
        mission, new = await self._whole(create)
        if new:
            self._planner.follow(mission.id)
        return mission, new

    async def tell(
        self,
        mission_id: str,
        event: events.Event,
        at: float | None = None,
        *,
        event_id: str | None = None,
        digest: str | None = None,
    ) -> tuple[Entry, bool]:
        """Let something have happened; it is on disk with what it does when this returns.

        Parameters
        ----------
        mission_id
            The mission.
        event
            What has happened.
        at
            When that became known, by the mission's clock; None: at its clock, or when a UAV was seen last.
        event_id, digest
            Of the client, and of all that must not differ where the id comes again.

        Returns
        -------
        tuple
            The event as it is kept, and whether it is new: an id that was seen before with the same digest
            gives what came of it the first time.

        Raises
        ------
        MissionNotFound, EventReused
            If there is no such mission, or the event's id came with another one.
        EventRefused, ProposalClosed
            If the event is from the past, about something unknown, or impossible; or its proposal is closed.
        MissionBusy
            If the judge does not answer, or the mission changes each time before it has.
        """
        return await self._whole(self._tell(mission_id, event, at, event_id, digest))

    async def _tell(
        self,
        mission_id: str,
        event: events.Event,
        at: float | None,
        event_id: str | None,
        digest: str | None,
    ) -> tuple[Entry, bool]:
        lock = self._turns.setdefault(mission_id, asyncio.Lock())
        async with lock:
            for _ in range(_TRIES):
                try:
                    if isinstance(event, events.Telemetry):
                        entry, new = await self._see(mission_id, event, event_id, digest)
                    else:
                        entry, new = await self._judged(mission_id, event, at, event_id, digest)
                except Moved:
                    self._checks.pop(mission_id, None)
                    continue
                if new:
                    self._streams.tell(mission_id, entry)
                return entry, new
        raise MissionBusy(said("mission {id!r} is changed by others all the time; try again", id=mission_id))

    async def _known(self, mission_id: str, event_id: str, digest: str | None) -> Entry | None:
        known = await asyncio.to_thread(self.store.known, mission_id, event_id)
        if known is not None and known[1] != digest:
            raise EventReused(event_id, known[0].number)
        return None if known is None else known[0]

    async def _see(
        self, mission_id: str, event: events.Telemetry, event_id: str | None, digest: str | None
    ) -> tuple[Entry, bool]:
        """Keep positions; what they mean is worked out with the next event of another type."""
        check = self._checks.pop(mission_id, None)
        # What is not taken by the state that is remembered may be by a newer one.
        if check is None or check.violations(event):
            check = PositionCheck.of(await asyncio.to_thread(self.store.head, mission_id))
        if violations := check.violations(event):
            raise EventRefused.of(violations)
        self._checks[mission_id] = check
        if len(self._checks) > _CHECKS:
            del self._checks[next(iter(self._checks))]
        body = events.event_to_record(event)
        newest = newest_of(body["positions"])
        at = max(each["time"] for each in newest.values())
        sent = Sent(event_id, digest, body["type"], at, body)
        commit = self.store.commit_positions
        return await asyncio.to_thread(commit, mission_id, check.state_number, sent, newest)

    async def _judged(
        self,
        mission_id: str,
        event: events.Event,
        at: float | None,
        event_id: str | None,
        digest: str | None,
    ) -> tuple[Entry, bool]:
        head = await asyncio.to_thread(self.store.head, mission_id)
        if event_id is not None and (known := await self._known(mission_id, event_id, digest)):
            return known, False
        seen = head.new_positions
        if at is None:
            at = max([head.mission.clock, *(each["time"] for each in seen.values())])
        require_sizes(head.state["problem"], event, self._largest)
        proposal = await self._proposal_of(head.mission.id, event)
        body = events.event_to_record(event)
        payload = {
            "state": head.state,
            "matrices": head.matrices,
            "event": body,
            "at": at,
            "positions": seen,
            "proposal": None if proposal is None else proposal.content,
        }
        try:
            after = await self._judge.ask("apply", payload)
        except ProposalClosed:
            if proposal is not None:
                await self._outdate(mission_id, proposal, at)
            raise
        closes = None if proposal is None else (proposal.number, _CLOSES[body["type"]])
        judged = Judged(after["state"], after["plan"], after["effect"], after["wants_plan"], closes)
        sent = Sent(event_id, digest, body["type"], at, body)
        entry, new = await asyncio.to_thread(
            self.store.commit, head.mission.id, head.mission.last_number, sent, judged
        )
        if judged.wants_plan and new:
            self._planner.follow(head.mission.id, entry.number)
        return entry, new

    async def _outdate(self, mission_id: str, proposal: Proposal, at: float) -> None:
        """Look for another plan in place of one that fits no more, from where UAVs are now."""
        await self._judged(mission_id, events.Clock(), at, None, None)
        await asyncio.to_thread(self.store.outdate, mission_id, proposal.number)
        self._planner.follow(mission_id)

    async def _proposal_of(self, mission_id: str, event: events.Event) -> Proposal | None:
        """Return the proposal that an event is about, which has to be open."""
        if not isinstance(event, events.ProposalAccepted | events.ProposalRefused):
            return None
        proposal = await asyncio.to_thread(self.store.proposal, mission_id, event.proposal)
        if proposal is None:
            detail = said("{number} is no number of a proposal of this mission", number=event.proposal)
            raise EventRefused.at("/proposal", detail)
        if proposal.status is not ProposalStatus.OPEN:
            raise ProposalClosed.already(event.proposal, proposal.status.value)
        return proposal

    async def _accept(self, mission_id: str) -> None:
        """Let the open proposal of a mission take effect, if it still fits."""
        for proposal in await asyncio.to_thread(self.store.proposals, mission_id):
            if proposal.status is ProposalStatus.OPEN:
                with contextlib.suppress(ProposalClosed):
                    await self.tell(mission_id, events.ProposalAccepted(proposal.number))
                return

    async def delete(self, mission_id: str) -> None:
        """Delete a mission with all that is kept of it.

        Raises
        ------
        MissionNotFound
            If there is none of that id.
        """
        await asyncio.to_thread(self.store.delete, mission_id)
        self._forget(mission_id)

    def _forget(self, mission_id: str) -> None:
        """Stop what is done for a mission that is no more."""
        self._checks.pop(mission_id, None)
        self._planner.drop(mission_id)
        self._streams.wake(mission_id)

    async def _expire(self, retention_s: float) -> None:
        """Delete missions in which nothing happens any more, some at a time."""
        while True:
            gone: list[str] = []
            try:
                before = time.time() - retention_s
                gone = await asyncio.to_thread(self.store.expire, before, _EXPIRED_AT_ONCE)
            except Exception:
                _log.exception("old missions could not be deleted; there will be another try")
            for mission_id in gone:
                self._forget(mission_id)
            if gone:
                _log.info("missions of long ago were deleted", extra={"missions": len(gone)})
            await asyncio.sleep(0.0 if len(gone) == _EXPIRED_AT_ONCE else _EXPIRE_EVERY_S)

    async def look(self, mission_id: str, at: float | None) -> tuple[int, Mapping[str, Any]]:
        """Return the state of a mission at a moment: as it was, or as it is planned to be.

        Parameters
        ----------
        mission_id
            The mission.
        at
            By its clock; None: now.

        Returns
        -------
        tuple
            Number of the event that it follows from, and ``state`` and ``plan``.

        Raises
        ------
        MissionNotFound, MissionBusy
            If there is no such mission, or the judge does not answer.
        """
        head = await asyncio.to_thread(self.store.head, mission_id)
        if at is None or at == head.mission.clock:
            return head.mission.state_number, {"state": head.state, "plan": head.plan}
        number, state, seen = head.mission.state_number, head.state, head.new_positions
        if at < head.mission.clock:
            number, state = await asyncio.to_thread(self.store.state_at, mission_id, at)
            seen = {}
        payload = {"state": state, "matrices": head.matrices, "at": at, "positions": seen}
        return number, await self._judge.ask("look", payload)

    async def differences(self, mission_id: str, before: int, after: int) -> dict[str, Any]:
        """Return how the plans differ that were in force after two events, see :mod:`app.missions.effects`.

        Raises
        ------
        MissionNotFound
            If there is no such mission.
        """
        records = [
            (await asyncio.to_thread(self.store.state_after, mission_id, number))[1]
            for number in (before, after)
        ]
        head = await asyncio.to_thread(self.store.head, mission_id)
        states = [MissionState.from_record(record, head.matrices) for record in records]
        uav_ids = [uav.id for uav in states[-1].problem.uavs]
        return differences(uav_ids, states[0].routes, states[1].routes)

    def listen(
        self, mission_id: str, after: int, allowed: Callable[[], Awaitable[bool]] | None = None
    ) -> AsyncGenerator[Told]:
        """Listen to a mission, see :meth:`app.missions.streams.MissionStreams.listen`."""
        return self._streams.listen(mission_id, after, allowed)

    async def _whole(self, work: Coroutine[Any, Any, T]) -> T:
        """Do something to its end, also if the caller is cancelled."""
        task = asyncio.create_task(work)
        self._begun.add(task)
        task.add_done_callback(self._begun.discard)
        return await asyncio.shield(task)
