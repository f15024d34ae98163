"""What algorithms do before they can be stopped: none begins that cannot end in time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from app.domain.problem import Problem
from app.solvers.registry import ALGORITHMS

_FORGETTING = 0.8
_LEAST_OF_TRIAL = 0.5
"""Share of what the trials say below which nothing is forgotten."""


@dataclass(frozen=True, slots=True)
class _Measured:
    """How long an algorithm took to prepare a problem, and what the problem was like."""

    kind: tuple[str, str]
    log_size: tuple[float, float, float]
    work: float
    seconds: float


class Preparations:
    """Expects of an algorithm what it took for the last problem of the same size.

    For a size that was not met yet it goes by the trial of the size nearest to it, in proportion to the work:
    the trials are made before a worker gets its first job.
    """

    def __init__(self) -> None:
        self._trials: list[_Measured] = []
        self._last: dict[tuple[str, str, int, int, int], float] = {}
        self._once: dict[tuple[str, str, int, int, int], float] = {}

    def tried(self, algorithm: str, problem: Problem, seconds: float) -> None:
        """Note how long an algorithm took that was told to stop from the beginning."""
        self._trials.append(
            _Measured(_kind(algorithm, problem), _log_size(problem), _work(algorithm, problem), seconds)
        )

    def took(self, algorithm: str, problem: Problem, seconds: float) -> None:
        """Note how long an algorithm took that got no further than its preparations in its time.

        Once is an accident, as on a busy machine or where code was loaded: it counts where it happens twice
        running.
        """
        at = _magnitude(algorithm, problem)
        if at in self._last:
            self._last[at] = (self._last[at] + seconds) / 2
        elif at in self._once:
            self._last[at] = min(self._once.pop(at), seconds)
        else:
            self._once[at] = seconds

    def ended_in_time(self, algorithm: str, problem: Problem) -> None:
        """Note that an algorithm got further than its preparations in its time."""
        self._once.pop(_magnitude(algorithm, problem), None)

    def expected(self, algorithm: str, problem: Problem) -> float:
        """Return the seconds that an algorithm needs before it can be stopped."""
        last = self._last.get(_magnitude(algorithm, problem))
        return self._of_trials(algorithm, problem) if last is None else last

    def are_too_long(self, algorithm: str, problem: Problem, left_s: float) -> bool:
        """Say whether an algorithm would only prepare in the seconds that are left to it.

        Each time it says so it expects a little less, so that one that was slow by accident is tried again;
        but not much less than what the trials let expect.
        """
        expected = self.expected(algorithm, problem)
        if left_s > expected:
            return False
        least = _LEAST_OF_TRIAL * self._of_trials(algorithm, problem)
        self._last[_magnitude(algorithm, problem)] = max(least, _FORGETTING * expected)
        return True

    def _of_trials(self, algorithm: str, problem: Problem) -> float:
        name, unloading = _kind(algorithm, problem)
        size, work = _log_size(problem), _work(algorithm, problem)

        def distance(trial: _Measured) -> float:
            apart = sum(abs(a - b) for a, b in zip(trial.log_size, size, strict=True))
            return apart + (trial.kind[1] != unloading)

        trials = [trial for trial in self._trials if trial.kind[0] == name]
        if not trials:
            return 0.0
        nearest = min(trials, key=distance)
        return nearest.seconds * work / nearest.work


def _kind(algorithm: str, problem: Problem) -> tuple[str, str]:
    return algorithm, problem.objective.unloading


def _log_size(problem: Problem) -> tuple[float, float, float]:
    """Return the logarithms of M, N and K to base 2."""
    return math.log2(problem.n_uavs), math.log2(problem.n_targets), math.log2(problem.n_materials)


def _magnitude(algorithm: str, problem: Problem) -> tuple[str, str, int, int, int]:
    """Return the same for problems of which none is much more than twice as large as another."""
    m, n, k = map(int, _log_size(problem))
    return (*_kind(algorithm, problem), m, n, k)


def _work(algorithm: str, problem: Problem) -> float:
    """Return what the preparations are proportional to.

    One that learns plays an episode first, in which every UAV in every step looks at all UAVs and areas, and
    compares all areas with each other once. The others go through all pairs of areas, and of UAV and area.
    """
    m, n = problem.n_uavs, problem.n_targets
    if algorithm in ALGORITHMS and ALGORITHMS[algorithm].learns:
        return problem.max_steps * m * (m + n) + n * n / 10
    return n * (n + m * (1.0 + problem.n_materials / 16))
