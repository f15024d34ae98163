"""How long an answer takes once its plan is found: what a time limit must keep back from the search.

It depends on the problem's size, on the machine, and on how busy that is; so it is measured with every answer
that this process writes down, beginning with its warm-up, and never guessed.
"""

from __future__ import annotations

from collections import deque

from app.domain.problem import Problem

_FIXED_S = 0.015
"""Back to the service, onto the disk and out: what a small answer takes beside its explanation."""

_WHOLE_ANSWER = 2.5
"""Time of a large answer from plan to socket, in times of its explanation: stored and sent as JSON, it is
read and written four times. An estimate, not measured as a whole."""

_LARGEST_SHARE = 0.25
"""Of a short time limit the search keeps most, and the answer is late by what it takes."""

_REMEMBERED = 16


class AnswerTime:
    """Expects of the next answer what the slowest of the last ones took, for its size."""

    def __init__(self) -> None:
        self._seconds_a_unit: deque[float] = deque(maxlen=_REMEMBERED)

    def took(self, problem: Problem, seconds: float) -> None:
        """Note how long it took to explain a plan of a problem."""
        self._seconds_a_unit.append(seconds / _units(problem))

    def forget(self) -> None:
        """Begin anew: what was measured first had something to load."""
        self._seconds_a_unit.clear()

    def expected(self, problem: Problem) -> float:
        """Return the seconds from a plan to the client, for a problem of this size."""
        return _FIXED_S + _WHOLE_ANSWER * max(self._seconds_a_unit, default=0.0) * _units(problem)

    def kept_back(self, problem: Problem, left_s: float) -> float:
        """Return the seconds before the end of the time limit at which the search should stop.

        Parameters
        ----------
        problem
            The problem.
        left_s
            Seconds until the limit; negative where it has passed.
        """
        return max(0.0, min(_LARGEST_SHARE * left_s, self.expected(problem)))


def _units(problem: Problem) -> float:
    """Return the size of an answer: stops there may be, areas, and pairs, of which a thousand count as one.

    The sizes of small problems count for more than they are, so that one that was slow by accident does not
    make all large ones look slow.
    """
    visits = min(problem.n_uavs * problem.max_steps, 4 * problem.n_targets)
    return max(300.0, visits + problem.n_targets + problem.n_uavs * problem.n_targets / 1000)
