"""Work on a Ray cluster: slots, each an actor on any of its machines.

The cluster keeps nothing that must last: the job table does. A worker that dies, alone or with its machine,
loses the attempt that it was at, as a worker of this machine does, and its slot gets a new one as soon as the
cluster has a place for it.

Ray is an extra: nothing imports it before an executor starts. On the cluster's side nothing here imports
SQLAlchemy, numpy, numba or torch: what the work needs comes with the work function.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import math
import os
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType, ModuleType
from typing import Any

from app.jobs import worker
from app.jobs.errors import describe
from app.jobs.executor import Executor, Lost, Outcome, Raised, Returned, Work
from app.jobs.model import Progress
from app.jobs.worker import WorkContext
from app.logs import configure_worker_logs

REPORT_INTERVAL_S = 0.5
"""Between two progresses of a job; each is a call over the network."""

OWN_CLUSTER = "local"
"""An address for which a cluster is started on this machine, and ended with the executor."""

_UNHEARD_S = 0.05
"""Of work that has ended by then no progress is sent but the last, which comes with its end."""

_TALK = "talk"
_TALKERS = 4

_serials = itertools.count(1)


class RayExecutor(Executor):
    """Runs work in actors of a Ray cluster.

    Parameters
    ----------
    slots
        How many workers to have. Those for which the cluster has no place start when it grows.
    address
        Of the cluster's head, ``host:port``; this machine must be one of the cluster's. ``"local"`` starts a
        cluster of one machine.
    resources
        What a worker needs of its machine, by the names of Ray; other names than ``CPU`` and ``GPU`` are of
        labels that machines were started with.
    options
        As :class:`app.jobs.executor.Executor` takes them. The log goes to files of the cluster's machines.
    """

    def __init__(
        self,
        slots: int,
        *,
        address: str = OWN_CLUSTER,
        resources: Mapping[str, float] = MappingProxyType({"CPU": 1.0}),
        **options: Any,
    ) -> None:
        super().__init__(slots, **options)
        self._address, self._resources = address, dict(resources)
        self._ray: ModuleType | None = None
        self._connected_here = False

    async def start(self, on_ready: Callable[[], None]) -> None:
        """Connect to the cluster and begin to start the workers; ``on_ready`` is called for each.

        Raises
        ------
        ConnectionError
            If no cluster is found at the address.
        ModuleNotFoundError
            If Ray is not installed.
        """
        # Not in a thread: Ray insists on setting up signals, which only the main thread can.
        with _kept_signals():
            self._ray = self._connect()
        await super().start(on_ready)

    async def close(self) -> None:
        """Kill all workers; work that was not awaited is lost."""
        await super().close()
        if self._ray is not None and self._connected_here:
            await asyncio.to_thread(self._ray.shutdown)

    def _connect(self) -> ModuleType:
        # Nothing here reports to anybody how it is used.
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            import ray  # noqa: PLC0415 - an extra
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError("Ray is not installed: pip install 'uav-allocator[ray]'") from error
        if not ray.is_initialized():
            cpus = math.ceil(self.capacity * self._resources.get("CPU", 0.0))
            own: dict[str, Any] = (
                {"num_cpus": cpus, "include_dashboard": False} if self._address == OWN_CLUSTER else {}
            )
            ray.init(self._address, log_to_driver=False, logging_level=logging.WARNING, **own)
            self._connected_here = True
        return ray

    def _new_worker(self) -> _Worker:
        assert self._ray is not None
        others = {name: amount for name, amount in self._resources.items() if name not in ("CPU", "GPU")}
        actor = self._ray.remote(concurrency_groups={_TALK: _TALKERS})(RayWorker).options(
            num_cpus=self._resources.get("CPU", 0),
            num_gpus=self._resources.get("GPU", 0),
            resources=others,
            max_restarts=0,
            runtime_env={"env_vars": self._environment},
        )
        return _Worker(self._ray, actor.remote(self._log_level))


@contextlib.contextmanager
def _kept_signals() -> Iterator[None]:
    """Give back the handlers of signals that Ray takes over: the server ends by its own."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    kept = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)


class _Worker:
    """A worker actor as the executor sees it."""

    def __init__(self, ray: ModuleType, actor: Any) -> None:
        self._ray, self._actor = ray, actor
        self.name: str = actor._actor_id.hex()[:12]
        self._gone = False
        self._serial = 0
        self._on_progress: Callable[[Progress], None] | None = None
        self._newest: Progress | None = None

    async def stay(self) -> None:
        """Deliver the progress as it comes, until the process is gone."""
        call = self._actor.progress.options(concurrency_group=_TALK, num_returns="streaming")
        with contextlib.suppress(self._ray.exceptions.RayError):
            async for sent in call.remote():
                serial, progress = await sent
                if serial == self._serial and self._on_progress is not None:
                    self._newest = progress
                    self._on_progress(progress)

    async def run(self, work: Work, cancelled: bool) -> Outcome | None:
        """Do one piece of work; None if the actor was gone before."""
        if self._gone:
            return None
        self._serial, self._on_progress, self._newest = next(_serials), work.on_progress, None
        left = None if math.isinf(work.deadline) else work.deadline - time.monotonic()
        call = self._serial, work.labels, work.function, work.payload, left, cancelled
        try:
            progress, outcome = await self._actor.run.remote(*call)
        except Exception as error:
            errors = self._ray.exceptions
            if isinstance(error, errors.RayError) and not isinstance(error, errors.RayTaskError):
                self._gone = True
                return Lost(f"worker {self.name} is gone: {type(error).__name__}")
            # What was to be sent, or what came back, cannot be pickled; the worker is well.
            return Raised(describe(error), traceback.format_exc())
        finally:
            self._on_progress = None
        if progress is not None and progress != self._newest:
            work.on_progress(progress)
        ended: Outcome = outcome
        return ended

    def cancel(self) -> None:
        """Raise the flag that the work polls."""
        self._actor.cancel.options(concurrency_group=_TALK).remote(self._serial)

    def share(self, workers: float) -> None:
        """Do nothing: what is idle may be on another machine."""

    def is_held(self) -> bool:
        """Nothing is known of that."""
        return False

    def kill(self) -> None:
        with contextlib.suppress(Exception):  # it is gone, and maybe the cluster too
            self._ray.kill(self._actor)

    async def discard(self) -> None:
        self._gone = True
        self.kill()


class RayWorker:
    """A worker of the cluster.

    The work is done in one thread, calls about it come in others.

    Parameters
    ----------
    log_level
        What is logged at least; None: as Python does it by itself.
    """

    def __init__(self, log_level: str | None) -> None:
        if log_level is not None:
            configure_worker_logs(log_level)
        self._lock, self._news = threading.Lock(), threading.Event()
        self._context = WorkContext(self._report)
        self._serial = self._cancelled = 0
        self._progress: Progress | None = None

    def progress(self) -> Iterator[tuple[int, Progress]]:
        """Yield the newest progress with the serial of its work, again and again while the process lives."""
        while True:
            self._news.wait()
            time.sleep(_UNHEARD_S)
            self._news.clear()
            serial, progress = self._serial, self._progress
            if progress is not None:
                yield serial, worker.clean(progress)
                time.sleep(REPORT_INTERVAL_S)

    def run(
        self,
        serial: int,
        labels: dict[str, str],
        work: str,
        payload: Mapping[str, Any],
        time_left_s: float | None,
        cancelled: bool,
    ) -> tuple[Progress | None, Returned | Raised]:
        """Do one piece of work, and return its last progress and its outcome.

        Parameters
        ----------
        serial
            Tells this work from others in calls about it.
        labels
            What the lines have that are logged meanwhile.
        work, payload
            ``"module:function"`` and what it gets.
        time_left_s
            Counted from now, so that the clocks of machines need not agree.
        cancelled
            Whether it was to stop before it was sent: calls about it may come here after it has begun.
        """
        context = WorkContext.in_process(self._report, time_left_s)
        with self._lock:
            self._serial, self._context = serial, context
            if cancelled or self._cancelled == serial:
                context.cancel()
        ended: list[Returned | Raised] = []
        worker.perform(labels, work, payload, context, ended.append)
        progress, self._progress = self._progress, None
        return None if progress is None else worker.clean(progress), ended[0]

    def _report(self, progress: Progress) -> None:
        self._progress = progress
        self._news.set()

    def cancel(self, serial: int) -> None:
        """Ask the work to stop; also if it has been sent and not begun."""
        with self._lock:
            self._cancelled = serial
            if self._serial == serial:
                self._context.cancel()
