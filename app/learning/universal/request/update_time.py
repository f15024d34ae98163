"""How long an update takes, so that none is begun for which a time limit leaves no time.

An update cannot be interrupted but between its parts. What the last one took is the best guess of the next;
of the first, a rate that most machines surpass.
"""

from __future__ import annotations

from app.learning.pairwise.architecture import PairwiseConfig
from app.simulation.arrays import ProblemArrays

_RATE = 2.5e9
"""Multiplications a second before any is measured."""

_FIXED = 5e7
"""Multiplications that could be made while torch is called for an update of nothing."""

_PAIR_WIDTHS = 120
"""Multiplications for a UAV and a place, in widths; most of its time goes to memory."""


class UpdateTime:
    """Expects of updates on one problem what the ones before took.

    Parameters
    ----------
    arrays
        A stack of the problem.
    config
        Of the policy that learns.
    """

    def __init__(self, arrays: ProblemArrays, config: PairwiseConfig) -> None:
        m, n, _ = arrays.shape
        width, tokens = config.width, m + n + arrays.n_bases
        layer = tokens * (8 * width**2 + 2 * tokens * width)
        self._state = config.layers * layer + tokens * 4 * width**2 + n * m * _PAIR_WIDTHS * width
        self._rate = {True: _RATE, False: _RATE}

    def expected(self, states: int, *, bootstrap: bool) -> float:
        """Return the seconds that an update on so many states will take."""
        return self._work(states, bootstrap) / self._rate[bootstrap]

    def took(self, states: int, seconds: float, *, bootstrap: bool) -> None:
        """Note what one took, in seconds."""
        self._rate[bootstrap] = self._work(states, bootstrap) / max(seconds, 1e-9)

    def _work(self, states: int, bootstrap: bool) -> float:
        # Forward once and backward at twice that; with bootstrapping the target network too.
        return _FIXED + (4 if bootstrap else 3) * states * self._state
