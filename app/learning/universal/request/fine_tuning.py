"""Fine-tuning a policy on one problem: its own episodes, and the best plan known as a demonstration."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable

import numpy as np

from app.domain.errors import ProblemTooLarge
from app.domain.said import said
from app.learning.compute.device import learning_device
from app.learning.pairwise.learner import Learner, make_batch, make_decisions
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.pairwise.states import all_turns, some_states
from app.learning.universal.episodes.effort import batch_of, episodes_of
from app.learning.universal.episodes.played import exploration
from app.learning.universal.request.update_time import UpdateTime
from app.simulation.arrays import Integers, ProblemArrays
from app.solvers.protocol import StopCriterion, no_spare_threads

TURN_TOKENS = 4000
"""Tokens of own episodes an epoch learns from at most: turns times targets."""

_STATES = 32
"""States of the best plan that an epoch learns from at most."""

_TD_EVERY = 4
"""Every so many epochs, from the first, the TD loss is learned too; it takes longer than all the rest."""

MAX_BYTES = 2**30
"""Most memory that an update may take; workers share a machine."""


def require_memory(arrays: ProblemArrays) -> None:
    """Refuse a problem on which a policy could not be fine-tuned.

    Raises
    ------
    ProblemTooLarge
        If an update on one episode would take more than :data:`MAX_BYTES`.
    """
    m, n, _ = arrays.shape
    steps = int(arrays.max_steps[0])
    tokens = m + n + arrays.n_bases
    # Biases and weights of attention a pair of tokens, activations a token and a pair, of one episode.
    needed = m * steps * (300 * tokens**2 + 10_000 * tokens + 1_500 * n * m)
    if needed > MAX_BYTES:
        raise ProblemTooLarge(
            said(
                "fine-tuning on {uavs} UAVs and {targets} targets over {steps} steps takes {needed} MiB; "
                "the limit is {limit} MiB",
                uavs=m,
                targets=n,
                steps=steps,
                needed=round(needed / 2**20),
                limit=round(MAX_BYTES / 2**20),
            )
        )


class FineTuning:
    """Fits a copy of a policy to a problem, epoch by epoch.

    Parameters
    ----------
    policy
        Where it begins; not changed. The copy learns on a GPU where there is one.
    arrays
        A stack of one problem.
    batch_size
        Episodes an epoch learns from at most; fewer where they are long.
    lr, gamma
        Learning rate of Adam, discount.
    rng
        Source of the episodes.
    spare
        How many threads more playing may use at this moment; episodes are the same with any number.
    """

    def __init__(
        self,
        policy: PairwisePolicy,
        arrays: ProblemArrays,
        *,
        batch_size: int,
        lr: float,
        gamma: float,
        rng: np.random.Generator,
        spare: Callable[[], int] = no_spare_threads,
    ) -> None:
        self._device = learning_device()
        self.policy = copy.deepcopy(policy).to(self._device)
        self._arrays, self._rng, self._spare, self._epochs = arrays, rng, spare, 0
        m, n, _ = arrays.shape
        tokens = m * int(arrays.max_steps[0]) * (n + 1)
        self._learned = batch_of(arrays, max(1, min(batch_size, TURN_TOKENS // tokens)))
        self._played = episodes_of(arrays, self._learned)
        self._time = UpdateTime(arrays, policy.config)
        self._learner = Learner(self.policy.agent, self.policy.mixer, lr=lr, td_weight=0.2, gamma=gamma)

    @property
    def learned(self) -> int:
        """Episodes an epoch learns from at most; it may play more, for their routes."""
        return self._learned

    def epoch(
        self, best: Integers, stop: StopCriterion, episodes: int | None = None, temperature: float = 1.0
    ) -> Integers:
        """Play some episodes, learn from the best plan and, now and then, from them; return them (B, S, M).

        Parameters
        ----------
        best
            (S, M) the best plan there is; one that flies nowhere is not learned from.
        stop
            Once it is true nothing more is learned, nor where it leaves less time than that will take.
        episodes
            How many; where None as many more than :attr:`learned` as are quickly played.
        temperature
            At which their actions are drawn.
        """
        problem = np.zeros(episodes or self._played, np.int64)
        plans = self.policy.play(
            self._arrays,
            problem,
            self._rng,
            temperature,
            stop,
            self._spare,
            exploration(len(problem)),
        ).plans
        if self._epochs % _TD_EVERY == 0:
            self._learn_rewards(plans[: self._learned], stop)
        self._epochs += 1
        if (best < self._arrays.shape[1]).any():
            self._imitate(best, stop)
        return plans

    def _learn_rewards(self, plans: Integers, stop: StopCriterion) -> None:
        """Take one step by what some episodes earned."""
        turns = [each for each in (all_turns(self._arrays, plan) for plan in plans) if len(each.step)]
        if turns:
            decisions = make_decisions(turns, self._device)
            count = len(decisions.uav)
            self._learn(count, True, lambda: self._learner.update(1.0, decisions=decisions, stop=stop), stop)

    def _imitate(self, plan: Integers, stop: StopCriterion) -> None:
        """Take one step towards a plan."""
        states = some_states(self._arrays, plan, _STATES, self._rng)
        if len(states.action):
            batch = make_batch([states], self._device)
            count = len(states.action)
            self._learn(count, False, lambda: self._learner.update(1.0, batch, stop=stop), stop)

    def _learn(
        self, states: int, bootstrap: bool, update: Callable[[], dict[str, float]], stop: StopCriterion
    ) -> None:
        """Take one step, unless its time is up, or would be before its end."""
        begun = time.monotonic()
        if stop() or self._time.expected(states, bootstrap=bootstrap) > stop.seconds_left():
            return
        if update():
            self._time.took(states, time.monotonic() - begun, bootstrap=bootstrap)
