"""A job's time limit, divided among search, explanation, bound and the answer's way back."""

from __future__ import annotations

import math

from app.allocation import bounding
from app.allocation.answer_time import BOUND, AnswerSize, AnswerTime, expected_size
from app.domain.problem import Problem
from app.jobs.worker import WorkContext

_PREPARING_SHARE = 0.25
"""A search that is late by more than this share of the time it had has only prepared."""


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

    Attributes
    ----------
    searching
        Ends what an algorithm does.
    standing_in
        Ends the greedy rule where it stands in for an algorithm.
    bounding
        Ends the bound.
    """

    def __init__(
        self, context: WorkContext, times: AnswerTime, problem: Problem, bound_limit_s: float | None
    ) -> None:
        self._context, self._times, self._problem = context, times, problem
        left, size = context.time_left(), expected_size(problem)
        way_back = tracing = reasons = bound = 0.0
        if left is not None:
            way_back, tracing = times.way_back(problem, size), times.tracing(problem, size)
            reasons = times.looking(problem, size, left - way_back - tracing)
            bound = bounding.kept_for_bound(bound_limit_s, left - way_back - tracing - reasons)
        self.bounding = StopInTime(context, way_back)
        self._explaining = StopInTime(context, way_back + bound)
        self.standing_in = StopInTime(context, way_back + tracing)
        self.searching = StopInTime(context, way_back + tracing + reasons + bound)
        self._begun_with = math.inf
        self._nothing_more = False

    def leaves_none_for(self, algorithm: str) -> bool:
        """Say whether an algorithm would not get beyond its preparations; if it does, it begins now."""
        return self._leaves_none(algorithm, self.searching)

    def searched(self, algorithm: str) -> None:
        """Take note that an algorithm has returned."""
        self._returned(algorithm, self.searching)

    def stand_in(self, algorithm: str) -> None:
        """Take note that an algorithm stands in for another, however little time is left."""
        if not math.isinf(self.standing_in.seconds_left()):
            self.standing_in.stop_earlier(self._times.late(algorithm, self._problem))
        self._begun_with = self.standing_in.seconds_left()

    def stood_in(self, algorithm: str) -> None:
        """Take note that it has returned."""
        # Where there was none at the beginning either, only what it took itself.
        late = min(0.0, self._begun_with) - self.standing_in.seconds_left()
        if late > 0 and not self._context.cancelled():
            self._times.stopped(algorithm, self._problem, late)

    def leaves_no_bound(self) -> bool:
        """Say the same of the bound."""
        return self._leaves_none(BOUND, self.bounding)

    def bounded(self) -> None:
        """Take note that the bound has returned."""
        self._returned(BOUND, self.bounding)

    def _leaves_none(self, what: str, stop: StopInTime) -> bool:
        left = stop.seconds_left()
        if stop.enough or left <= 0 or self._times.preparations.are_too_long(what, self._problem, left):
            return True
        late = self._times.late(what, self._problem)
        if late >= left:
            return True
        if not math.isinf(left):
            stop.stop_earlier(late)
        self._begun_with = stop.seconds_left()
        return False

    def _returned(self, what: str, stop: StopInTime) -> None:
        left = stop.seconds_left()
        if math.isinf(left) or self._context.cancelled():
            return
        late = max(0.0, -left)
        if late > _PREPARING_SHARE * self._begun_with:
            self._times.preparations.took(what, self._problem, self._begun_with + late)
            return
        self._times.preparations.ended_in_time(what, self._problem)
        if late > 0:
            self._times.stopped(what, self._problem, late)

    def hurries(self) -> bool:
        """Say whether only the time for the bound and the way back is left; a cancellation does not hurry."""
        return self._nothing_more or self._explaining.seconds_left() <= 0

    def leave_out_what_can_be(self) -> None:
        """Let a search end with its first plan, and neither reasons nor a good bound be looked for."""
        self._nothing_more = True
        self.bounding.enough = True

    def had_a_plan(self) -> None:
        """Take note that the greedy rule has a plan, which a search for planned unloading would improve."""
        self.standing_in.enough = self._nothing_more

    def traced(self, size: AnswerSize) -> None:
        """Take note of how much there is to write down: from now on, that alone is kept."""
        if self._context.time_left() is not None and not self._nothing_more:
            way_back = self._times.way_back(self._problem, size)
            self.bounding = StopInTime(self._context, way_back)


class StopInTime:
    """A :class:`~app.solvers.protocol.StopCriterion` that tells a search how long it has.

    Parameters
    ----------
    context
        Of the job.
    reserve_s
        How long before the job's time is up it stops.

    Attributes
    ----------
    enough
        Whether what there is is enough, however much time is left.
    """

    def __init__(self, context: WorkContext, reserve_s: float) -> None:
        self._context, self._reserve_s = context, reserve_s
        self.enough = False

    def __call__(self) -> bool:
        """See :class:`~app.solvers.protocol.StopCriterion`."""
        return self.enough or self._context.cancelled() or self.seconds_left() <= 0.0

    def seconds_left(self) -> float:
        """Return the seconds until it stops; infinity without a time limit."""
        left = self._context.time_left()
        return math.inf if left is None else left - self._reserve_s

    def stop_earlier(self, by_s: float) -> None:
        """Stop so many seconds before."""
        self._reserve_s += by_s
