"""Fine-tuning a policy on one problem: its own episodes, and the best plan known as a demonstration."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable

import numpy as np

from app.domain.errors import ProblemTooLarge
from app.learning.compute.device import learning_device
from app.learning.universal.episodes.effort import batch_of, episodes_of
from app.learning.universal.episodes.played import exploration
from app.learning.universal.episodes.policy import UniversalPolicy
from app.learning.universal.episodes.rollout import play
from app.learning.universal.episodes.turns import replay_turns
from app.learning.universal.updates.learner import Learner, make_batch
from app.learning.universal.updates.update_time import UpdateTime
from app.simulation.arrays import Integers, ProblemArrays
from app.simulation.stacks import stack
from app.solvers.protocol import StopCriterion, no_spare_threads

TURN_TOKENS = 4000
"""Tokens of own episodes an epoch learns from at most: turns times targets."""

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
    # Biases and weights of attention a pair of tokens, activations a token and a rival.
    needed = m * steps * (300 * (n + 1) ** 2 + 10_000 * n + 700 * n * m)
    if needed > MAX_BYTES:
        raise ProblemTooLarge(
            f"fine-tuning on {m} UAVs and {n} targets over {steps} steps takes {needed / 2**20:.0f} MiB; "
            f"the limit is {MAX_BYTES / 2**20:.0f} MiB"
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
        policy: UniversalPolicy,
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
        plans = play(
            self.policy.agent,
            self._arrays,
            problem,
            self._rng,
            temperature,
            stop,
            self._spare,
            exploration(len(problem)),
        ).plans
        if self._epochs % _TD_EVERY == 0:
            self._learn(plans[: self._learned], stop, imitate=False)
        self._epochs += 1
        if (best < self._arrays.shape[1]).any():
            self._learn(best[None], stop, imitate=True)
        return plans

    def _learn(self, plans: Integers, stop: StopCriterion, *, imitate: bool) -> None:
        """Take one step, unless its time is up, or would be before its end."""
        begun = time.monotonic()
        n = self._arrays.shape[1]
        visits_and_returns = int((plans < n).sum()) + plans.shape[0] * plans.shape[2]
        expected = self._time.expected(visits_and_returns, bootstrap=not imitate)
        if stop() or expected > stop.seconds_left():
            return
        problem = np.zeros(len(plans), np.int64)
        turns = replay_turns(self._arrays, problem, plans)
        stacked = stack([self._arrays] * len(plans))
        batch = make_batch(stacked, turns, self._device)
        if self._learner.update(batch, 1.0, imitate=imitate, bootstrap=not imitate, stop=stop):
            took = time.monotonic() - begun
            self._time.took(visits_and_returns, took, bootstrap=not imitate)
