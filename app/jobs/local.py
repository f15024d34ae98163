"""Work on this machine: slots, each a process with a pipe of its own.

Work goes through the pipe to the process, and what it sends comes back in its order: progress, then the
outcome. A worker that dies, busy or idle, is noticed at once, because its end of the pipe closes with it, and
its slot gets a new one.

Workers are forked from one process, multiprocessing's fork server, which has loaded what all need: they share
that memory, and one that replaces another has it at once. What is loaded there must leave no thread behind,
because a forked process has none but its first. Without something to load, and on other systems than Linux,
workers are spawned.
"""

from __future__ import annotations

import asyncio
import atexit
import contextlib
import ctypes
import multiprocessing
import os
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping, MutableSequence
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext, SpawnContext
from typing import Any, cast

from app.jobs import worker
from app.jobs.errors import describe
from app.jobs.executor import Executor, Lost, Message, Outcome, Raised, Work
from app.jobs.model import Progress
from app.jobs.worker import CANCEL, DEADLINE, HELD, SHARE, new_control

_starting = threading.Lock()


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
        if self._preload is None:
            return _Worker(multiprocessing.get_context("spawn"), self._log_level, self._environment)
        forkserver.set_forkserver_preload([self._preload])
        context = multiprocessing.get_context("forkserver")
        # It finds modules where this process does, and nowhere else.
        modules = {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
        return _Worker(context, self._log_level, self._environment | modules)


class _Worker:
    """A worker process as its parent sees it: process, pipe, control block.

    Parameters
    ----------
    context
        How the process is made.
    log_level, environment
        As :func:`app.jobs.worker.main` takes them.
    """

    def __init__(
        self, context: SpawnContext | ForkServerContext, log_level: str | None, environment: Mapping[str, str]
    ) -> None:
        self._pipe, theirs = context.Pipe()
        self._control = cast("MutableSequence[float]", context.RawArray(ctypes.c_double, new_control()))
        arguments = theirs, self._control, log_level, environment
        self._process = context.Process(target=worker.main, args=arguments)
        self._forked = isinstance(context, ForkServerContext)
        # Not one of those that requests need: a large payload takes a while.
        self._sender = ThreadPoolExecutor(1, "worker-send")
        self._loop = asyncio.get_running_loop()
        self._gone = asyncio.Event()
        self._doomed = False
        self._on_progress: Callable[[Progress], None] | None = None
        self._outcome: asyncio.Future[Outcome] = self._loop.create_future()
        # Multiprocessing waits at the end of this process for those that it has made.
        atexit.register(self.kill)
        # A thread of its own: a fork server answers only when it has loaded, and requests need the others.
        threading.Thread(None, self._live, "worker-start", (theirs, environment), daemon=True).start()

    @property
    def name(self) -> str:
        """Its process."""
        return str(self._process.pid)

    async def stay(self) -> None:
        """Wait until the process is gone."""
        await self._gone.wait()

    async def run(self, work: Work, cancelled: bool) -> Outcome | None:
        """Do one piece of work; None if the process died idle: its slot brings another."""
        if self._gone.is_set():
            return None
        self._on_progress, self._outcome = work.on_progress, self._loop.create_future()
        self._control[CANCEL], self._control[DEADLINE] = float(cancelled), work.deadline
        self._control[HELD] = 0.0
        call = work.labels, work.function, work.payload
        try:
            await self._loop.run_in_executor(self._sender, self._pipe.send, call)
        except OSError:
            return Lost("it was ended before it began", begun=False) if self._doomed else None
        except Exception as error:  # what was to be sent cannot be pickled
            return Raised(describe(error), traceback.format_exc())
        return await self._outcome

    def cancel(self) -> None:
        """Raise the flag that the work polls."""
        self._control[CANCEL] = 1.0

    def share(self, workers: float) -> None:
        """Tell the work how many workers' cores it may use."""
        self._control[SHARE] = workers

    def is_held(self) -> bool:
        """Whether the work is at something that ends by itself."""
        return self._control[HELD] != 0.0

    def kill(self) -> None:
        """Kill the process, now or as soon as it has been made."""
        self._doomed = True
        if self._process.pid is not None:
            self._process.kill()

    async def discard(self) -> None:
        """Kill the process and wait for its end; nobody waits for one that has to be forked yet."""
        self.kill()
        if self._process.pid is not None or not self._forked:
            await self._gone.wait()

    def _live(self, theirs: Connection, environment: Mapping[str, str]) -> None:
        """Start the process, hand on what it sends, and stay until it has ended."""
        try:
            with _environment(environment):
                self._process.start()
        except Exception as error:  # whatever it is, the slot has sent its first work, and learns of it
            self._call(self._hear, Raised(describe(error), traceback.format_exc()))
        else:
            # Once only the worker has the other end, the pipe closes when the worker dies.
            theirs.close()
            if self._doomed:
                self.kill()
            # One that sends what cannot be read is no better than a dead one.
            with contextlib.suppress(Exception):
                while True:
                    self._call(self._hear, self._pipe.recv())
            self._process.kill()
            self._process.join()
        atexit.unregister(self.kill)
        self._call(self._end)

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the loop was closed without closing the executor
            self._loop.call_soon_threadsafe(function, *arguments)

    def _hear(self, message: Message) -> None:
        if isinstance(message, Progress):
            if self._on_progress is not None:
                self._on_progress(message)
        elif not self._outcome.done():
            self._on_progress = None
            self._outcome.set_result(message)

    def _end(self) -> None:
        self._gone.set()
        self._sender.shutdown(wait=False)
        if not self._outcome.done():
            self._outcome.set_result(Lost(f"worker process {self.name} died"))


@contextlib.contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set variables for the process that is made inside; it inherits this process's."""
    with _starting:
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
