"""How adventurously a policy plays while it learns one problem.

Imitation makes it ever surer of the best plan there is. So that it goes on looking, its actions are drawn at
a temperature that rises while episodes repeat what is known, and falls while they do not.
"""

from __future__ import annotations

from app.simulation.arrays import Integers, ProblemArrays
from app.simulation.evaluation import rewards_of

_REPEATED = 0.2
"""Share of episodes as good as the best plan above which it gets warmer; with none of them it cools."""

_EQUAL = 1e-9
"""Relative difference of rewards that is none."""

_WARMER = 1.15
_HOTTEST = 50.0


class Temperature:
    """Begins at 1, and is never below.

    Parameters
    ----------
    arrays
        A stack of one problem.
    """

    def __init__(self, arrays: ProblemArrays) -> None:
        self._arrays = arrays
        self.value = 1.0

    def follow(self, plans: Integers, known: float) -> None:
        """Change after episodes.

        Parameters
        ----------
        plans
            (B, S, M) what they did.
        known
            Reward of the best plan before them.
        """
        repeated = (rewards_of(self._arrays, plans).reward >= known - _EQUAL * abs(known)).mean()
        if repeated == 0.0:
            self.value = max(1.0, self.value / _WARMER)
        elif repeated > _REPEATED:
            self.value = min(_HOTTEST, self.value * _WARMER)
