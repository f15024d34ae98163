"""Work on this machine: slots, each a process pool of one worker.

One worker a pool, because a pool of several fails everybody's work when one of them dies. Workers are
spawned: a process forked after torch has run can hang. A worker that dies, busy or idle, is noticed at once,
because its end of the progress pipe closes with it, and its slot gets a new one.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import itertools
import logging
import math
import multiprocessing
import os
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, MutableSequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from types import MappingProxyType
from typing import Any, cast

from app.jobs import worker
from app.jobs.channel import rung
from app.jobs.executor import Lost, Outcome, Raised
from app.jobs.failure import describe
from app.jobs.model import Progress
from app.jobs.work_context import CANCEL, DEADLINE, new_control

# The workers share the cores: one that starts threads of its own slows the others down, and itself.
SINGLE_THREADED = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

# Memory that glibc has once got it keeps, up to arrays of 32 MB: to get it again can take longer from the
# system than all the work that is done in it, and what a worker takes stays what its largest job took.
KEEPS_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(32 * 1024**2), "MALLOC_TRIM_THRESHOLD_": str(512 * 1024**2)}

_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.5, 30.0

_log = logging.getLogger(__name__)
_spawning = threading.Lock()
_serials = itertools.count(1)


class LocalExecutor:
    """Runs work in processes of this machine.

    Parameters
    ----------
    slots
        How many workers there are.
    warm_up, warm_up_arguments
        ``"module:function"`` and its arguments, called in every worker before it gets work; compiles and
        imports what the first work would otherwise wait for. A worker whose warm-up raises is replaced after
        a pause.
    environment
        Variables of the workers, set before their process starts: the libraries read them as they load.
    log_level
        What the workers log at least, to their standard error; None leaves Python's own way.
    """

    def __init__(
        self,
        slots: int,
        *,
        warm_up: str | None = None,
        warm_up_arguments: tuple[Any, ...] = (),
        environment: Mapping[str, str] = MappingProxyType(SINGLE_THREADED | KEEPS_MEMORY),
        log_level: str | None = None,
    ) -> None:
        if slots < 1:
            raise ValueError(f"slots is {slots}, but at least one worker is needed")
        self._slots = slots
        self._warm_up = partial(worker.warm_up, warm_up, *warm_up_arguments)
        self._environment = dict(environment)
        self._log_level = log_level
        self._workers: set[_Worker] = set()
        self._ready: set[_Worker] = set()
        self._free: asyncio.Queue[_Worker] = asyncio.Queue()
        self._executions: set[_LocalExecution] = set()
        self._closing = asyncio.Event()
        self._restarts = 0
        self._keepers: list[asyncio.Task[None]] = []

    @property
    def capacity(self) -> int:
        """How many pieces of work run at a time."""
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

    def submit(
        self,
        work: str,
        payload: dict[str, Any],
        *,
        time_left_s: float | None,
        on_progress: Callable[[Progress], None],
        labels: Mapping[str, str] = MappingProxyType({}),
    ) -> _LocalExecution:
        """Hand work to the next free worker, see :meth:`app.jobs.executor.Executor.submit`."""
        execution = _LocalExecution(
            self._free, partial(worker.run, dict(labels), work, payload), time_left_s, on_progress
        )
        self._executions.add(execution)
        execution.task.add_done_callback(lambda _task: self._executions.discard(execution))
        return execution

    async def close(self) -> None:
        """Kill all workers; work that was not awaited is lost."""
        self._closing.set()
        for execution in tuple(self._executions):
            execution.kill()
        for each in tuple(self._workers):
            each.kill()
        await asyncio.gather(*self._keepers)

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
        slot = _Worker(self._log_level)
        self._workers.add(slot)
        try:
            await asyncio.to_thread(slot.start, self._warm_up, self._environment)
            if not self._closing.is_set():
                self._ready.add(slot)
                self._free.put_nowait(slot)
                on_ready()
                await slot.gone.wait()
                if not self._closing.is_set():
                    _log.warning("a worker is gone and is replaced", extra={"worker_pid": slot.pid})
        except Exception:
            if not self._closing.is_set():
                _log.exception("a worker could not be started; there will be another try")
            return False
        else:
            return True
        finally:
            self._ready.discard(slot)
            slot.kill()
            await asyncio.to_thread(slot.discard)
            self._workers.discard(slot)


class _Worker:
    """A worker process as its parent sees it: pool, progress pipe, control block."""

    def __init__(self, log_level: str | None) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, self._their_end = context.Pipe(duplex=False)
        self.control: MutableSequence[float] = cast(
            "MutableSequence[float]", context.RawArray(ctypes.c_double, new_control())
        )
        initialize = partial(worker.initialize, self._their_end, self.control, log_level)
        self.pool = ProcessPoolExecutor(1, mp_context=context, initializer=initialize)
        self.pid: int | None = None
        self.gone = asyncio.Event()
        self._serial = 0
        self._on_progress: Callable[[Progress], None] | None = None
        self._newest: Progress | None = None
        self._doomed = False
        self._loop = asyncio.get_running_loop()
        self._reader = threading.Thread(target=self._read, name="worker-progress", daemon=True)

    def start(self, warm_up: Callable[[], int], environment: Mapping[str, str]) -> None:
        """Start the process and wait until it is warm; blocks."""
        with _environment(environment):
            pid = self.pool.submit(os.getpid)
        # Once only the worker has the other end, the pipe closes when the worker dies.
        self._their_end.close()
        self._reader.start()
        self.pid = pid.result()
        if self._doomed:
            self.kill()
        self.pool.submit(warm_up).result()

    def begin(self, serial: int, on_progress: Callable[[Progress], None]) -> None:
        """Route the progress of the work with this serial number."""
        self._serial, self._on_progress, self._newest = serial, on_progress, None

    def end(self, last: Progress | None) -> None:
        """Deliver the last progress if it did not come through the pipe, and no other after it."""
        if last is not None and last != self._newest and self._on_progress is not None:
            self._on_progress(last)
        self._on_progress = None

    def kill(self) -> None:
        """Kill the process, now or as soon as it has one."""
        self._doomed = True
        if self.pid is not None and not self.gone.is_set():
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

    def discard(self) -> None:
        """Wait for the end of a process that was killed or has died; blocks."""
        self.pool.shutdown(wait=True)
        self._their_end.close()
        if self._reader.is_alive():
            self._reader.join()
        self._pipe.close()

    def _read(self) -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                serial, progress = self._pipe.recv()
                self._call(self._deliver, serial, progress)
        self._call(self.gone.set)

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the loop was closed without closing the executor
            self._loop.call_soon_threadsafe(function, *arguments)

    def _deliver(self, serial: int, progress: Progress) -> None:
        if serial == self._serial and self._on_progress is not None:
            self._newest = progress
            self._on_progress(progress)


class _LocalExecution:
    """One piece of work, from waiting for a worker to its outcome."""

    def __init__(
        self,
        free: asyncio.Queue[_Worker],
        run: Callable[[int], worker.Ended],
        time_left_s: float | None,
        on_progress: Callable[[Progress], None],
    ) -> None:
        self._free = free
        self._run_with = run
        self._deadline = math.inf if time_left_s is None else time.monotonic() + time_left_s
        self._on_progress = on_progress
        self._cancelled = False
        self._worker: _Worker | None = None
        self.task = asyncio.create_task(self._run())

    async def outcome(self) -> Outcome:
        """Wait until the work has ended."""
        try:
            return await asyncio.shield(self.task)
        except asyncio.CancelledError:
            if self.task.cancelled():
                return Lost("it was stopped before a worker was free")
            raise

    def cancel(self) -> None:
        """Raise the flag that the work polls."""
        self._cancelled = True
        if self._worker is not None:
            self._worker.control[CANCEL] = 1.0

    def kill(self) -> None:
        """Kill the worker, or give up waiting for one."""
        if self._worker is not None:
            self._worker.kill()
        else:
            self.task.cancel()

    async def _run(self) -> Outcome:
        while True:
            slot = await self._free.get()
            if slot.gone.is_set():
                continue
            serial = next(_serials)
            slot.control[CANCEL] = float(self._cancelled)
            slot.control[DEADLINE] = self._deadline
            slot.begin(serial, self._on_progress)
            try:
                future = slot.pool.submit(self._run_with, serial)
            except RuntimeError:
                continue  # it died while it was idle: its slot brings another
            self._worker = slot
            try:
                ended = await asyncio.wrap_future(future)
            except BrokenProcessPool:
                slot.end(None)
                return Lost(f"worker process {slot.pid} died")
            except Exception as error:
                outcome: Outcome = Raised(describe(error), traceback.format_exc())
                slot.end(None)
            else:
                outcome = ended.outcome
                slot.end(ended.progress)
            finally:
                self._worker = None
            self._free.put_nowait(slot)
            return outcome


@contextlib.contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set variables for the process that is spawned inside; it inherits this process's."""
    with _spawning:
        before = {name: os.environ.get(name) for name in variables}
        os.environ.update(variables)
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value
