"""The worker's side: what runs in a process that does work, on this machine or on another.

Nothing here imports SQLAlchemy, numpy, numba or torch: what the work needs comes with the work function.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import math
import multiprocessing
import os
import signal
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Mapping, MutableSequence
from dataclasses import replace
from functools import cache
from multiprocessing.connection import Connection, wait
from typing import Any

from app.jobs.errors import describe
from app.jobs.executor import Message, Raised, Returned
from app.jobs.model import Progress, WorkResult
from app.jobs.stored_json import written
from app.jobs.work_context import WorkContext
from app.logs import configure_worker_logs, labelled
from app.memory import give_back

REPORT_INTERVAL_S = 0.05


class Reporter:
    """Sends the newest progress of work, at most one every interval, and after the last one its outcome.

    The sending is a thread's, so that the work never waits for the reader, and so that the newest progress
    goes out in time even if the work reports nothing after it for long.

    Parameters
    ----------
    send
        Brings a message to the executor; one thread at a time calls it.
    interval_s
        Between two progresses.
    """

    def __init__(self, send: Callable[[Message], None], interval_s: float) -> None:
        self._send, self._interval_s = send, interval_s
        self._unsent: deque[Progress] = deque(maxlen=1)
        self._news, self._sending = threading.Event(), threading.Lock()
        threading.Thread(target=self._send_progress, name="progress", daemon=True).start()

    def report(self, progress: Progress) -> None:
        """Take note of progress."""
        self._unsent.append(progress)
        self._news.set()

    def finish(self, outcome: Returned | Raised) -> None:
        """Send what is not sent yet, and the outcome."""
        with self._sending:
            self._send_newest()
            self._send(outcome)

    def _send_progress(self) -> None:
        while True:
            self._news.wait()
            self._news.clear()
            try:
                with self._sending:
                    self._send_newest()
            except OSError:
                return
            time.sleep(self._interval_s)

    def _send_newest(self) -> None:
        if self._unsent:
            self._send(_clean(self._unsent.pop()))


def _clean(progress: Progress) -> Progress:
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


def main(
    pipe: Connection,
    control: MutableSequence[float],
    log_level: str | None,
    environment: Mapping[str, str],
) -> None:
    """Be a worker of this machine: it dies with its parent, and leaves Ctrl-C to it.

    Parameters
    ----------
    pipe
        Where work comes from, and messages about it go to.
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
    reporter = Reporter(pipe.send, REPORT_INTERVAL_S)
    context = WorkContext(reporter.report, control)
    with contextlib.suppress(EOFError, OSError):  # the parent has gone
        while True:
            labels, work, payload = pipe.recv()
            perform(labels, work, payload, context, reporter)


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        # No clean-up: what this process would write on its way out, nobody is there to read.
        os._exit(1)


def perform(
    labels: dict[str, str], work: str, payload: Mapping[str, Any], context: WorkContext, reporter: Reporter
) -> None:
    """Do one piece of work. Whatever it raises is sent as a value, so nothing depends on pickling it.

    Parameters
    ----------
    labels
        What the lines have that are logged meanwhile.
    work, payload
        ``"module:function"`` and what it gets.
    context
        What it gets besides.
    reporter
        Sends what comes of it.
    """
    try:
        with labelled(labels):
            result = resolve(work)(payload, context)
        # A result that is no JSON must fail here, with a traceback, and not when it is stored.
        reporter.finish(Returned(replace(result, result=written(result.result))))
    except BaseException as error:
        reporter.finish(Raised(describe(error), traceback.format_exc()))


def warm_up(payload: Mapping[str, Any], context: WorkContext) -> WorkResult:  # noqa: ARG001 - nothing to report
    """Make the work that comes as quick as what comes later: the first piece of work of every worker.

    Parameters
    ----------
    payload
        ``hook`` does so, and gets the ``arguments``; None: nothing. ``niceness`` is by how much the work that
        comes leaves the cores to others, as the system counts it.
    context
        Of this work.
    """
    if payload["hook"] is not None:
        resolve(payload["hook"])(*payload["arguments"])
    # What is there now stays: to look through it for garbage would only hold up somebody's work.
    gc.collect()
    gc.freeze()
    give_back()
    os.nice(payload["niceness"])
    return WorkResult({})


@cache
def resolve(dotted: str) -> Callable[..., Any]:
    """Return what ``"module:attribute"`` names."""
    module, _, name = dotted.partition(":")
    found: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return found
