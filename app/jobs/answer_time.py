"""How long an answer takes beside the search: what a time limit must keep back, and whether to search at all.

It depends on the problem's size, on the machine, and on how busy that is; so it is measured with every answer
of this process, beginning with its warm-up, and never guessed.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from statistics import median_high

from app.domain.problem import Problem

_FIXED_S = 0.012
"""Back to the service, onto the disk and out: what a small answer takes beside its being written down."""

_WHOLE_WAY = 8.0
"""Time of a large answer from its last word to the client's socket, in times of its being written down once:
it goes through a pipe, is stored, and is written and checked once more. With 5, answers of 1000 x 2000 were
15 to 107 ms late on the median of a row."""

_EXPLAINING_SHARE = 0.25
"""Of a short time limit, at most, that is kept to look for reasons; those not found by then are left out."""

_REMEMBERED = 16
_FORGETTING = 0.8


class AnswerTime:
    """Expects of the next answer what the last ones took, for its size: their median, since on a busy machine
    one of them takes ten times as long now and then, and would leave no time to any search for long.

    Of an algorithm it expects that it returns as late after its time as it lately did: that is what it cannot
    interrupt, mostly its preparations.
    """

    def __init__(self) -> None:
        self._explaining: deque[float] = deque(maxlen=_REMEMBERED)
        self._tracing: deque[float] = deque(maxlen=_REMEMBERED)
        self._writing: deque[float] = deque(maxlen=_REMEMBERED)
        self._overrun: dict[tuple[str, int], float] = {}

    def explained(self, problem: Problem, seconds: float) -> None:
        """Note how long it took to explain a plan of a problem, with all the reasons there are."""
        self._explaining.append(seconds / _units(problem))

    def traced(self, problem: Problem, seconds: float) -> None:
        """Note how long it took to explain one with the reasons alone for which nobody has to look."""
        self._tracing.append(seconds / _units(problem))

    def wrote(self, problem: Problem, seconds: float) -> None:
        """Note how long it took to write an answer down."""
        self._writing.append(seconds / _units(problem))

    def overran(self, algorithm: str, problem: Problem, seconds: float) -> None:
        """Note how long after its time an algorithm returned."""
        at = algorithm, _magnitude(problem)
        self._overrun[at] = (self._overrun.get(at, seconds) + seconds) / 2

    def forget(self) -> None:
        """Begin anew: what was measured first had something to load."""
        self._explaining.clear()
        self._tracing.clear()
        self._writing.clear()
        self._overrun.clear()

    def way_back(self, problem: Problem) -> float:
        """Return the seconds from a plan to the client, without looking for reasons."""
        return _FIXED_S + (_median(self._tracing) + _WHOLE_WAY * _median(self._writing)) * _units(problem)

    def kept_back(self, problem: Problem, left_s: float) -> float:
        """Return the seconds before the end of the time limit at which the search should stop.

        Parameters
        ----------
        problem
            The problem.
        left_s
            Seconds until the limit; negative where it has passed.
        """
        looking = max(0.0, _median(self._explaining) - _median(self._tracing)) * _units(problem)
        return self.way_back(problem) + max(0.0, min(_EXPLAINING_SHARE * left_s, looking))

    def is_too_short(self, algorithm: str, problem: Problem, left_s: float) -> bool:
        """Say whether an algorithm would only prepare in the seconds that are left to it.

        Each time it says so it expects a little less, so that one that was slow by accident is tried again.
        """
        at = algorithm, _magnitude(problem)
        expected = self._overrun.get(at, 0.0)
        if left_s > expected:
            return False
        self._overrun[at] = _FORGETTING * expected
        return True


def _median(seconds: Sequence[float]) -> float:
    return median_high(seconds) if seconds else 0.0


def _units(problem: Problem) -> float:
    """Return the size of an answer: stops there may be, areas, and pairs, of which a thousand count as one.

    The sizes of small problems count for more than they are, so that one that was slow by accident does not
    make all large ones look slow.
    """
    return max(400.0, _size(problem))


def _magnitude(problem: Problem) -> int:
    """Return the same for problems of which none is more than twice as large as another."""
    return int(math.log2(_size(problem)))


def _size(problem: Problem) -> float:
    visits = min(problem.n_uavs * problem.max_steps, 4 * problem.n_targets)
    return visits + problem.n_targets + problem.n_uavs * problem.n_targets / 1000
