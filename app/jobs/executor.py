"""What runs work in other processes: executors that keep one worker alive in each of their slots.

An executor calls back, and is called, on the event loop's thread. It is small enough for one machine or many:
:class:`app.jobs.local.LocalExecutor`, :class:`app.jobs.ray_cluster.RayExecutor`.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol

from app.jobs.clock import wait_for
from app.jobs.model import Progress, WorkResult

# The workers share the cores: one that starts threads of its own slows the others down, and itself.
SINGLE_THREADED = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

# Memory that glibc has once got it keeps, up to arrays of 32 MB: to get it again can take longer from the
# system than all the work that is done in it, and what a worker takes stays what its largest job took.
KEEPS_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(32 * 1024**2), "MALLOC_TRIM_THRESHOLD_": str(512 * 1024**2)}

_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.5, 30.0

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Returned:
    """The work function returned."""

    work: WorkResult


@dataclass(frozen=True, slots=True)
class Raised:
    """The work function raised; the error object of the job, and the traceback for the log."""

    error: dict[str, Any]
    traceback: str


@dataclass(frozen=True, slots=True)
class Lost:
    """The worker died, or was killed, before the work function ended."""

    reason: str


Outcome = Returned | Raised | Lost


@dataclass(frozen=True, slots=True)
class Work:
    """A piece of work.

    Attributes
    ----------
    function, payload
        ``"module:function"`` and what it gets.
    labels
        What the lines have that are logged meanwhile.
    deadline
        When its time is up, by the monotonic clock; infinite for never.
    on_progress
        Called with every progress.
    """

    function: str
    payload: Mapping[str, Any]
    labels: dict[str, str]
    deadline: float
    on_progress: Callable[[Progress], None]


class Worker(Protocol):
    """A worker as its slot sees it."""

    @property
    def name(self) -> str:
        """What the log calls it."""

    async def warm_up(self) -> None:
        """Start it and wait until it is warm; raises if it never becomes so."""

    async def stay(self) -> None:
        """Wait until it is gone."""

    async def run(self, work: Work, cancelled: bool) -> Outcome | None:
        """Do one piece of work, cancelled before it begins or not; None if the worker was gone before."""

    def cancel(self) -> None:
        """Raise the flag that the work polls."""

    def share(self, workers: float) -> None:
        """Tell the work how many workers' cores it may use."""

    def kill(self) -> None:
        """End it, wherever it is; nothing happens if it is gone."""

    async def discard(self) -> None:
        """End it and give back what belonged to it."""


class Execution:
    """One piece of work, from waiting for a worker to its outcome."""

    def __init__(self, executor: Executor, work: Work) -> None:
        self._cancelled = False
        self._worker: Worker | None = None
        self.task = asyncio.create_task(self._run(executor, work))

    async def outcome(self) -> Outcome:
        """Wait until the work has ended. Every progress was delivered before, the last one included."""
        try:
            return await asyncio.shield(self.task)
        except asyncio.CancelledError:
            if self.task.cancelled():
                return Lost("it was stopped before a worker was free")
            raise

    def cancel(self) -> None:
        """Ask the work to stop by itself."""
        self._cancelled = True
        if self._worker is not None:
            self._worker.cancel()

    def kill(self) -> None:
        """Kill the worker, or give up waiting for one; :class:`Lost` unless the work ended meanwhile."""
        if self._worker is not None:
            self._worker.kill()
        else:
            self.task.cancel()

    async def _run(self, executor: Executor, work: Work) -> Outcome:
        outcome = None
        while outcome is None:
            worker = self._worker = await executor.free.get()
            executor.working.add(worker)
            executor.divide()
            try:
                outcome = await worker.run(work, self._cancelled)
            finally:
                self._worker = None
                executor.working.discard(worker)
        if not isinstance(outcome, Lost):
            executor.free.put_nowait(worker)
            executor.divide()
        return outcome


class Executor(ABC):
    """Runs work functions in other processes, at most ``capacity`` at a time.

    Parameters
    ----------
    slots
        How many workers there are, at least 1.
    warm_up, warm_up_arguments
        ``"module:function"`` and its arguments, called in every worker before it gets work; compiles and
        imports what the first work would otherwise wait for. A worker whose warm-up raises is replaced after
        a pause.
    environment
        Variables of the workers, set before their process starts: the libraries read them as they load.
    log_level
        What the workers log at least; None leaves Python's own way.
    niceness
        By how much warm workers leave the cores to others: the service's own process, which takes requests
        in and sends answers, must not wait for searches that use all there is.

    Attributes
    ----------
    capacity
        How many pieces of work run at a time when there is a place for every worker.
    restarts
        How many workers have been replaced.
    free, working
        The warm workers that do nothing, and those that work.
    """

    def __init__(
        self,
        slots: int,
        *,
        warm_up: str | None = None,
        warm_up_arguments: tuple[Any, ...] = (),
        environment: Mapping[str, str] = MappingProxyType(SINGLE_THREADED | KEEPS_MEMORY),
        log_level: str | None = None,
        niceness: int = 0,
    ) -> None:
        if slots < 1:
            raise ValueError(f"slots is {slots}, but at least one worker is needed")
        self._warm_up = warm_up, niceness, *warm_up_arguments
        self._environment, self._log_level = dict(environment), log_level
        self.capacity, self.restarts = slots, 0
        self.free: asyncio.Queue[Worker] = asyncio.Queue()
        self.working: set[Worker] = set()
        self._workers: set[Worker] = set()
        self._ready: set[Worker] = set()
        self._executions: set[Execution] = set()
        self._closing = asyncio.Event()
        self._keepers: list[asyncio.Task[None]] = []

    @property
    def ready(self) -> int:
        """How many workers are warm, whether they work or not."""
        return len(self._ready)

    async def start(self, on_ready: Callable[[], None]) -> None:
        """Begin to start the workers; ``on_ready`` is called for each, and for each that replaces one."""
        _log.info(
            "workers get ready; where nothing is compiled yet that takes minutes",
            extra={"workers": self.capacity},
        )
        self._keepers = [asyncio.create_task(self._keep_slot(on_ready)) for _ in range(self.capacity)]

    def submit(
        self,
        work: str,
        payload: Mapping[str, Any],
        *,
        time_left_s: float | None,
        on_progress: Callable[[Progress], None],
        labels: Mapping[str, str] = MappingProxyType({}),
    ) -> Execution:
        """Hand ``"module:function"`` and its payload to the next free worker; never blocks.

        The lines that the worker logs in its course have the ``labels``, ids by their names.
        ``time_left_s`` may be negative: the work still runs, and sees that its time is up.
        """
        deadline = math.inf if time_left_s is None else time.monotonic() + time_left_s
        execution = Execution(self, Work(work, payload, dict(labels), deadline, on_progress))
        # Kept until it has ended, to be killed when the executor closes.
        self._executions.add(execution)
        execution.task.add_done_callback(lambda _task: self._executions.discard(execution))
        return execution

    def divide(self) -> None:
        """Tell every worker that works how many workers' cores it may use: with its part of the idle ones."""
        for worker in self.working:
            worker.share(1.0 + self.free.qsize() // len(self.working))

    async def close(self) -> None:
        """Kill all workers; work that was not awaited is lost."""
        self._closing.set()
        for execution in tuple(self._executions):
            execution.kill()
        for worker in tuple(self._workers):
            worker.kill()
        await asyncio.gather(*self._keepers)

    @abstractmethod
    def _new_worker(self) -> Worker:
        """Make a worker that is not started yet."""

    async def _keep_slot(self, on_ready: Callable[[], None]) -> None:
        """Keep one worker alive until the executor closes."""
        pause = _FIRST_PAUSE_S
        while not self._closing.is_set():
            if await self._live_once(on_ready):
                pause = _FIRST_PAUSE_S
            else:
                await wait_for(self._closing, pause)
                pause = min(2 * pause, _LONGEST_PAUSE_S)
            self.restarts += not self._closing.is_set()

    async def _live_once(self, on_ready: Callable[[], None]) -> bool:
        """Start one worker and stay until it is gone; False if it never became warm."""
        worker, begun = self._new_worker(), time.monotonic()
        self._workers.add(worker)
        try:
            await worker.warm_up()
            if not self._closing.is_set():
                self._ready.add(worker)
                self.free.put_nowait(worker)
                on_ready()
                took = round(time.monotonic() - begun, 1)
                _log.info("a worker is ready", extra={"worker": worker.name, "seconds": took})
                await worker.stay()
                if not self._closing.is_set():
                    _log.warning("a worker is gone and is replaced", extra={"worker": worker.name})
        except Exception:
            # Whatever the reason, the slot goes on trying.
            if not self._closing.is_set():
                _log.exception("a worker could not be started; there will be another try")
            return False
        else:
            return True
        finally:
            self._ready.discard(worker)
            await worker.discard()
            self._workers.discard(worker)
