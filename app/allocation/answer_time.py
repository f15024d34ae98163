"""How long an answer takes beside the search: what a time limit must keep back, and whether to search at all.

It depends on the problem, on the machine, and on how busy that is; so it is measured with every answer
of this process, beginning with its warm-up, and never guessed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from statistics import median_high
from typing import NamedTuple

from app.allocation.preparation import Preparations
from app.domain.problem import Problem

BOUND = "bound"
"""What the bound is called where algorithms are timed."""

_FIXED_S = 0.012
"""Back to the service, onto the disk and out: what a small answer takes beside its being written down."""

_WHOLE_WAY = 8.0
"""Time of a large answer from its last word to the client's socket, in times of its being written down once:
it goes through a pipe, is stored, and is written once more. With 5, answers of 1000 x 2000 were 15 to 107 ms
late on the median of a row."""

_LARGEST_SHARE = 0.25
"""Of the time that is left, at most, that is kept to look for reasons."""

_LEAST_SHARE, _LEAST_S, _MOST_S = 0.05, 0.02, 0.2
"""What is kept at least to look for reasons: a share of the time that is left, within these bounds."""

_LIKELY_UNMET = 0.5
"""Share of the areas that a search may leave with needs; what there is to explain is known only after it."""

_UNLOADED = 2.0
"""Times, in those of tracing, that a search with planned unloading unloads its last plan at best."""

_GROWTH = 1.5
"""Looking for reasons that was not done in the time expected is expected to take this much longer."""

_REMEMBERED = 16


class AnswerSize(NamedTuple):
    """What there is to write down and to explain.

    Attributes
    ----------
    visits
        Stops of all routes.
    unmet
        Areas with needs left.
    """

    visits: int
    unmet: int


def expected_size(problem: Problem) -> AnswerSize:
    """Return what the answer to a problem may be like before a plan of it is known.

    Every visit that unloads greedily uses up a load or meets a need, and areas that nobody visits are unmet.
    """
    m, n = problem.n_uavs, problem.n_targets
    visits = min(m * problem.max_steps, m + 2 * n)
    return AnswerSize(visits, max(int(_LIKELY_UNMET * n) + 1, n - visits))


class AnswerTime:
    """Expects of the next answer what the last ones took, for its size: their median, since on a busy machine
    one of them takes ten times as long now and then, and would leave no time to any search for long.

    Looking for reasons is the exception: what is kept for it costs little search, and where it is too little
    the answer is without reasons; so all but the slowest of the last ones are to fit.

    Attributes
    ----------
    preparations
        What algorithms do before they can be stopped.
    """

    def __init__(self) -> None:
        self.preparations = Preparations()
        self._tracing: dict[tuple[str, bool], deque[float]] = {}
        self._writing: deque[float] = deque(maxlen=_REMEMBERED)
        self._looking: deque[float] = deque(maxlen=_REMEMBERED)
        self._late: dict[tuple[str, str], deque[float]] = {}

    def traced(self, problem: Problem, size: AnswerSize, seconds: float) -> None:
        """Note how long it took to find out what a plan does, without the reasons for what it does not."""
        last = self._tracing.setdefault(_traced_as(problem), deque(maxlen=_REMEMBERED))
        last.append(seconds / _tracing_units(problem, size))

    def looked(self, problem: Problem, size: AnswerSize, seconds: float, finished: bool) -> None:
        """Note how long the reasons for unmet needs took, or that they were not all found in that time."""
        if not size.unmet:
            return
        pace, expected = seconds / _looking_units(problem, size), self._looking_pace()
        if not finished:
            pace = max(expected, _GROWTH * pace)
        self._looking.append(pace)

    def wrote(self, problem: Problem, size: AnswerSize, seconds: float) -> None:
        """Note how long it took to write an answer down."""
        self._writing.append(seconds / _writing_units(problem, size))

    def stopped(self, algorithm: str, problem: Problem, late_s: float) -> None:
        """Note how long after its time a search returned; 0 where it was in time."""
        last = self._late.setdefault((algorithm, problem.objective.unloading), deque(maxlen=_REMEMBERED))
        last.append(late_s / _tracing_units(problem, expected_size(problem)))

    def forget(self) -> None:
        """Begin anew: what was measured first had something to load."""
        for each in (self._tracing, self._writing, self._looking, self._late):
            each.clear()

    def way_back(self, problem: Problem, size: AnswerSize) -> float:
        """Return the seconds from the end of all work on a plan to the client."""
        return _FIXED_S + _WHOLE_WAY * _median(self._writing) * _writing_units(problem, size)

    def tracing(self, problem: Problem, size: AnswerSize) -> float:
        """Return the seconds that it takes to find out what a plan does.

        Where none like this problem was traced yet, those with the other unloading, or without zones, tell.
        """
        unloading, _ = like = _traced_as(problem)
        known = self._tracing.get(like) or self._tracing.get((unloading, False))
        return _median(known or next(iter(self._tracing.values()), ())) * _tracing_units(problem, size)

    def looking(self, problem: Problem, size: AnswerSize, left_s: float) -> float:
        """Return the seconds to keep for the reasons of unmet needs, out of those that are left."""
        least = min(_MOST_S, max(_LEAST_S, _LEAST_SHARE * left_s))
        expected = self._looking_pace() * _looking_units(problem, size)
        return max(0.0, min(_LARGEST_SHARE * left_s, max(least, expected)))

    def late(self, algorithm: str, problem: Problem) -> float:
        """Return the seconds by which an algorithm is expected to stop late.

        With planned unloading it lets every plan be unloaded at best, which is most of what tracing takes.
        """
        known = self._late.get((algorithm, problem.objective.unloading))
        if known:
            return _median(known) * _tracing_units(problem, expected_size(problem))
        planned = problem.objective.unloading == "planned" and algorithm != BOUND
        return _UNLOADED * self.tracing(problem, expected_size(problem)) if planned else 0.0

    def _looking_pace(self) -> float:
        """Return the second slowest of the last paces."""
        return sorted(self._looking)[-2:][0] if self._looking else 0.0


def _median(numbers: Collection[float]) -> float:
    return median_high(numbers) if numbers else 0.0


def _traced_as(problem: Problem) -> tuple[str, bool]:
    """Return what makes tracing slower or quicker beside its size: the unloading, and ways round zones."""
    return problem.objective.unloading, bool(problem.no_fly_zones)


def _tracing_units(problem: Problem, size: AnswerSize) -> float:
    """Return what flying a plan goes through: stops and unmet areas with their amounts, of which 35 take as
    long as the rest of one, pairs of UAV and area, and places for amounts."""
    m, places = problem.n_uavs, problem.n_uavs * problem.max_steps * problem.n_materials
    entries = (size.visits + size.unmet) * (1.0 + problem.n_materials / 35)
    return _at_least(entries + m * problem.n_targets / 1000 + places / 500)


def _looking_units(problem: Problem, size: AnswerSize) -> float:
    """Return what looking for reasons goes through: every pair once, and the plan again for each area."""
    m, n = problem.n_uavs, problem.n_targets
    return _at_least(m * n / 1000 + size.unmet * (1.0 + (size.visits + m + n) / 1000))


def _writing_units(problem: Problem, size: AnswerSize) -> float:
    """Return what an answer lists: stops and unmet areas with their amounts, routes, and joint actions."""
    entries = (size.visits + size.unmet) * (1.0 + problem.n_materials / 50)
    longest = min(problem.max_steps, size.visits)
    return _at_least(entries + problem.n_uavs * (1.0 + longest / 50))


def _at_least(units: float) -> float:
    """Count small problems for more than they are, so that one that was slow by accident does not make all
    large ones look slow."""
    return max(400.0, units)
