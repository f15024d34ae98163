"""What a work function can do while it works: report progress, and see that it should stop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, MutableSequence

from app.jobs.model import Progress

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
