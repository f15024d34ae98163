"""Several services on one job table: they show that they live, and tell each other what happens.

What is told is only a hint to look, and may get lost: waiting jobs and dead owners are looked for once a
lease, cancellations with every sign of life, and those who wait for a job look at the table now and then.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass

from app.jobs.channel import Channels, rung
from app.jobs.lease import Held, Lease
from app.jobs.model import LANES, Lane
from app.jobs.reading import Announcements, Database
from app.jobs.run import Run
from app.jobs.writer import Writer

_CHANNEL = "allocator_jobs"

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Reactions:
    """What the dispatcher does when something is heard.

    Attributes
    ----------
    look_for_work
        A job waits in a lane.
    stop
        A job that runs here should stop.
    give_back
        The table has a job, in this attempt, as one that runs here, but it does not.
    look_after
        It is time to look for jobs that nobody runs.
    """

    look_for_work: Callable[[Lane], None]
    stop: Callable[[Run], None]
    give_back: Callable[[str, int], Awaitable[None]]
    look_after: Callable[[], Awaitable[None]]


class Shared:
    """The company of services that share a PostgreSQL database.

    Parameters
    ----------
    database, owner, lease_s
        As :class:`app.jobs.lease.Lease` takes them.
    writer
        Whose thread brings signs of life to the table.
    runs
        The jobs that run here, by their id.
    channels
        Who listens here to which job.
    reactions
        What is done when something is heard.
    """

    others_may_wait = True

    def __init__(
        self,
        database: Database,
        owner: str,
        lease_s: float,
        writer: Writer,
        runs: Mapping[str, Run],
        channels: Channels,
        reactions: Reactions,
    ) -> None:
        self._database = database
        self._lease = Lease(database, owner, lease_s)
        self._lease_s = lease_s
        self._writer = writer
        self._runs = runs
        self._channels = channels
        self._reactions = reactions
        self._announcements: Announcements | None = None
        self._living: asyncio.Task[None] | None = None
        self._ended = asyncio.Event()

    async def join(self) -> None:
        """Show this service among the living, and begin to listen."""
        await self._writer.write_surely(self._lease.show)
        loop = asyncio.get_running_loop()

        def heard(message: str | None) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(self._hear, message)

        self._announcements = await asyncio.to_thread(self._database.announcements, _CHANNEL, heard)
        self._living = asyncio.create_task(self._live())

    async def leave(self) -> None:
        """Say nothing any more, and be forgotten."""
        self._ended.set()
        if self._living is not None:
            await self._living
        if self._announcements is not None:
            await asyncio.to_thread(self._announcements.close)
        with contextlib.suppress(Exception):  # a server that is gone: the others will see that this one is
            await self._writer.write(self._lease.end)

    def is_alive(self, owner: str) -> bool:
        """Say whether an owner was seen within the lease."""
        return self._lease.is_alive(owner)

    def tell_waiting(self, lane: Lane) -> None:
        """Tell the others that a job waits in a lane."""
        self._tell("waiting", lane)

    def tell_ended(self, job_id: str) -> None:
        """Tell the others that a job has ended."""
        self._tell("ended", job_id)

    def tell_cancelled(self, job_id: str) -> None:
        """Tell the others that a job, which one of them runs, should stop."""
        self._tell("cancelled", job_id)

    def _tell(self, what: str, of: str) -> None:
        if self._announcements is not None:
            self._announcements.tell(f"{what} {of}")

    def _hear(self, message: str | None) -> None:
        what, _, of = (message or "").partition(" ")
        match what:
            case "waiting":
                self._heard_waiting(of)
            case "ended":
                self._channels.look_again(of)
            case "cancelled" if of in self._runs:
                self._reactions.stop(self._runs[of])
            case "":
                # Something may have been missed.
                for lane in LANES:
                    self._reactions.look_for_work(lane)
                self._channels.ring()

    def _heard_waiting(self, lane: str) -> None:
        for known in LANES:
            if known == lane:
                self._reactions.look_for_work(known)

    async def _live(self) -> None:
        """Give signs of life until the end, and see in the table what was not heard."""
        looked = time.monotonic()
        while not self._ended.is_set():
            await rung(self._ended, self._lease.pause_s)
            try:
                await self._compare()
                if time.monotonic() - looked >= self._lease_s:
                    looked = time.monotonic()
                    await self._reactions.look_after()
            except Exception:
                _log.exception("no sign of life could be given; there will be another try")

    async def _compare(self) -> None:
        """Show that this service lives, and bring what runs here and what the table says of it together.

        They differ where a connection was cut in the midst of a commit, of which nobody knows then whether
        it was made, and where this service was taken for dead.
        """
        before = dict(self._runs)
        held: Mapping[str, Held] = await self._writer.write(self._lease.show)
        for job_id, run in before.items():
            mine = held.get(job_id)
            if self._runs.get(job_id) is not run:
                continue
            if mine is None or mine.attempt != run.job.attempt:
                _log.warning("a job was given to another service", extra={"job_id": job_id})
                run.kill("gone")
            elif mine.cancel_requested:
                self._reactions.stop(run)
        for job_id, mine in held.items():
            if job_id not in self._runs and job_id not in before:
                await self._reactions.give_back(job_id, mine.attempt)
