"""A plan: the paper's assignment vectors, one a decision step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Actions = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Plan:
    """A list of joint actions ``[x_1 … x_M]``, ``x_i`` in 0..N+D.

    Those below N are visits, N sends UAV i home, and N + 1 + d sends it to base d, to reload.

    Attributes
    ----------
    assignment
        One tuple of M actions a step; at least one step.
    """

    assignment: tuple[tuple[int, ...], ...]

    @classmethod
    def of(cls, actions: Actions | Sequence[Sequence[int]], home: int) -> Plan:
        """Make a plan out of actions, without the rows at the end in which every UAV is home.

        Parameters
        ----------
        actions
            Shape (S, M), S at least 1.
        home
            The action that sends a UAV home, N.
        """
        rows = [tuple(int(action) for action in row) for row in actions]
        while len(rows) > 1 and all(action == home for action in rows[-1]):
            rows.pop()
        return cls(tuple(rows))

    @classmethod
    def empty(cls, n_uavs: int, n_targets: int) -> Plan:
        """Make the plan that sends everybody home: one row, reward 0 or less."""
        return cls(((n_targets,) * n_uavs,))

    def as_array(self) -> Actions:
        """Return the actions, shape (S, M)."""
        return np.array(self.assignment, dtype=np.int64)
