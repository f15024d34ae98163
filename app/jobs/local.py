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
import math
import multiprocessing
import os
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, MutableSequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from types import MappingProxyType
from typing import Any, cast

from app.jobs import worker
from app.jobs.executor import Lost, Outcome, Raised
from app.jobs.failure import describe
from app.jobs.model import Progress
from app.jobs.slots import SlotExecution, SlotExecutor
from app.jobs.work_context import CANCEL, DEADLINE, SHARE, new_control

# The workers share the cores: one that starts threads of its own slows the others down, and itself.
SINGLE_THREADED = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

# Memory that glibc has once got it keeps, up to arrays of 32 MB: to get it again can take longer from the
# system than all the work that is done in it, and what a worker takes stays what its largest job took.
KEEPS_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(32 * 1024**2), "MALLOC_TRIM_THRESHOLD_": str(512 * 1024**2)}

_spawning = threading.Lock()
_serials = itertools.count(1)


class LocalExecutor(SlotExecutor["_Worker"]):
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
    niceness
        By how much warm workers leave the cores to others: the service's own process, which takes requests
        in and sends answers, must not wait for searches that use all there is.
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
        super().__init__(slots)
        self._working: set[_Worker] = set()
        self._warm_up = partial(worker.warm_up, warm_up, niceness, *warm_up_arguments)
        self._environment = dict(environment)
        self._log_level = log_level

    def submit(
        self,
        work: str,
        payload: Mapping[str, Any],
        *,
        time_left_s: float | None,
        on_progress: Callable[[Progress], None],
        labels: Mapping[str, str] = MappingProxyType({}),
    ) -> _LocalExecution:
        """Hand work to the next free worker, see :meth:`app.jobs.executor.Executor.submit`."""
        execution = _LocalExecution(
            self._free,
            partial(worker.run, dict(labels), work, payload),
            time_left_s,
            on_progress,
            self._working,
        )
        self._keep(execution)
        return execution

    def _new_worker(self) -> _Worker:
        return _Worker(self._log_level, self._warm_up, self._environment)


class _Worker:
    """A worker process as its parent sees it: pool, progress pipe, control block."""

    def __init__(
        self, log_level: str | None, warm_up: Callable[[], int], environment: Mapping[str, str]
    ) -> None:
        self._warm_up, self._environment = warm_up, environment
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

    @property
    def name(self) -> str:
        """Its process."""
        return str(self.pid)

    async def warm_up(self) -> None:
        """Start the process and wait until it is warm."""
        # No thread waits for it: all the warm-ups together could keep those that requests need.
        pid = asyncio.wrap_future(await asyncio.to_thread(self._start))
        self.pid = await pid
        if self._doomed:
            self.kill()
        await asyncio.wrap_future(self.pool.submit(self._warm_up))

    async def stay(self) -> None:
        """Wait until the process is gone."""
        await self.gone.wait()

    def _start(self) -> Future[int]:
        with _environment(self._environment):
            pid = self.pool.submit(os.getpid)
        # Once only the worker has the other end, the pipe closes when the worker dies.
        self._their_end.close()
        self._reader.start()
        return pid

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

    async def discard(self) -> None:
        """Kill the process and wait for its end."""
        self.kill()
        await asyncio.to_thread(self._clear_away)

    def _clear_away(self) -> None:
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


class _LocalExecution(SlotExecution[_Worker]):
    """Work in a process of this machine."""

    def __init__(
        self,
        free: asyncio.Queue[_Worker],
        run: Callable[[int], worker.Ended],
        time_left_s: float | None,
        on_progress: Callable[[Progress], None],
        working: set[_Worker],
    ) -> None:
        self._run_with = run
        self._working = working
        self._deadline = math.inf if time_left_s is None else time.monotonic() + time_left_s
        self._on_progress = on_progress
        super().__init__(free)

    def cancel(self) -> None:
        """Raise the flag that the work polls."""
        self._cancelled = True
        if self._worker is not None:
            self._worker.control[CANCEL] = 1.0

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
            self._working.add(slot)
            self._divide()
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
                self._working.discard(slot)
            self._free.put_nowait(slot)
            self._divide()
            return outcome

    def _divide(self) -> None:
        """Tell every worker that works how many workers' cores it may use: with its part of the idle ones."""
        for each in self._working:
            each.control[SHARE] = 1.0 + self._free.qsize() // len(self._working)


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
