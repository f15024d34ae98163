"""QMIX in service mode: a policy for every size, learned on one problem from nothing.

It plays episodes on the problem, learns from what they earned, and imitates the best plan it has seen, which
is the greedy rule's at first.
"""

from __future__ import annotations

import numpy as np

from app.domain.problem import Problem
from app.learning.checkpoints.checkpoint import encode, has_finite_weights
from app.learning.pairwise.architecture import WIDEST, PairwiseConfig
from app.learning.pairwise.policy import PairwisePolicy
from app.learning.parameters import LEARNING_RATE, QmixParameters
from app.learning.universal.episodes.best_plan import BestPlan
from app.learning.universal.episodes.temperature import Temperature
from app.learning.universal.network.architecture import HEADS
from app.learning.universal.request.fine_tuning import TURN_TOKENS, FineTuning
from app.learning.universal.request.recombination import Recombination
from app.simulation.arrays import ProblemArrays, compile_problem
from app.simulation.simulator import new_episodes
from app.solvers.greedy import greedy_plan
from app.solvers.protocol import History, Progress, Report, Solution, StopCriterion
from app.solvers.seeds import seed_sequence


def fits(arrays: ProblemArrays) -> bool:
    """Whether an episode is short enough to learn from it in one update."""
    m, n, _ = arrays.shape
    return m * int(arrays.max_steps[0]) * (n + 1) <= TURN_TOKENS


class UniversalFromScratch:
    """Learns one problem.

    Parameters
    ----------
    problem, seed, stop, report
        As :class:`~app.solvers.protocol.Solver` has them; :func:`fits` is true of the problem.
    parameters
        Of service mode. An epoch is an episode, as in Table 1; up to ``batch_size`` of them are played and
        learned from at a time.
    """

    def __init__(
        self, problem: Problem, parameters: QmixParameters, seed: int, stop: StopCriterion, report: Report
    ) -> None:
        self._problem, self._seed, self._stop, self._report = problem, seed, stop, report
        width = min(WIDEST, -(-parameters.drqn_hidden_dim // HEADS) * HEADS)
        self._parameters = parameters.in_service().model_copy(update={"drqn_hidden_dim": width})
        self._config = PairwiseConfig(width=width, qmix_hidden_dim=parameters.qmix_hidden_dim)
        self._arrays = compile_problem(problem)
        self._best = BestPlan(self._arrays)
        self._history = History()
        initial, episodes = seed_sequence(seed).spawn(2)
        policy = PairwisePolicy.of_seed(self._config, int(initial.generate_state(1)[0]))
        self._tuning = FineTuning(
            policy,
            self._arrays,
            batch_size=parameters.batch_size,
            lr=LEARNING_RATE,
            gamma=parameters.gamma,
            rng=np.random.default_rng(episodes),
        )

    def run(self) -> Solution:
        """Learn until the epochs are done; the best plan is kept throughout."""
        done, epochs, every = 0, self._parameters.n_epochs, self._parameters.evaluate_per_epoch
        if new_episodes(self._arrays, 1).done[0]:
            # Nobody can fly anywhere, so there is nothing to learn.
            self._history.add(0, self._best.reward)
            return self._solution(0)
        self._best.consider(greedy_plan(self._problem, self._stop).as_array()[None])
        self._evaluate(0)
        temperature = Temperature(self._arrays)
        recombination = Recombination(self._arrays, self._best)
        while done < epochs and not self._stop():
            count = min(self._tuning.learned, epochs - done)
            plans = self._tuning.epoch(self._best.actions, self._stop, count, temperature.value)
            if not has_finite_weights(self._tuning.policy):
                # It would play at random and could not be kept; the plans so far are as good as ever.
                break
            temperature.follow(plans, self._best.reward)
            if self._problem.bases:
                self._best.consider(plans)
            else:
                recombination.consider(plans, self._stop)
            done += count
            if (done - count) // every < done // every or done == epochs:
                self._evaluate(done)
            self._report(Progress(done / epochs, done, self._best.reward, self._best.plan))
        return self._solution(done)

    def _evaluate(self, done: int) -> None:
        """Play greedily; what was cut short is no evaluation, but for the first, which there has to be."""
        played = self._tuning.policy.play(self._arrays, np.zeros(1, np.int64), stop=self._stop)
        self._best.consider(played.plans)
        if done == 0 or not self._stop():
            self._history.add(done, float(played.rewards[0]))

    def _solution(self, done: int) -> Solution:
        learned = encode(
            self._tuning.policy,
            config=self._config,
            task=self._problem,
            algorithm="qmix",
            seed=self._seed,
            parameters=self._parameters,
            metrics={"reward": self._best.reward, "greedy_reward": self._history.reward[-1], "epochs": done},
        )
        return Solution(self._best.plan, self._history, self._parameters, checkpoint=learned)
