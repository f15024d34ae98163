"""What executors share: slots that each keep one worker alive, and work that waits for a free one."""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from app.jobs.channel import rung
from app.jobs.executor import Lost, Outcome

_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.5, 30.0

_log = logging.getLogger(__name__)


class SlotWorker(Protocol):
    """A worker as its slot sees it."""

    @property
    def name(self) -> str:
        """What the log calls it."""

    async def warm_up(self) -> None:
        """Start it and wait until it is warm; raises if it never becomes so."""

    async def stay(self) -> None:
        """Wait until it is gone."""

    def kill(self) -> None:
        """End it, wherever it is; nothing happens if it is gone."""

    async def discard(self) -> None:
        """End it and give back what belonged to it."""


W = TypeVar("W", bound=SlotWorker)


class SlotExecution(ABC, Generic[W]):
    """One piece of work, from waiting for a worker to its outcome.

    Parameters
    ----------
    free
        The warm workers that do nothing.
    """

    def __init__(self, free: asyncio.Queue[W]) -> None:
        self._free = free
        self._cancelled = False
        self._worker: W | None = None
        self.task = asyncio.create_task(self._run())

    async def outcome(self) -> Outcome:
        """Wait until the work has ended."""
        try:
            return await asyncio.shield(self.task)
        except asyncio.CancelledError:
            if self.task.cancelled():
                return Lost("it was stopped before a worker was free")
            raise

    def kill(self) -> None:
        """Kill the worker, or give up waiting for one."""
        if self._worker is not None:
            self._worker.kill()
        else:
            self.task.cancel()

    @abstractmethod
    def cancel(self) -> None:
        """Raise the flag that the work polls."""

    @abstractmethod
    async def _run(self) -> Outcome:
        """Wait for a worker, have it do the work, and put it back unless it is gone."""


class SlotExecutor(ABC, Generic[W]):
    """Keeps one worker alive in each of its slots.

    Parameters
    ----------
    slots
        How many workers there are, at least 1.
    """

    def __init__(self, slots: int) -> None:
        if slots < 1:
            raise ValueError(f"slots is {slots}, but at least one worker is needed")
        self._slots = slots
        self._workers: set[W] = set()
        self._ready: set[W] = set()
        self._free: asyncio.Queue[W] = asyncio.Queue()
        self._executions: set[SlotExecution[W]] = set()
        self._closing = asyncio.Event()
        self._restarts = 0
        self._keepers: list[asyncio.Task[None]] = []

    @property
    def capacity(self) -> int:
        """How many pieces of work run at a time when there is a place for every worker."""
        return self._slots

    @property
    def ready(self) -> int:
        """How many workers are warm, whether they work or not."""
        return len(self._ready)

    @property
    def restarts(self) -> int:
        """How many workers have been replaced."""
        return self._restarts

    async def start(self, on_ready: Callable[[], None]) -> None:
        """Begin to start the workers; ``on_ready`` is called for each, and for each that replaces one."""
        self._keepers = [asyncio.create_task(self._keep_slot(on_ready)) for _ in range(self._slots)]

    async def close(self) -> None:
        """Kill all workers; work that was not awaited is lost."""
        self._closing.set()
        for execution in tuple(self._executions):
            execution.kill()
        for each in tuple(self._workers):
            each.kill()
        await asyncio.gather(*self._keepers)

    @abstractmethod
    def _new_worker(self) -> W:
        """Make a worker that is not started yet."""

    def _keep(self, execution: SlotExecution[W]) -> None:
        """Remember work until it has ended, to kill it when the executor closes."""
        self._executions.add(execution)
        execution.task.add_done_callback(lambda _task: self._executions.discard(execution))

    async def _keep_slot(self, on_ready: Callable[[], None]) -> None:
        """Keep one worker alive until the executor closes."""
        pause = _FIRST_PAUSE_S
        while not self._closing.is_set():
            if await self._live_once(on_ready):
                pause = _FIRST_PAUSE_S
            else:
                await rung(self._closing, pause)
                pause = min(2 * pause, _LONGEST_PAUSE_S)
            if not self._closing.is_set():
                self._restarts += 1

    async def _live_once(self, on_ready: Callable[[], None]) -> bool:
        """Start one worker and stay until it is gone; False if it never became warm."""
        slot = self._new_worker()
        self._workers.add(slot)
        try:
            await slot.warm_up()
            if not self._closing.is_set():
                self._ready.add(slot)
                self._free.put_nowait(slot)
                on_ready()
                await slot.stay()
                if not self._closing.is_set():
                    _log.warning("a worker is gone and is replaced", extra={"worker": slot.name})
        except Exception:
            # Whatever the reason, the slot goes on trying.
            if not self._closing.is_set():
                _log.exception("a worker could not be started; there will be another try")
            return False
        else:
            return True
        finally:
            self._ready.discard(slot)
            await slot.discard()
            self._workers.discard(slot)
