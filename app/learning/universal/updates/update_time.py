"""How long an update takes, so that none is begun for which a time limit leaves no time.

An update cannot be interrupted but between its parts. What the last one took is the best guess of the next;
of the first, a rate that most machines surpass.
"""

from __future__ import annotations

from app.learning.universal.network.architecture import UniversalConfig
from app.simulation.arrays import ProblemArrays

_RATE = 2.5e9
"""Multiplications a second before any is measured."""

_FIXED = 5e7
"""Multiplications that could be made while torch is called for an update of nothing."""

_RIVAL_WIDTHS = 12
"""Multiplications for a target and rival, in widths; most of its time goes to memory."""


class UpdateTime:
    """Expects of updates on one problem what the ones before took.

    Parameters
    ----------
    arrays
        A stack of the problem.
    config
        Of the policy that learns.
    """

    def __init__(self, arrays: ProblemArrays, config: UniversalConfig) -> None:
        m, n, _ = arrays.shape
        width, tokens = config.width, n + 1
        layer = tokens * (8 * width**2 + 2 * tokens * width)
        self._turn = config.layers * layer + tokens * 6 * width**2 + n * m * _RIVAL_WIDTHS * width
        self._rate = {True: _RATE, False: _RATE}

    def expected(self, turns: int, *, bootstrap: bool) -> float:
        """Return the seconds that an update on so many turns will take."""
        return self._work(turns, bootstrap) / self._rate[bootstrap]

    def took(self, turns: int, seconds: float, *, bootstrap: bool) -> None:
        """Note what one took, in seconds."""
        self._rate[bootstrap] = self._work(turns, bootstrap) / max(seconds, 1e-9)

    def _work(self, turns: int, bootstrap: bool) -> float:
        # Forward once and backward at twice that; with bootstrapping the target network too.
        return _FIXED + (4 if bootstrap else 3) * turns * self._turn
