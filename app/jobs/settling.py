"""What becomes of a job in the table when its work has ended, one way or the other."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from app.jobs.executor import Outcome, Raised, Returned
from app.jobs.failure import INTERNAL_ERROR, describe, failure
from app.jobs.model import Job, JobKind
from app.jobs.run import Run
from app.jobs.store import JobStore
from app.jobs.writer import Writer

_log = logging.getLogger(__name__)


class Settling:
    """Brings outcomes into the job table.

    Parameters
    ----------
    store, writer
        The job table, and its writer.
    kinds
        The kinds of job by their names.
    grace_s
        How long work may go on after its time limit, for the reason of a job that did longer.
    """

    def __init__(self, store: JobStore, writer: Writer, kinds: Mapping[str, JobKind], grace_s: float) -> None:
        self._store, self._writer = store, writer
        self._kinds, self._grace_s = kinds, grace_s

    async def settle(self, run: Run, outcome: Outcome) -> Job | None:
        """Bring an outcome into the table; None if the job has gone on without this attempt."""
        job, progress, surely = run.job, run.progress, self._writer.write_surely
        if isinstance(outcome, Returned):
            try:
                return await surely(
                    self._store.succeed,
                    job.id,
                    job.attempt,
                    outcome.work,
                    progress,
                    self._kinds[job.kind].on_success,
                    self._kinds[job.kind].follow_up,
                )
            except Exception as exception:
                _log.exception("a job's result could not be stored")
                outcome = Raised(describe(exception), "")
        if isinstance(outcome, Raised):
            if outcome.error["code"] == INTERNAL_ERROR:
                _log.error(
                    "a job failed: %s",
                    outcome.error["detail"],
                    extra={"worker_traceback": outcome.traceback},
                )
            return await surely(self._store.fail, job.id, job.attempt, outcome.error, progress)
        if run.killed_for == "stop":
            return await surely(self._store.release, job.id, job.attempt, progress)
        if run.killed_for == "time":
            if self._kinds[job.kind].at_once is not None and not run.at_once and not run.asked_to_stop:
                # It waits again, with its time up: there is an answer for those.
                return await surely(self._store.release, job.id, job.attempt, progress)
            error = failure(
                "time-limit-exceeded",
                f"the work did not stop within {self._grace_s:g} s after its time was up, and was ended",
            )
            return await surely(self._store.fail, job.id, job.attempt, error, progress)
        _log.warning("attempt %d of a job: %s", job.attempt, outcome.reason)
        return await surely(self._store.lose, job.id, job.attempt, outcome.reason, progress)
