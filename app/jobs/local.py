"""Work on this machine: slots, each a process pool of one worker.

One worker a pool, because a pool of several fails everybody's work when one of them dies. A worker that dies,
busy or idle, is noticed at once, because its end of the progress pipe closes with it, and its slot gets a new
one.

Workers are forked from one process, multiprocessing's fork server, which has loaded what all need: they share
that memory, and one that replaces another has it at once. What is loaded there must leave no thread behind,
because a forked process has none but its first. Without something to load, and on other systems than Linux,
workers are spawned.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import itertools
import multiprocessing
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping, MutableSequence
from concurrent.futures import Future, InvalidStateError, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from multiprocessing import forkserver
from multiprocessing.context import BaseContext
from typing import Any, cast

from app.jobs import worker
from app.jobs.errors import describe
from app.jobs.executor import Executor, Lost, Outcome, Raised, Work
from app.jobs.model import Progress
from app.jobs.work_context import CANCEL, DEADLINE, SHARE, new_control

_spawning = threading.Lock()
_serials = itertools.count(1)


class LocalExecutor(Executor):
    """Runs work in processes of this machine, which log to their standard error.

    Parameters
    ----------
    slots, options
        See :class:`app.jobs.executor.Executor`.
    preload
        Module that loads what all workers need as it is imported. All executors of a process share one fork
        server: it loads what the first of them names, in the environment of the first.
    """

    def __init__(self, slots: int, *, preload: str | None = None, **options: Any) -> None:
        super().__init__(slots, **options)
        self._preload = preload if sys.platform == "linux" else None

    def _new_worker(self) -> _Worker:
        warm_up = partial(worker.warm_up, *self._warm_up)
        return _Worker(self._preload, self._log_level, warm_up, self._environment)


class _Worker:
    """A worker process as its parent sees it: pool, progress pipe, control block."""

    def __init__(
        self,
        preload: str | None,
        log_level: str | None,
        warm_up: Callable[[], int],
        environment: Mapping[str, str],
    ) -> None:
        self._warm_up, self._forked = warm_up, preload is not None
        context: BaseContext = multiprocessing.get_context("forkserver" if self._forked else "spawn")
        if preload is not None:
            forkserver.set_forkserver_preload([preload])
            environment = {**environment, **_same_modules()}
        self._environment = environment
        self._pipe, self._their_end = context.Pipe(duplex=False)
        self.control: MutableSequence[float] = cast(
            "MutableSequence[float]", context.RawArray(ctypes.c_double, new_control())
        )
        initialize = partial(worker.initialize, self._their_end, self.control, log_level, environment)
        self.pool = ProcessPoolExecutor(1, mp_context=context, initializer=initialize)
        self.pid: int | None = None
        self.gone = asyncio.Event()
        self._serial = 0
        self._on_progress: Callable[[Progress], None] | None = None
        self._newest: Progress | None = None
        self._started: Future[Future[int]] = Future()
        self._doomed = self._given_up = False
        self._loop = asyncio.get_running_loop()
        self._reader = threading.Thread(target=self._read, name="worker-progress", daemon=True)

    @property
    def name(self) -> str:
        """Its process."""
        return str(self.pid)

    async def warm_up(self) -> None:
        """Start the process and wait until it is warm."""
        # A thread of its own: a fork server answers only when it has loaded, and requests need the others.
        threading.Thread(target=self._start, name="worker-start", daemon=True).start()
        starting = await asyncio.wrap_future(self._started)
        self.pid = await asyncio.wrap_future(starting)
        if self._doomed:
            self.kill()
        await asyncio.wrap_future(self.pool.submit(self._warm_up))

    async def stay(self) -> None:
        """Wait until the process is gone."""
        await self.gone.wait()

    def _start(self) -> None:
        try:
            if self._forked:
                with _environment(self._environment):
                    forkserver.ensure_running()
                pid = self.pool.submit(os.getpid)
            else:
                with _environment(self._environment):
                    pid = self.pool.submit(os.getpid)
            # Once only the worker has the other end, the pipe closes when the worker dies.
            self._their_end.close()
            self._reader.start()
        except Exception as error:  # whatever it is, it is raised where the start is waited for
            with contextlib.suppress(InvalidStateError):
                self._started.set_exception(error)
            return
        try:
            self._started.set_result(pid)
        except InvalidStateError:
            # Nobody waits for it any more.
            self._clear_away()

    async def run(self, work: Work, cancelled: bool) -> Outcome | None:
        """Do one piece of work; None if the process died idle: its slot brings another."""
        if self.gone.is_set():
            return None
        self._serial, self._on_progress, self._newest = next(_serials), work.on_progress, None
        self.control[CANCEL], self.control[DEADLINE] = float(cancelled), work.deadline
        try:
            future = self.pool.submit(worker.run, work.labels, work.function, work.payload, self._serial)
        except RuntimeError:
            return None
        try:
            ended = await asyncio.wrap_future(future)
            # The last progress may not have come through the pipe; no other comes after it.
            if ended.progress is not None and ended.progress != self._newest:
                work.on_progress(ended.progress)
        except BrokenProcessPool:
            return Lost(f"worker process {self.pid} died")
        except Exception as error:
            return Raised(describe(error), traceback.format_exc())
        finally:
            self._on_progress = None
        return ended.outcome

    def cancel(self) -> None:
        """Raise the flag that the work polls."""
        self.control[CANCEL] = 1.0

    def share(self, workers: float) -> None:
        """Tell the work how many workers' cores it may use."""
        self.control[SHARE] = workers

    def kill(self) -> None:
        """Kill the process, now or as soon as it has one; nobody waits for one that has to be forked yet."""
        self._doomed = True
        if self._forked:
            with contextlib.suppress(InvalidStateError):
                self._started.set_exception(ChildProcessError("closed before it was forked"))
                self._given_up = True
        if self.pid is not None and not self.gone.is_set():
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

    async def discard(self) -> None:
        """Kill the process and wait for its end."""
        self.kill()
        if not self._given_up:
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


def _same_modules() -> dict[str, str]:
    """Return the variables by which a fork server finds modules where this process does, and nowhere else."""
    return {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(sys.path)}


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
