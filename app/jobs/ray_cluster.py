"""Work on a Ray cluster: slots, each an actor on any of its machines.

The cluster keeps nothing that must last: the job table does. A worker that dies, alone or with its machine,
loses the attempt that it was at, as a worker of this machine does, and its slot gets a new one as soon as the
cluster has a place for it.

Ray is an extra: nothing imports it before an executor starts.
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

from app.jobs.executor import Lost, Outcome, Raised
from app.jobs.failure import describe
from app.jobs.local import KEEPS_MEMORY, SINGLE_THREADED
from app.jobs.model import Progress
from app.jobs.ray_worker import REPORT_INTERVAL_S, RayWorker
from app.jobs.slots import SlotExecution, SlotExecutor
from app.jobs.worker import Ended

OWN_CLUSTER = "local"
"""An address for which a cluster is started on this machine, and ended with the executor."""

_UNHEARD_S = 0.05
"""Work that has ended by then is not asked for its progress; the last one comes with its end."""

_TALK = "talk"
_TALKERS = 4

_serials = itertools.count(1)


class RayExecutor(SlotExecutor["_Worker"]):
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
    warm_up, warm_up_arguments
        ``"module:function"`` and its arguments, called in every worker before it gets work.
    environment
        Variables of the workers.
    log_level
        What the workers log at least, to the files of the cluster's machines; None leaves Python's own way.
    """

    def __init__(
        self,
        slots: int,
        *,
        address: str = OWN_CLUSTER,
        resources: Mapping[str, float] = MappingProxyType({"CPU": 1.0}),
        warm_up: str | None = None,
        warm_up_arguments: tuple[Any, ...] = (),
        environment: Mapping[str, str] = MappingProxyType(SINGLE_THREADED | KEEPS_MEMORY),
        log_level: str | None = None,
    ) -> None:
        super().__init__(slots)
        self._address = address
        self._resources = dict(resources)
        self._warm_up = warm_up, *warm_up_arguments
        self._environment = dict(environment)
        self._log_level = log_level
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

    def submit(
        self,
        work: str,
        payload: Mapping[str, Any],
        *,
        time_left_s: float | None,
        on_progress: Callable[[Progress], None],
        labels: Mapping[str, str] = MappingProxyType({}),
    ) -> _RayExecution:
        """Hand work to the next free worker, see :meth:`app.jobs.executor.Executor.submit`."""
        deadline = None if time_left_s is None else time.monotonic() + time_left_s
        execution = _RayExecution(self._free, work, payload, deadline, on_progress, dict(labels))
        self._keep(execution)
        return execution

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
            cpus = math.ceil(self._slots * self._resources.get("CPU", 0.0))
            own: dict[str, Any] = (
                {"num_cpus": cpus, "include_dashboard": False} if self._address == OWN_CLUSTER else {}
            )
            ray.init(self._address, log_to_driver=False, logging_level=logging.WARNING, **own)
            self._connected_here = True
        return ray

    def _new_worker(self) -> _Worker:
        assert self._ray is not None
        return _Worker(self._ray, self._resources, self._environment, self._log_level, self._warm_up)


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

    def __init__(
        self,
        ray: ModuleType,
        resources: Mapping[str, float],
        environment: Mapping[str, str],
        log_level: str | None,
        warm_up: tuple[Any, ...],
    ) -> None:
        others = {name: amount for name, amount in resources.items() if name not in ("CPU", "GPU")}
        self._ray = ray
        actor = ray.remote(concurrency_groups={_TALK: _TALKERS})(RayWorker)
        self._actor = actor.options(
            num_cpus=resources.get("CPU", 0),
            num_gpus=resources.get("GPU", 0),
            resources=others,
            max_restarts=0,
            runtime_env={"env_vars": dict(environment)},
        ).remote(log_level)
        self.name: str = self._actor._actor_id.hex()[:12]
        self.gone = False
        self._warm_up = warm_up

    async def warm_up(self) -> None:
        await self._actor.warm_up.remote(*self._warm_up)

    async def stay(self) -> None:
        """Wait until the process is gone."""
        with contextlib.suppress(self._ray.exceptions.RayError):
            await self._actor.stay.options(concurrency_group=_TALK).remote()

    async def run(self, *arguments: Any) -> Ended | Lost:
        try:
            ended: Ended = await self._actor.run.remote(*arguments)
        except self._ray.exceptions.RayTaskError:
            raise  # what came back could not be sent; the worker lives
        except self._ray.exceptions.RayError as error:
            return Lost(f"worker {self.name} is gone: {type(error).__name__}")
        return ended

    async def progress_after(self, serial: int, count: int) -> tuple[int, Progress] | None:
        try:
            call = self._actor.progress_after.options(concurrency_group=_TALK)
            newest: tuple[int, Progress] | None = await call.remote(serial, count)
        except self._ray.exceptions.RayError:
            return None
        return newest

    def cancel(self, serial: int) -> None:
        self._actor.cancel.options(concurrency_group=_TALK).remote(serial)

    def kill(self) -> None:
        with contextlib.suppress(Exception):  # it is gone, and maybe the cluster too
            self._ray.kill(self._actor)

    async def discard(self) -> None:
        self.gone = True
        self.kill()


class _RayExecution(SlotExecution[_Worker]):
    """One piece of work, from waiting for a worker to its outcome."""

    def __init__(
        self,
        free: asyncio.Queue[_Worker],
        work: str,
        payload: Mapping[str, Any],
        deadline: float | None,
        on_progress: Callable[[Progress], None],
        labels: dict[str, str],
    ) -> None:
        self._call = labels, work, payload
        self._deadline = deadline
        self._on_progress = on_progress
        self._newest: Progress | None = None
        self._serial = next(_serials)
        super().__init__(free)

    def cancel(self) -> None:
        """Raise the flag that the work polls."""
        self._cancelled = True
        if self._worker is not None:
            self._worker.cancel(self._serial)

    async def _run(self) -> Outcome:
        slot = await self._free.get()
        while slot.gone:
            slot = await self._free.get()
        self._worker = slot
        left = None if self._deadline is None else self._deadline - time.monotonic()
        listening = asyncio.create_task(self._listen(slot))
        try:
            ended = await slot.run(self._serial, *self._call, left, self._cancelled)
        except Exception as error:
            # What was to be sent, or what came, cannot be pickled; the worker is well.
            ended = Ended(Raised(describe(error), traceback.format_exc()), None)
        finally:
            listening.cancel()
            self._worker = None
        if isinstance(ended, Lost):
            slot.gone = True
            return ended
        if ended.progress is not None and ended.progress != self._newest:
            self._on_progress(ended.progress)
        self._free.put_nowait(slot)
        return ended.outcome

    async def _listen(self, slot: _Worker) -> None:
        """Deliver the progress as it comes, not more often than ``REPORT_INTERVAL_S``."""
        count = 0
        await asyncio.sleep(_UNHEARD_S)
        while (news := await slot.progress_after(self._serial, count)) is not None:
            count, self._newest = news
            self._on_progress(self._newest)
            await asyncio.sleep(REPORT_INTERVAL_S)
