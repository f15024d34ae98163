"""Several services on one job table: they show that they live, and tell each other what happens.

What is told is only a hint to look, and may get lost: waiting jobs and dead owners are looked for once a
lease, cancellations with every sign of life, and those who wait for a job look at the table now and then.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time

from app.jobs.channel import Channels, rung
from app.jobs.lease import Held, Lease
from app.jobs.model import LANES, Lane
from app.jobs.peers import NoPeers, Peers, Reactions
from app.jobs.reading import Announcements, Database
from app.jobs.run import Runs
from app.jobs.writer import Writer

_CHANNEL = "allocator_jobs"

_log = logging.getLogger(__name__)


class Shared:
    """The services that share a PostgreSQL database with this one.

    Parameters
    ----------
    database, owner, lease_s
        As :class:`app.jobs.lease.Lease` takes them.
    writer
        Whose thread brings signs of life to the table.
    runs
        The jobs that run here.
    channels
        Who listens here to which job.
    """

    others_may_wait = True

    def __init__(
        self,
        database: Database,
        owner: str,
        lease_s: float,
        writer: Writer,
        runs: Runs,
        channels: Channels,
    ) -> None:
        self._database = database
        self._lease = Lease(database, owner, lease_s)
        self._lease_s = lease_s
        self._writer = writer
        self._runs = runs
        self._channels = channels
        self._announcements: Announcements | None = None
        self._living: asyncio.Task[None] | None = None
        self._ended = asyncio.Event()

    async def join(self, reactions: Reactions) -> None:
        """Show this service among the living, and begin to listen."""
        await self._writer.write_surely(self._lease.show)
        loop = asyncio.get_running_loop()

        def heard(message: str | None) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(self._hear, message, reactions)

        self._announcements = await asyncio.to_thread(self._database.announcements, _CHANNEL, heard)
        self._living = asyncio.create_task(self._live(reactions))

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

    def _hear(self, message: str | None, reactions: Reactions) -> None:
        what, _, of = (message or "").partition(" ")
        match what:
            case "waiting":
                for lane in LANES:
                    if lane == of:
                        reactions.look_for_work(lane)
            case "ended":
                reactions.forget(of)
                self._channels.look_again(of)
            case "cancelled" if (run := self._runs.of(of)) is not None:
                reactions.stop(run)
            case "":
                # Something may have been missed.
                for lane in LANES:
                    reactions.look_for_work(lane)
                self._channels.ring()

    async def _live(self, reactions: Reactions) -> None:
        """Give signs of life until the end, and see in the table what was not heard."""
        looked = time.monotonic()
        while not self._ended.is_set():
            await rung(self._ended, self._lease.pause_s)
            try:
                await self._compare(reactions)
                if time.monotonic() - looked >= self._lease_s:
                    looked = time.monotonic()
                    await reactions.look_after()
            except Exception:
                _log.exception("no sign of life could be given; there will be another try")

    async def _compare(self, reactions: Reactions) -> None:
        """Show that this service lives, and bring what runs here and what the table says of it together.

        They differ where a connection was cut in the midst of a commit, of which nobody knows then whether
        it was made, and where this service was taken for dead.
        """
        before = list(self._runs)
        held: dict[str, Held] = await self._writer.write(self._lease.show)
        for run in before:
            mine = held.get(run.job.id)
            if run not in self._runs:
                continue
            if mine is None or mine.attempt != run.job.attempt:
                _log.warning("a job was taken from this service", extra={"job_id": run.job.id})
                run.kill("gone")
            elif mine.cancel_requested:
                reactions.stop(run)
        known = {run.job.id for run in before}
        for job_id, mine in held.items():
            if job_id not in known and self._runs.of(job_id) is None:
                await reactions.give_back(job_id, mine.attempt)


def peers_on(
    database: Database,
    owner: str,
    lease_s: float,
    writer: Writer,
    runs: Runs,
    channels: Channels,
) -> Peers:
    """Return whom an owner shares a database with: nobody, or others; see :class:`Shared`."""
    if not database.shared:
        return NoPeers(owner)
    return Shared(database, owner, lease_s, writer, runs, channels)
