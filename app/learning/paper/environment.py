"""Games that agents learn: the swarm, one agent a UAV."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from app.domain.plan import Plan
from app.domain.problem import Problem
from app.learning.paper.architecture import TARGET_FIELDS, UAV_FIELDS, NetworkSizes
from app.learning.paper.exploration import explore
from app.learning.paper.observations import Float32s, features_of, write_states
from app.simulation.arrays import Flags, Floats, Integers, compile_problem
from app.simulation.simulator import allowed_actions, new_episodes, reset


class Environment(Protocol):
    """A game of M agents with A actions each, whose episodes end within `max_steps` steps."""

    sizes: NetworkSizes
    max_steps: int

    @property
    def done(self) -> bool:
        """Whether the episode is over."""
        ...

    def reset(self) -> None:
        """Begin an episode."""
        ...

    def observe(self, state: Float32s, allowed: Flags) -> None:
        """Write the state (D,) and the mask (M, A) of this moment."""
        ...

    def step(self, values: Float32s, draws: Floats, epsilon: float, actions: Integers) -> float:
        """Choose epsilon-greedily, act, and return what the step earned.

        Parameters
        ----------
        values
            (M, A) Q values.
        draws
            (M, 2) uniform in [0, 1).
        epsilon
            Probability of a random action; 0 is greedy whatever the draws are.
        actions
            (M,), overwritten with what was chosen.
        """
        ...

    def plan(self, actions: Integers) -> Plan:
        """Turn the actions (T, M) of an episode of at least one step into a plan."""
        ...


def swarm_sizes(problem: Problem) -> NetworkSizes:
    """Return the sizes of the game in which every UAV is an agent."""
    m, n, k = problem.n_uavs, problem.n_targets, problem.n_materials
    return NetworkSizes(m, n + 1, UAV_FIELDS + k, n * (TARGET_FIELDS + k))


class SwarmEnvironment:
    """A problem as the game that QMIX learns: every UAV is an agent, a target or "return" its action.

    Parameters
    ----------
    problem
        The problem.
    """

    def __init__(self, problem: Problem) -> None:
        self.sizes = swarm_sizes(problem)
        self.max_steps = problem.max_steps
        self._arrays = compile_problem(problem)
        self._features = features_of(problem)
        self._episodes = new_episodes(self._arrays, 1)
        self._reward = np.zeros(1)

    @property
    def done(self) -> bool:
        """Whether the episode is over."""
        return bool(self._episodes.done[0])

    def reset(self) -> None:
        """Begin an episode."""
        reset(self._arrays, self._episodes)

    def observe(self, state: Float32s, allowed: Flags) -> None:
        """Write the state and the mask of this moment; see :class:`Environment`."""
        write_states(self._features, self._episodes, state[None])
        allowed_actions(self._arrays, self._episodes, allowed[None])

    def step(self, values: Float32s, draws: Floats, epsilon: float, actions: Integers) -> float:
        """Let the UAVs choose and act in turn; see :class:`Environment`."""
        explore(self._arrays, self._episodes, values[None], draws[None], epsilon, actions[None], self._reward)
        return float(self._reward[0])

    def plan(self, actions: Integers) -> Plan:
        """Turn the actions (T, M) of an episode into a plan."""
        return Plan.of(actions, home=self.sizes.n_actions - 1)
