"""The worker's side: what runs in a process that does work, on this machine or on another.

A work function gets a :class:`WorkContext`, by which it reports progress and sees that it should stop.

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
from app.logs import configure_worker_logs, labelled
from app.memory import give_back

REPORT_INTERVAL_S = 0.05

Finish = Callable[[Returned | Raised], None]

CANCEL, DEADLINE, SHARE, HELD = 0, 1, 2, 3


def new_control() -> list[float]:
    """Return a control block that nobody else sees: not cancelled, no deadline, the share of one worker."""
    return [0.0, math.inf, 1.0, 0.0]


class WorkContext:
    """Handed to a work function beside its payload.

    A work function polls :meth:`cancelled` and :meth:`time_left` between short pieces of work, and returns
    the best it has as soon as one of them says stop. One that goes on regardless is killed.

    Parameters
    ----------
    report
        Called with every progress. It must be quick, the worker's own only takes a note.
    control
        Numbers that another process sees and may change while the work runs: non-zero once the job is
        cancelled; the deadline on the monotonic clock, which all processes of a machine share (infinite for
        none); how many workers' cores it may use, its own and those of workers that do nothing; and non-zero
        while the work is held. Asking reads shared memory and takes well under a microsecond.
    """

    def __init__(
        self, report: Callable[[Progress], None], control: MutableSequence[float] | None = None
    ) -> None:
        self._report = report
        self._control = new_control() if control is None else control

    @classmethod
    def in_process(cls, report: Callable[[Progress], None], time_limit_s: float | None = None) -> WorkContext:
        """Return the context of work that is done by this process, without a job."""
        control = new_control()
        if time_limit_s is not None:
            control[DEADLINE] = time.monotonic() + time_limit_s
        return cls(report, control)

    def end_within(self, limit_s: float) -> None:
        """Let the time be up in so many seconds, if it is not before."""
        self._control[DEADLINE] = min(self._control[DEADLINE], time.monotonic() + limit_s)

    def report(self, progress: Progress) -> None:
        """Tell how far the work is; may be called as often as there is news."""
        self._report(progress)

    def cancel(self) -> None:
        """Ask the work to stop."""
        self._control[CANCEL] = 1.0

    def hold(self, held: bool) -> None:
        """Say whether something holds the work that cannot stop but ends by itself: it is not killed then."""
        self._control[HELD] = float(held)

    def cancelled(self) -> bool:
        """Say whether somebody asked the work to stop."""
        return self._control[CANCEL] != 0.0

    def share(self) -> int:
        """Return how many workers' cores the work may use now, at least 1."""
        return int(self._control[SHARE])

    def time_left(self) -> float | None:
        """Return the seconds that are left, zero or less when time is up; None without a time limit."""
        deadline = self._control[DEADLINE]
        return None if math.isinf(deadline) else deadline - time.monotonic()


class Reporter:
    """Sends the newest progress of work, at most one every ``REPORT_INTERVAL_S``, and then its outcome.

    The sending is a thread's, so that the work never waits for the reader, and so that the newest progress
    goes out in time even if the work reports nothing after it for long.

    Parameters
    ----------
    send
        Brings a message to the executor; one thread at a time calls it.
    """

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send
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
            time.sleep(REPORT_INTERVAL_S)

    def _send_newest(self) -> None:
        if self._unsent:
            self._send(clean(self._unsent.pop()))


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


def main(
    pipe: Connection, control: MutableSequence[float], log_level: str | None, environment: Mapping[str, str]
) -> None:
    """Be a worker of this machine: it dies with its parent, and leaves Ctrl-C to it.

    Parameters
    ----------
    pipe
        Where work comes from, and messages about it go to.
    control
        Shared with the parent, see :class:`WorkContext`.
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
    reporter = Reporter(pipe.send)
    context = WorkContext(reporter.report, control)
    with contextlib.suppress(EOFError, OSError):  # the parent has gone
        while True:
            labels, work, payload = pipe.recv()
            perform(labels, work, payload, context, reporter.finish)


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        # No clean-up: what this process would write on its way out, nobody is there to read.
        os._exit(1)


def perform(
    labels: dict[str, str], work: str, payload: Mapping[str, Any], context: WorkContext, finish: Finish
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
    finish
        Gets what comes of it, and why where that cannot be sent.
    """
    try:
        with labelled(labels):
            result = resolve(work)(payload, context)
        # A result that is no JSON must fail here, with a traceback, and not when it is stored.
        finish(Returned(replace(result, result=written(result.result))))
    except BaseException as error:
        finish(Raised(describe(error), traceback.format_exc()))


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
