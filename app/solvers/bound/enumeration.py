"""Every plan of a tiny problem, flown action by action: what the best one is, with reloads too.

A part of the plans is left out where even meeting all that is still needed, at no cost, would not beat the
best plan known.
"""

from __future__ import annotations

import math

import numpy as np

from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes, copy_episode
from app.simulation.simulator import act, close, new_episodes, verdict
from app.simulation.visit import ALLOWED
from app.simulation.worth import most_earned_by
from app.solvers.local_search.annealing import ROUNDING
from app.solvers.protocol import StopCriterion

_PIECE = 5_000
"""Actions between two looks at the stop criterion: a few milliseconds."""


_MOST_DIGITS = 14.0
"""Digits that the number of sequences of actions may have: most are not legal, or too bad to go on."""


def is_tiny(arrays: ProblemArrays) -> bool:
    """Whether a problem has so few plans that it is worth trying to fly them all."""
    m, n, _ = arrays.shape
    return int(arrays.max_steps[0]) * m * math.log10(n + 1 + arrays.n_bases) <= _MOST_DIGITS


class Enumeration:
    """All plans of the first problem of a stack, which is tiny, one after the other.

    Parameters
    ----------
    arrays
        The stack.
    reward
        Of a plan that is known; only better ones are found.

    Attributes
    ----------
    complete
        Whether all plans have been looked at.
    tried
        Actions looked at.
    actions
        (S, M) the best plan found, if it is better than the one known; None otherwise.
    """

    def __init__(self, arrays: ProblemArrays, reward: float) -> None:
        steps, m = int(arrays.max_steps[0]), arrays.shape[0]
        self.complete, self.tried = False, 0
        self.actions: Integers | None = None
        self._arrays, self._steps = arrays, steps
        # One episode for the state before each action, one after the last, and one for the end.
        self._episodes = new_episodes(arrays, steps * m + 2)
        self._cursor, self._level = np.zeros(steps * m + 1, np.int64), np.zeros(1, np.int64)
        self._earned = np.zeros(steps * m + 1)
        self._best, self._chosen = np.array([reward]), np.full(steps * m, -1)

    @property
    def reward(self) -> float:
        """Reward of the best plan known."""
        return float(self._best[0])

    def run(self, stop: StopCriterion, most: int) -> None:
        """Go on until all plans have been looked at, `stop` says so, or so many actions have been tried."""
        known = self.reward
        while not self.complete and not stop() and self.tried < most:
            ended = _explore(
                self._arrays, self._episodes, self._cursor, self._level, self._earned, self._best,
                self._chosen, _PIECE,
            )  # fmt: skip
            self.complete = bool(ended)
            self.tried += _PIECE
        if self.reward > known:
            self.actions = self._chosen.reshape(self._steps, -1).copy()


@compiled
def _explore(
    arrays: ProblemArrays,
    episodes: Episodes,
    cursor: Integers,
    level: Integers,
    earned: Floats,
    best: Floats,
    chosen: Integers,
    tries: int,
) -> bool:
    """Try some actions; True once there are none left.

    ``cursor[d]`` is the next action to try as number d of the plan, ``earned[d]`` what those before it earn.
    """
    m, home = arrays.load.shape[1], arrays.need.shape[1]
    actions, slots = home + 1 + arrays.stock.shape[1], chosen.shape[0]
    at = level[0]
    for _ in range(tries):
        if at == slots or all_landed(episodes, at):
            last = slots + 1
            copy_episode(episodes, at, episodes, last)
            reward = earned[at] + close(arrays, episodes, last)
            if reward > best[0] + ROUNDING * abs(best[0]):
                best[0] = reward
                for d in range(slots):
                    chosen[d] = cursor[d] - 1 if d < at else home
            at -= 1
        elif cursor[at] == actions:
            at -= 1
        if at < 0:
            level[0] = 0
            return True
        if cursor[at] == actions:
            continue
        i, action = at % m, cursor[at]
        cursor[at] += 1
        landed = episodes.ret[at, i]
        if action != home and (landed or verdict(arrays, episodes, at, i, action) != ALLOWED):
            continue
        copy_episode(episodes, at, episodes, at + 1)
        earned[at + 1] = earned[at] + act(arrays, episodes, at + 1, i, action)
        if earned[at + 1] + still_possible(arrays, episodes, at + 1) > best[0] + ROUNDING * abs(best[0]):
            at += 1
            cursor[at] = 0
    level[0] = at
    return False


@compiled
def all_landed(episodes: Episodes, b: int) -> bool:
    """Whether every UAV has landed for good."""
    landed = True
    for i in range(episodes.ret.shape[1]):
        landed = landed and bool(episodes.ret[b, i])
    return landed


@compiled
def still_possible(arrays: ProblemArrays, episodes: Episodes, b: int) -> float:
    """Return what meeting all that is still needed would earn at most."""
    most = 0.0
    for j in range(episodes.need.shape[1]):
        need = 0.0
        for k in range(episodes.need.shape[2]):
            need += episodes.need[b, j, k]
        if need > 0.0:
            most += most_earned_by(arrays, 0, j, need)
    return most
