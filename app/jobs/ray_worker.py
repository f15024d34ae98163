"""The worker's side on a Ray cluster: an actor that does one piece of work at a time.

Nothing here imports SQLAlchemy, numpy, numba or torch: what the work needs comes with the work function. Nor
does it import Ray: the executor makes an actor of :class:`RayWorker`.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from app.jobs import worker
from app.jobs.executor import Raised, Returned
from app.jobs.failure import describe
from app.jobs.model import Progress
from app.jobs.stored_json import written
from app.jobs.work_context import CANCEL, DEADLINE, WorkContext, new_control
from app.jobs.worker import Ended, clean, resolve
from app.logs import configure_worker_logs, labelled

REPORT_INTERVAL_S = 0.5
"""Between two progresses of a job; each is a call over the network."""


class RayWorker:
    """A worker of the cluster.

    The work runs in one thread, calls about it in others; what they share is guarded by a condition.

    Parameters
    ----------
    log_level
        What is logged at least; None: as Python does it by itself.
    """

    def __init__(self, log_level: str | None) -> None:
        if log_level is not None:
            configure_worker_logs(log_level)
        self._changed = threading.Condition()
        self._serial = 0
        self._control = new_control()
        self._latest: Progress | None = None
        self._count = 0
        self._cancelled = 0

    def warm_up(self, hook: str | None, *arguments: Any) -> None:
        """Run the hook that makes the first piece of work as quick as the later ones."""
        worker.warm_up(hook, 0, *arguments)

    def stay(self) -> None:
        """Never return: whoever waits for it learns that this process has died."""
        threading.Event().wait()

    def run(
        self,
        serial: int,
        labels: dict[str, str],
        work: str,
        payload: Mapping[str, Any],
        time_left_s: float | None,
        cancelled: bool,
    ) -> Ended:
        """Do one piece of work. Whatever it raises comes back as a value, so nothing depends on pickling it.

        Parameters
        ----------
        serial
            Tells this work from others in calls about it; it grows.
        labels
            What the lines have that are logged meanwhile.
        work, payload
            ``"module:function"`` and what it gets.
        time_left_s
            Counted from now, so that the clocks of machines need not agree.
        cancelled
            Whether it was to stop before it was sent: calls about it may come here after it has begun.
        """
        control = new_control()
        if time_left_s is not None:
            control[DEADLINE] = time.monotonic() + time_left_s
        with self._changed:
            self._serial, self._control, self._latest, self._count = serial, control, None, 0
            control[CANCEL] = float(cancelled or self._cancelled == serial)

        def report(progress: Progress) -> None:
            with self._changed:
                self._latest = progress
                self._count += 1
                self._changed.notify_all()

        outcome: Returned | Raised
        try:
            with labelled(labels):
                result = resolve(work)(payload, WorkContext(report, control))
            outcome = Returned(replace(result, result=written(result.result)))
        except BaseException as error:
            outcome = Raised(describe(error), traceback.format_exc())
        with self._changed:
            last = self._latest
            self._serial, self._latest = -serial, None
            self._changed.notify_all()
        return Ended(outcome, None if last is None else clean(last))

    def progress_after(self, serial: int, count: int) -> tuple[int, Progress] | None:
        """Wait until the work has reported more than ``count`` times; None once it has ended.

        It may be called before the work has come here.
        """

        def has_news() -> bool:
            ended = self._serial == -serial or abs(self._serial) > serial
            return ended or (self._serial == serial and self._count > count)

        with self._changed:
            self._changed.wait_for(has_news)
            if self._serial != serial or self._latest is None:
                return None
            return self._count, clean(self._latest)

    def cancel(self, serial: int) -> None:
        """Ask the work to stop; also if it has been sent and not begun."""
        with self._changed:
            self._cancelled = serial
            if self._serial == serial:
                self._control[CANCEL] = 1.0
