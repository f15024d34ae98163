"""A job's time limit, divided among search, bound, explanation and the answer's way back."""

from __future__ import annotations

import math

from app.domain.problem import Problem
from app.jobs import bounding
from app.jobs.answer_time import AnswerTime
from app.jobs.work_context import WorkContext


class TimeLimit:
    """What a job without a time limit has too: then only its cancellation ends anything.

    Parameters
    ----------
    context
        Of the job.
    times
        How long answers take here.
    problem
        The problem.
    bound_limit_s
        How long the bound may take that is asked for beside the plan; None: none is.
    """

    def __init__(
        self, context: WorkContext, times: AnswerTime, problem: Problem, bound_limit_s: float | None
    ) -> None:
        self._context, self._times, self._problem = context, times, problem
        left = context.time_left()
        way_back = kept = 0.0
        if left is not None:
            way_back = times.way_back(problem)
            kept = times.kept_back(problem, left)
            kept += bounding.kept_for_bound(bound_limit_s, left - kept)
        self.searching = _StopInTime(context, kept)
        self.bounding = _StopInTime(context, way_back)

    def leaves_none_for(self, algorithm: str) -> bool:
        """Say whether an algorithm would not get beyond its preparations."""
        left = self.searching.seconds_left()
        return left <= 0 or self._times.is_too_short(algorithm, self._problem, left)

    def searched(self, algorithm: str) -> None:
        """Take note that an algorithm has returned."""
        left = self.searching.seconds_left()
        if left <= 0 and not self._context.cancelled():
            self._times.overran(algorithm, self._problem, -left)

    def hurries(self) -> bool:
        """Say whether only the time for the way back is left."""
        return self.bounding.seconds_left() <= 0


class _StopInTime:
    """A :class:`~app.solvers.protocol.StopCriterion` that tells a search how long it has."""

    def __init__(self, context: WorkContext, reserve: float) -> None:
        self._context, self._reserve = context, reserve

    def __call__(self) -> bool:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        return self._context.cancelled() or self.seconds_left() <= 0.0

    def seconds_left(self) -> float:
        """Return the seconds left but for the reserve; infinity without a time limit."""
        left = self._context.time_left()
        return math.inf if left is None else left - self._reserve
