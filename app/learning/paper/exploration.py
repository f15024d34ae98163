"""Masked epsilon-greedy choice, one UAV after the other within a step.

Every UAV's Q values come from its observation at the beginning of the step, as in Algorithm 1. What it may do
is looked up again at its turn: otherwise two UAVs could fly to a need that only one of them can fill, and the
second visit, which unloads nothing, is not legal. An action allowed at a UAV's turn was also allowed at the
beginning of the step, since needs only shrink; the mask stored for the bootstrap is the one of the beginning.
"""

from __future__ import annotations

from dataclasses import dataclass

from app.learning.paper.observations import Float32s
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes
from app.simulation.simulator import act, end_step, verdict
from app.simulation.visit import ALLOWED


@dataclass(frozen=True, slots=True)
class EpsilonSchedule:
    """Probability of a random action: linear in the environment steps taken so far.

    Attributes
    ----------
    start, end
        Probabilities before the first step, and from `anneal_steps` on.
    anneal_steps
        At least 1.
    """

    start: float
    end: float
    anneal_steps: int

    def __call__(self, steps: int) -> float:
        """Return the probability after a number of steps."""
        return self.start + (self.end - self.start) * min(1.0, steps / self.anneal_steps)


@compiled
def choose(
    arrays: ProblemArrays,
    episodes: Episodes,
    b: int,
    i: int,
    values: Float32s,
    draws: Floats,
    epsilon: float,
) -> int:
    """Choose UAV `i`'s action at its turn.

    Greedily the allowed action with the largest value; among equals "return", then the target with the
    smallest index. Values that are NaN are never chosen.

    Parameters
    ----------
    arrays, episodes, b
        As in the simulator.
    i
        The UAV.
    values
        (B, M, N+1) Q values.
    draws
        (B, M, 2) uniform in [0, 1): whether to explore, and what.
    epsilon
        Probability of a random allowed action; 0 is greedy whatever the draws are.
    """
    home = arrays.need.shape[1]
    if draws[b, i, 0] < epsilon:
        count = 1
        for j in range(home):
            count += verdict(arrays, episodes, b, i, j) == ALLOWED
        left = int(draws[b, i, 1] * count)
        for j in range(home):
            if verdict(arrays, episodes, b, i, j) == ALLOWED:
                if left == 0:
                    return j
                left -= 1
        return home
    best = home
    for j in range(home):
        if values[b, i, j] > values[b, i, best] and verdict(arrays, episodes, b, i, j) == ALLOWED:
            best = j
    return best


@compiled
def explore(
    arrays: ProblemArrays,
    episodes: Episodes,
    values: Float32s,
    draws: Floats,
    epsilon: float,
    actions: Integers,
    rewards: Floats,
) -> None:
    """Let all UAVs of B episodes choose and act in index order, and close the step.

    Parameters
    ----------
    arrays, episodes, values, draws, epsilon
        As in :func:`choose`.
    actions
        (B, M), overwritten with what was chosen; an episode that is over sends everybody home.
    rewards
        (B,), overwritten with what the step earned, the charged legs home at the end of an episode included.
    """
    for b in range(actions.shape[0]):
        rewards[b] = 0.0
        if episodes.done[b]:
            for i in range(actions.shape[1]):
                actions[b, i] = arrays.need.shape[1]
            continue
        for i in range(actions.shape[1]):
            actions[b, i] = choose(arrays, episodes, b, i, values, draws, epsilon)
            rewards[b] += act(arrays, episodes, b, i, actions[b, i])
        rewards[b] += end_step(arrays, episodes, b)
