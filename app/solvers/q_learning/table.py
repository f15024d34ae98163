"""Episodes of tabular Q-learning: one table for every UAV, of its actions by where it is.

Exploration is semi-random (Zhu and Fang 2021, the paper's [14]): an action is drawn from those that are
allowed, so that no step is lost on one that is not, and half of the time from those that no UAV of this
episode has taken yet.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.compilation import njit
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, close, leg_home, new_episodes, promised, reset_one, verdict
from app.simulation.visit import ALLOWED, START
from app.simulation.worth import cost_of

_NONE = -1


class Learner(NamedTuple):
    """What an episode takes.

    Attributes
    ----------
    arrays
        A stack of one problem.
    episodes
        One episode.
    value
        (M, 1 + N + 1 + D, N + 1 + D) of every action of each UAV, by where it is: first where it begins, then
        the areas, home, and the bases.
    allowed, taken
        (N + 1 + D,) whether an action is allowed now, and whether a UAV has taken it in this episode.
    actions
        (S, M) the plan of the last episode.
    """

    arrays: ProblemArrays
    episodes: Episodes
    value: Floats
    allowed: Integers
    taken: Integers
    actions: Integers


def table_size(m: int, n: int, bases: int) -> int:
    """Return how many values a table has."""
    return m * (n + 2 + bases) * (n + 1 + bases)


def new_learner(arrays: ProblemArrays) -> Learner:
    """Return a learner that knows nothing: all values are 0."""
    m, n, _ = arrays.shape
    actions = n + 1 + arrays.n_bases
    return Learner(
        arrays,
        new_episodes(arrays, 1),
        np.zeros((m, actions + 1, actions)),
        np.zeros(actions, np.int64),
        np.zeros(actions, np.int64),
        np.empty((int(arrays.max_steps[0]), m), np.int64),
    )


@njit(cache=True, error_model="numpy")
def play(learner: Learner, rates: tuple[float, float, float], rng: np.random.Generator) -> float:
    """Play an episode, learn from it, leave its plan in ``learner.actions`` and return what it earns.

    Parameters
    ----------
    learner
        The learner.
    rates
        Probability of exploration, rate of learning (0: nothing is learned) and discount.
    rng
        The only source of randomness.
    """
    epsilon, rate, gamma = rates
    arrays, episodes = learner.arrays, learner.episodes
    steps, m = learner.actions.shape
    home = arrays.need.shape[1]
    reset_one(arrays, episodes, 0)
    learner.taken[:] = 0
    reward = 0.0
    for s in range(steps):
        for i in range(m):
            action = promised(arrays, episodes, 0, i)
            if action == home:
                explores = rng.random() < epsilon
                action = choose(learner, i, explores, rng.random(), rng.random())
            reward += step(learner, i, action, rate, gamma)
            learner.actions[s, i] = action
    return float(reward + close(arrays, episodes, 0))


@compiled
def choose(learner: Learner, i: int, explores: bool, half: float, which: float) -> int:
    """Return an action of UAV `i` that is allowed; the draws are from 0 to 1."""
    find_allowed(learner, i)
    if not explores:
        return best_allowed(learner, i, row_of(learner, i))
    fresh = 0
    count = 0
    for j in range(learner.allowed.shape[0]):
        count += learner.allowed[j]
        fresh += learner.allowed[j] * (1 - learner.taken[j])
    only_fresh = half < 0.5 and fresh > 0
    left = int(which * (fresh if only_fresh else count))
    for j in range(learner.allowed.shape[0]):
        if learner.allowed[j] == 1 and not (only_fresh and learner.taken[j] == 1):
            if left == 0:
                return j
            left -= 1
    return int(learner.arrays.need.shape[1])


@compiled
def find_allowed(learner: Learner, i: int) -> None:
    """Write which actions UAV `i` has now; home always is one."""
    home = learner.arrays.need.shape[1]
    for j in range(learner.allowed.shape[0]):
        learner.allowed[j] = 1
        if j != home and verdict(learner.arrays, learner.episodes, 0, i, j) != ALLOWED:
            learner.allowed[j] = 0


@compiled
def best_allowed(learner: Learner, i: int, row: int) -> int:
    """Return the allowed action of the largest value; of equals the first."""
    best, chosen = -np.inf, int(learner.arrays.need.shape[1])
    for j in range(learner.allowed.shape[0]):
        if learner.allowed[j] == 1 and learner.value[i, row, j] > best:
            best, chosen = learner.value[i, row, j], j
    return chosen


@compiled
def row_of(learner: Learner, i: int) -> int:
    """Return the row of the table for where UAV `i` is."""
    at = learner.episodes.at[0, i]
    return 0 if at == START else int(at + 1)


@compiled
def step(learner: Learner, i: int, action: int, rate: float, gamma: float) -> float:
    """Let UAV `i` take an action, learn from it, and return what it earns."""
    arrays, episodes = learner.arrays, learner.episodes
    row, home = row_of(learner, i), arrays.need.shape[1]
    if episodes.ret[0, i]:
        return act(arrays, episodes, 0, i, home)
    back = leg_home(arrays, episodes, 0, i) if arrays.terms[0].charge_return else 0.0
    earned = act(arrays, episodes, 0, i, action)
    if rate > 0.0:
        learned = earned
        if action != home:
            if arrays.terms[0].charge_return:
                # What the way home costs is charged where it grows, not at the end alone.
                learned -= cost_of(arrays, 0, leg_home(arrays, episodes, 0, i) - back)
            find_allowed(learner, i)
            after = row_of(learner, i)
            learned += gamma * learner.value[i, after, best_allowed(learner, i, after)]
        else:
            learned = 0.0
        learner.value[i, row, action] += rate * (learned - learner.value[i, row, action])
    learner.taken[action] = 1
    return earned
