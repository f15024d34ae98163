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
    """The worker died, or was killed, before the work function ended.

    Attributes
    ----------
    reason
        What happened.
    begun
        Whether a worker had begun with it.
    """

    reason: str
    begun: bool = True


Outcome = Returned | Raised | Lost

Message = Progress | Returned | Raised
"""What a worker sends of a piece of work: every progress in its order, and then how it ended."""


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
    """A worker as its slot sees it; it begins to start when it is made."""

    @property
    def name(self) -> str:
        """What the log calls it."""

    async def stay(self) -> None:
        """Wait until it is gone."""

    async def run(self, work: Work, cancelled: bool) -> Outcome | None:
        """Do one piece of work, cancelled before it begins or not; None if the worker was gone before."""

    def cancel(self) -> None:
        """Raise the flag that the work polls."""

    def share(self, workers: float) -> None:
        """Tell the work how many workers' cores it may use."""

    def is_held(self) -> bool:
        """Whether its work is at something that cannot stop and ends by itself."""

    def kill(self) -> None:
        """End it, wherever it is; nothing happens if it is gone."""

    async def discard(self) -> None:
        """End it and wait for its end."""


class Execution:
    """One piece of work, from waiting for a worker to its outcome.

    Attributes
    ----------
    worker
        Which does it; None while it waits for one.
    """

    def __init__(self, executor: Executor, work: Work) -> None:
        self.worker: Worker | None = None
        self._cancelled = False
        self.task = asyncio.create_task(self._run(executor, work))

    async def outcome(self) -> Outcome:
        """Wait until the work has ended. Every progress was delivered before, the last one included."""
        try:
            return await asyncio.shield(self.task)
        except asyncio.CancelledError:
            if self.task.cancelled():
                return Lost("no worker was free before it was stopped", begun=False)
            raise

    def cancel(self) -> None:
        """Ask the work to stop by itself."""
        self._cancelled = True
        if self.worker is not None:
            self.worker.cancel()

    def is_held(self) -> bool:
        """Whether the work is at something that cannot stop and ends by itself."""
        return self.worker is not None and self.worker.is_held()

    def kill(self) -> None:
        """Kill the worker, or give up waiting for one; :class:`Lost` unless the work ended meanwhile."""
        if self.worker is not None:
            self.worker.kill()
        else:
            self.task.cancel()

    async def _run(self, executor: Executor, work: Work) -> Outcome:
        outcome = None
        while outcome is None:
            worker = self.worker = await executor.free.get()
            executor.divide()
            try:
                outcome = await worker.run(work, self._cancelled)
            finally:
                self.worker = None
            if outcome is None and not executor.ready:
                outcome = Lost("the last worker was gone before it began", begun=False)
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
    ready
        How many workers are warm, whether they work or not.
    restarts
        How many workers have been replaced.
    free
        The warm workers that do nothing.
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
        first = {"hook": warm_up, "arguments": warm_up_arguments, "niceness": niceness}
        self._warm_up = Work("app.jobs.worker:warm_up", first, {}, math.inf, lambda _progress: None)
        self._environment, self._log_level = dict(environment), log_level
        self.capacity, self.ready, self.restarts = slots, 0, 0
        self.free: asyncio.Queue[Worker] = asyncio.Queue()
        self._executions: set[Execution] = set()
        self._keepers: list[asyncio.Task[None]] = []

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
        time_left_s: float | None = None,
        on_progress: Callable[[Progress], None] = lambda _progress: None,
        labels: Mapping[str, str] = MappingProxyType({}),
    ) -> Execution:
        """Hand ``"module:function"`` and its payload to the next free worker; never blocks.

        The lines that the worker logs in its course have the ``labels``, ids by their names.
        ``time_left_s`` may be negative: the work still runs, and sees that its time is up; None: no limit.
        """
        deadline = math.inf if time_left_s is None else time.monotonic() + time_left_s
        execution = Execution(self, Work(work, payload, dict(labels), deadline, on_progress))
        # Kept until it has ended, to be killed when the executor closes.
        self._executions.add(execution)
        execution.task.add_done_callback(lambda _task: self._executions.discard(execution))
        return execution

    def divide(self) -> None:
        """Tell every worker that works how many workers' cores it may use: with its part of the idle ones."""
        working = [execution.worker for execution in self._executions if execution.worker is not None]
        for worker in working:
            worker.share(1.0 + self.free.qsize() // len(working))

    async def close(self) -> None:
        """Kill all workers; work that was not awaited is lost."""
        for execution in tuple(self._executions):
            execution.kill()
        for keeper in self._keepers:
            keeper.cancel()
        await asyncio.gather(*self._keepers, return_exceptions=True)

    @abstractmethod
    def _new_worker(self) -> Worker:
        """Make a worker, which begins to start."""

    async def _keep_slot(self, on_ready: Callable[[], None]) -> None:
        """Keep one worker alive until the executor closes."""
        pause = _FIRST_PAUSE_S
        while True:
            try:
                await self._live_once(on_ready)
                pause = _FIRST_PAUSE_S
            except Exception:
                # Whatever the reason, the slot goes on trying.
                _log.exception("a worker could not be started; there will be another try")
                await asyncio.sleep(pause)
                pause = min(2 * pause, _LONGEST_PAUSE_S)
            self.restarts += 1

    async def _live_once(self, on_ready: Callable[[], None]) -> None:
        """Start one worker and stay until it is gone; raises if it never becomes warm."""
        worker, begun, warm = self._new_worker(), time.monotonic(), False
        try:
            outcome = await worker.run(self._warm_up, cancelled=False)
            if not isinstance(outcome, Returned):
                raise ChildProcessError(getattr(outcome, "traceback", "it has died"))
            warm = True
            self.ready += 1
            self.free.put_nowait(worker)
            on_ready()
            took = round(time.monotonic() - begun, 1)
            _log.info("a worker is ready", extra={"worker": worker.name, "seconds": took})
            await worker.stay()
            _log.warning("a worker is gone and is replaced", extra={"worker": worker.name})
        finally:
            self.ready -= warm
            if warm and not self.ready:
                # Until one is warm takes a while: what none has begun with is given back.
                for waiting in [each for each in self._executions if each.worker is None]:
                    waiting.kill()
            await worker.discard()
