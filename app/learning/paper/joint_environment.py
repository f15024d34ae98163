"""A problem as the game that DQN learns: one agent, whose actions are the joint actions (section 4.1)."""

from __future__ import annotations

import numpy as np

from app.domain.errors import ProblemTooLarge
from app.domain.plan import Plan
from app.domain.problem import Problem
from app.domain.said import said
from app.learning.paper.architecture import NetworkSizes
from app.learning.paper.environment import swarm_sizes
from app.learning.paper.observations import Float32s, features_of, write_states
from app.simulation.arrays import Flags, Floats, Integers, ProblemArrays, compile_problem
from app.simulation.decorators import compiled
from app.simulation.episodes import Episodes, copy_episode
from app.simulation.simulator import act, end_step, new_episodes, reset, verdict
from app.simulation.visit import ALLOWED

MAX_JOINT_ACTIONS = 20_000
"""Largest joint action space, (N+1)^M, for which values are learned one by one."""


def count_joint_actions(problem: Problem) -> int:
    """Return (N+1)^M.

    Raises
    ------
    ProblemTooLarge
        If it exceeds :data:`MAX_JOINT_ACTIONS`.
    """
    base, exponent = problem.n_targets + 1, problem.n_uavs
    count = int(base**exponent)
    if count > MAX_JOINT_ACTIONS:
        sizes = {"uavs": exponent, "targets": base - 1, "base": base, "limit": MAX_JOINT_ACTIONS}
        # Beyond that, readers of JSON round it.
        if count < 10**15:
            detail = said(
                "{uavs} UAVs and {targets} targets have (N+1)^M = {base}^{uavs} = {count} joint actions; the "
                "limit is {limit}",
                count=count,
                **sizes,
            )
        else:
            detail = said(
                "{uavs} UAVs and {targets} targets have (N+1)^M = {base}^{uavs} = about 10^{zeros} joint "
                "actions; the limit is {limit}",
                zeros=len(str(count)) - 1,
                **sizes,
            )
        raise ProblemTooLarge(detail)
    return count


@compiled
def allowed_joint_actions(
    arrays: ProblemArrays, episodes: Episodes, scratch: Episodes, actions: Integers, out: Flags
) -> None:
    """Find the joint actions in which every UAV's action is allowed at its turn.

    A depth-first search over the UAVs: what follows an action that is not allowed is never looked at.

    Parameters
    ----------
    arrays, episodes
        One episode, which is not changed.
    scratch
        M episodes of the same problem, overwritten: row i is the moment before UAV i acts.
    actions
        (M,), overwritten.
    out
        ((N+1)^M,), overwritten; the first UAV's action is the most significant digit of the index.
    """
    m, home = episodes.at.shape[1], arrays.need.shape[1]
    out[:] = False
    copy_episode(episodes, 0, scratch, 0)
    depth, index = 0, 0
    actions[0] = -1
    while depth >= 0:
        actions[depth] += 1
        action = actions[depth]
        if action > home:
            depth -= 1
            index //= home + 1
            continue
        if action != home and verdict(arrays, scratch, depth, depth, action) != ALLOWED:
            continue
        if depth == m - 1:
            out[index * (home + 1) + action] = True
            continue
        copy_episode(scratch, depth, scratch, depth + 1)
        act(arrays, scratch, depth + 1, depth, action)
        index = index * (home + 1) + action
        depth += 1
        actions[depth] = -1


@compiled
def choose_joint(values: Float32s, allowed: Flags, draws: Floats, epsilon: float) -> int:
    """Choose a joint action epsilon-greedily; among equals everybody's "return", then the smallest index.

    Parameters
    ----------
    values, allowed
        (A,); the last joint action, everybody's "return", is always allowed.
    draws
        (2,) uniform in [0, 1): whether to explore, and what.
    epsilon
        Probability of a random allowed joint action.
    """
    last = allowed.shape[0] - 1
    if draws[0] < epsilon:
        count = 0
        for a in range(last + 1):
            count += allowed[a]
        left = int(draws[1] * count)
        for a in range(last + 1):
            if allowed[a]:
                if left == 0:
                    return a
                left -= 1
    best = last
    for a in range(last):
        if allowed[a] and values[a] > values[best]:
            best = a
    return best


@compiled
def _step(arrays: ProblemArrays, episodes: Episodes, joint: int) -> float:
    m, base = episodes.at.shape[1], arrays.need.shape[1] + 1
    divisor = base ** (m - 1)
    reward = 0.0
    for i in range(m):
        reward += act(arrays, episodes, 0, i, joint // divisor % base)
        divisor //= base
    return reward + end_step(arrays, episodes, 0)


class JointEnvironment:
    """The swarm as one agent; an :class:`~app.learning.paper.environment.Environment`.

    Parameters
    ----------
    problem
        The problem.

    Raises
    ------
    ProblemTooLarge
        If there are more than :data:`MAX_JOINT_ACTIONS` joint actions.
    """

    def __init__(self, problem: Problem) -> None:
        self.sizes = NetworkSizes(1, count_joint_actions(problem), swarm_sizes(problem).state_features, 0)
        self.max_steps = problem.max_steps
        self._base = problem.n_targets + 1
        self._arrays = compile_problem(problem)
        self._features = features_of(problem)
        self._episodes = new_episodes(self._arrays, 1)
        self._scratch = new_episodes(self._arrays, problem.n_uavs)
        self._actions = np.zeros(problem.n_uavs, np.int64)
        self._allowed = np.zeros(self.sizes.n_actions, np.bool_)

    @property
    def done(self) -> bool:
        """Whether the episode is over."""
        return bool(self._episodes.done[0])

    def reset(self) -> None:
        """Begin an episode."""
        reset(self._arrays, self._episodes)

    def observe(self, state: Float32s, allowed: Flags) -> None:
        """Write the state (D,) and the mask of the joint actions (1, A)."""
        write_states(self._features, self._episodes, state[None])
        allowed_joint_actions(self._arrays, self._episodes, self._scratch, self._actions, self._allowed)
        allowed[0] = self._allowed

    def step(self, values: Float32s, draws: Floats, epsilon: float, actions: Integers) -> float:
        """Choose among the joint actions of the last observation and act; values (1, A), draws (1, 2)."""
        actions[0] = choose_joint(values[0], self._allowed, draws[0], epsilon)
        return float(_step(self._arrays, self._episodes, int(actions[0])))

    def plan(self, actions: Integers) -> Plan:
        """Turn the joint actions (T, 1) of an episode into a plan."""
        m = len(self._actions)
        divisors = self._base ** np.arange(m - 1, -1, -1, dtype=np.int64)  # (M,)
        return Plan.of(actions // divisors % self._base, home=self._base - 1)
