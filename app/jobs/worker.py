"""The worker's side: what runs in a process that the local executor has started.

Nothing here imports SQLAlchemy, numpy, numba or torch: what the work needs comes with the work function.
"""

from __future__ import annotations

import gc
import importlib
import math
import multiprocessing
import os
import signal
import threading
import time
import traceback
from collections.abc import Callable, Mapping, MutableSequence
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing.connection import Connection, wait
from types import MappingProxyType
from typing import Any

from app.jobs.errors import describe
from app.jobs.executor import Raised, Returned
from app.jobs.model import Progress
from app.jobs.stored_json import written
from app.jobs.work_context import WorkContext
from app.logs import configure_worker_logs, labelled
from app.memory import give_back

REPORT_INTERVAL_S = 0.05


@dataclass(frozen=True, slots=True)
class Ended:
    """How a piece of work ended, and its last progress, which may not have gone through the pipe."""

    outcome: Returned | Raised
    progress: Progress | None


class _Reporter:
    """Sends the newest progress through the pipe, at most one every ``REPORT_INTERVAL_S``.

    The sending is a thread's, so that the work never waits for the reader, and so that the newest progress
    goes out in time even if the work reports nothing after it for long.
    """

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._lock = threading.Lock()
        self._news = threading.Event()
        self._serial = 0
        self._latest: Progress | None = None
        self._unsent: Progress | None = None
        threading.Thread(target=self._send, name="progress", daemon=True).start()

    def begin(self, serial: int) -> None:
        with self._lock:
            self._serial = serial
            self._latest = self._unsent = None

    def report(self, progress: Progress) -> None:
        with self._lock:
            self._latest = self._unsent = progress
        self._news.set()

    def end(self) -> Progress | None:
        """Stop reporting the work that ends, and return its last progress."""
        with self._lock:
            self._unsent = None
            return None if self._latest is None else clean(self._latest)

    def _send(self) -> None:
        while True:
            self._news.wait()
            self._news.clear()
            with self._lock:
                serial, progress = self._serial, self._unsent
                self._unsent = None
            if progress is None:
                continue
            try:
                self._pipe.send((serial, clean(progress)))
            except OSError:
                return
            time.sleep(REPORT_INTERVAL_S)


def clean(progress: Progress) -> Progress:
    """Return a progress of plain JSON numbers: a reward may be minus infinity until a plan is found."""
    reward = progress.best_reward
    plan = progress.assignment
    return replace(
        progress,
        fraction=min(1.0, max(0.0, float(progress.fraction))),
        epoch=None if progress.epoch is None else int(progress.epoch),
        best_reward=None if reward is None or not math.isfinite(reward) else float(reward),
        assignment=None if plan is None else [[int(action) for action in row] for row in plan],
    )


# A pool's initializer can hand over to its calls only through the module; a worker has exactly one.
_equipment: list[tuple[_Reporter, MutableSequence[float]]] = []


def initialize(
    pipe: Connection,
    control: MutableSequence[float],
    log_level: str | None = None,
    environment: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Prepare this process: it dies with its parent, and leaves Ctrl-C to it.

    Parameters
    ----------
    pipe
        Where progress goes, as pairs of serial number and :class:`Progress`.
    control
        Shared with the parent, see :class:`app.jobs.work_context.WorkContext`.
    log_level
        What is logged at least; None: as Python does it by itself.
    environment
        Variables, for what reads them from now on: a forked process has those of the fork server.
    """
    os.environ.update(environment)
    if log_level is not None:
        configure_worker_logs(log_level)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_die_with_parent, name="parent-watch", daemon=True).start()
    _equipment.append((_Reporter(pipe), control))


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        # No clean-up: what this process would write on its way out, nobody is there to read.
        os._exit(1)


def warm_up(hook: str | None, niceness: int, *arguments: Any) -> int:
    """Make the first piece of work as quick as the later ones.

    Parameters
    ----------
    hook, arguments
        What does so, and what it gets.
    niceness
        By how much the work that comes leaves the cores to others, as the system counts it.

    Returns
    -------
    int
        The process id.
    """
    if hook is not None:
        resolve(hook)(*arguments)
    # What is there now stays: to look through it for garbage would only hold up somebody's work.
    gc.collect()
    gc.freeze()
    give_back()
    os.nice(niceness)
    return os.getpid()


def run(labels: dict[str, str], work: str, payload: Mapping[str, Any], serial: int) -> Ended:
    """Do one piece of work. Whatever it raises comes back as a value, so nothing depends on pickling it.

    Parameters
    ----------
    labels
        What the lines have that are logged meanwhile.
    work, payload
        ``"module:function"`` and what it gets.
    serial
        Tells the progress of this work from that of others.
    """
    reporter, control = _equipment[0]
    reporter.begin(serial)
    outcome = perform(labels, work, payload, WorkContext(reporter.report, control))
    return Ended(outcome, reporter.end())


def perform(
    labels: dict[str, str], work: str, payload: Mapping[str, Any], context: WorkContext
) -> Returned | Raised:
    """Call a work function, see :func:`run`, and return what came of it."""
    try:
        with labelled(labels):
            result = resolve(work)(payload, context)
        # A result that is no JSON must fail here, with a traceback, and not when it is stored.
        return Returned(replace(result, result=written(result.result)))
    except BaseException as error:
        return Raised(describe(error), traceback.format_exc())


@cache
def resolve(dotted: str) -> Callable[..., Any]:
    """Return what ``"module:attribute"`` names."""
    module, _, name = dotted.partition(":")
    found: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return found
