"""What playing episodes brings, and what a policy for every size has to offer for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from app.learning.parameters import SERVICE_EPSILON
from app.simulation.arrays import Floats, Integers, ProblemArrays
from app.solvers.protocol import StopCriterion


class Played(NamedTuple):
    """B episodes that were played.

    Attributes
    ----------
    plans
        (B, S, M) joint actions; rows after an episode's end send everybody home.
    rewards
        (B,)
    """

    plans: Integers
    rewards: Floats


class AnySizePolicy(Protocol):
    """A policy for problems of every size.

    Attributes
    ----------
    takes_turns
        Whether UAVs act in the order of their numbers, so that other orders bring other plans; otherwise the
        policy decides who acts first.
    knows_reloads
        Whether it plays problems with bases as they are, and not only what lies before a first reload.
    """

    takes_turns: bool
    knows_reloads: bool

    def play(
        self,
        arrays: ProblemArrays,
        problem: Integers,
        rng: np.random.Generator | None = ...,
        temperature: float = ...,
        stop: StopCriterion = ...,
        spare: Callable[[], int] = ...,
        epsilon: Floats | None = ...,
    ) -> Played:
        """Play one episode of each listed problem.

        Parameters
        ----------
        arrays, problem
            A stack of problems, and (B,) which of them to play.
        rng
            Samples actions with these random numbers; greedy where None.
        temperature
            Of the sampling; less is greedier.
        stop
            Asked again and again; once it is true, every UAV that is still out flies home.
        spare
            Asked how many threads more may be used at this moment; the episodes are the same with any number.
        epsilon
            (B,) of sampled episodes, the chance that an action is any that is allowed, each as likely; none
            where None.
        """
        ...


def exploration(episodes: int) -> Floats:
    """Return the ``epsilon`` (B,) of episodes of which every other one explores."""
    return np.where(np.arange(episodes) % 2, SERVICE_EPSILON, 0.0)


_ANSWERS_A_STEP = 12
"""About as many answers has a step of many UAVs."""


def acting_on_an_answer(uavs: int) -> int:
    """Return how many of the UAVs that are out act on one answer of a policy that decides who acts first."""
    return max(1, uavs // _ANSWERS_A_STEP)


def answers_a_step(uavs: int) -> float:
    """Return how many answers a step has in which so many UAVs are out."""
    return uavs / acting_on_an_answer(uavs)
